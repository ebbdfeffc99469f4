import { describe, expect, it } from "vitest";
import { MeshModel } from "../src/mesh/model";
import { lengthOf, outline } from "../src/mesh/section";

/** A cube of 2 mm about the origin. */
function cube(): MeshModel {
  const positions = Float32Array.from({ length: 24 }, (_, i) => ((Math.floor(i / 3) >> (i % 3)) & 1 ? 1 : -1));
  const sides = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5];
  const faces: number[] = [];
  for (let i = 0; i < 24; i += 4) {
    const [a, b, c, d] = sides.slice(i, i + 4);
    faces.push(a, b, c, a, c, d);
  }
  const none = new Int32Array(8).fill(-1);
  return new MeshModel({
    positions,
    faces: Uint32Array.from(faces),
    alive: new Uint8Array(12).fill(1),
    measured: new Uint8Array(12).fill(1),
    sigma: new Float32Array(8),
    laser: none,
    step: none.slice(),
    line: none.slice(),
  });
}

describe("the outline in a plane", () => {
  it("of a cube is a square, a diagonal rectangle, and nothing outside", () => {
    expect(lengthOf(outline(cube(), [0, 0, 1], 0.3))).toBeCloseTo(8, 5);
    const half = Math.SQRT1_2;
    expect(lengthOf(outline(cube(), [half, half, 0], 0))).toBeCloseTo(4 + 4 * Math.SQRT2, 4);
    expect(outline(cube(), [0, 0, 1], 1.5)).toHaveLength(0);
  });

  it("lies in the plane, and leaves out what was deleted", () => {
    const mesh = cube();
    const whole = outline(mesh, [0, 0.6, 0.8], 0.2);
    for (let i = 0; i < whole.length; i += 3) expect(0.6 * whole[i + 1] + 0.8 * whole[i + 2]).toBeCloseTo(0.2, 5);
    mesh.apply({ kind: "alive", value: false, faces: Uint32Array.from([0, 1, 2, 3, 4, 5]) });
    expect(outline(mesh, [0, 0.6, 0.8], 0.2).length).toBeLessThan(whole.length);
  });

  it("through vertices is closed: every end meets another", () => {
    const pieces = outline(cube(), [0, 0, 1], 1);
    const ends = new Map<string, number>();
    for (let i = 0; i < pieces.length; i += 3) {
      const key = [...pieces.slice(i, i + 3)].map((x) => x.toFixed(5)).join();
      ends.set(key, (ends.get(key) ?? 0) + 1);
    }
    expect(pieces.length).toBeGreaterThan(0);
    expect([...ends.values()].every((n) => n % 2 === 0)).toBe(true);
  });
});
