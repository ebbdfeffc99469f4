import { describe, expect, it } from "vitest";
import { Arrays, pack, unpack } from "../src/envelope";
import { flagWords, Grid } from "../src/grid/data";
import { strokeOf } from "../src/keys";
import { Profile } from "../src/profile/data";
import type { GridHeader, ProfileHeader } from "../src/protocol";

describe("envelope", () => {
  it("comes back as it went, arrays at multiples of 8", () => {
    const message = pack(
      { kind: "edit", text: "größer" },
      { faces: Uint32Array.of(1, 2, 3), some: Float32Array.of(NaN, 1.5) },
    );
    const { header, arrays } = unpack<{ kind: string; text: string }>(message);
    expect(header).toMatchObject({ kind: "edit", text: "größer" });
    expect([...arrays.u32("faces")]).toEqual([1, 2, 3]);
    expect(arrays.u32("faces").byteOffset % 8).toBe(0);
    expect(arrays.f32("some")[1]).toBe(1.5);
    expect(arrays.f32("some").byteOffset % 8).toBe(0);
    expect(() => arrays.f32("faces")).toThrow("another type");
    expect(() => arrays.u8("none")).toThrow("without the array");
  });
});

/** Steps from `first`, three lines, heights that say step and line. */
function grid(first: number, steps: number): Grid {
  const n = 3 * steps;
  const items = new Map(
    Object.entries({
      steps: { array: Int32Array.from({ length: steps }, (_, i) => first + i), shape: [steps] },
      angles: { array: new Float32Array(steps), shape: [steps] },
      points: { array: Float32Array.from({ length: 3 * n }, (_, i) => 100 * first + i), shape: [steps, 3, 3] },
      sigma: { array: new Float32Array(n).fill(first), shape: [steps, 3] },
      amplitude: { array: new Float32Array(n), shape: [steps, 3] },
      flags: { array: new Uint16Array(n).fill(first), shape: [steps, 3] },
      cause: { array: new Uint8Array(n), shape: [steps, 3] },
      edited: { array: new Uint8Array(n).fill(first ? 1 : 0), shape: [steps, 3] },
      off: { array: new Uint8Array(steps).fill(first ? 1 : 0), shape: [steps] },
    }),
  );
  return new Grid({ grid: 0, laser: "a", closed: true } as GridHeader, new Arrays(items));
}

describe("Grid", () => {
  it("takes the rows of another one in place of its own", () => {
    const whole = grid(0, 5);
    const next = whole.withRows(grid(2, 1));
    expect(next.point(2, 1)).toEqual([203, 204, 205]);
    expect(next.point(1, 1)).toEqual(whole.point(1, 1));
    expect([...next.off]).toEqual([0, 0, 1, 0, 0]);
    expect([...next.edited.subarray(3, 9)]).toEqual([0, 0, 0, 1, 1, 1]);
    expect([...whole.off]).toEqual([0, 0, 0, 0, 0]);
  });

  it("says flags in words", () => {
    expect(flagWords(16 | 64)).toBe("stray light, several candidates");
    expect(flagWords(0)).toBe("");
  });
});

describe("Profile", () => {
  it("lists the candidates of a line, and which is in use", () => {
    const items = new Map(
      Object.entries({
        position: { array: Float32Array.of(5, NaN), shape: [2] },
        candidates: { array: Float32Array.of(5, 9, NaN, NaN), shape: [2, 2] },
        candidate_amplitude: { array: Float32Array.of(80, 120, NaN, NaN), shape: [2, 2] },
        candidate_points: { array: new Float32Array(12).fill(NaN).fill(1, 0, 3), shape: [2, 2, 3] },
        chosen: { array: Int8Array.of(0, -1), shape: [2] },
      }),
    );
    const profile = new Profile({ grid: 0, step: 3, orientation: "horizontal" } as ProfileHeader, new Arrays(items));
    expect(profile.of(0)).toEqual([
      { position: 5, amplitude: 80, chosen: true, point: [1, 1, 1] },
      { position: 9, amplitude: 120, chosen: false, point: null },
    ]);
    expect(profile.of(1)).toEqual([]);
    expect(profile.pixel(1, 7.5)).toEqual([1, 7.5]);
  });
});

describe("keys", () => {
  const stroke = (key: string, held = "") =>
    strokeOf({
      key,
      ctrlKey: held.includes("c"),
      altKey: held.includes("a"),
      shiftKey: held.includes("s"),
      metaKey: held.includes("m"),
    });

  it("are named as the sheet writes them", () => {
    expect(stroke("z", "c")).toBe("Ctrl+Z");
    expect(stroke("Z", "cs")).toBe("Ctrl+Shift+Z");
    expect(stroke("?", "s")).toBe("?");
    expect(stroke("+", "s")).toBe("+");
    expect(stroke("PageUp", "s")).toBe("Shift+PgUp");
    expect(stroke(".", "c")).toBe("Ctrl+.");
    expect(stroke("k", "m")).toBe("Ctrl+K");
    expect(stroke(" ")).toBe("Space");
  });
});
