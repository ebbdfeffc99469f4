import { expect, it } from "vitest";
import { residuals } from "../src/mesh/rigid";
import type { Vec } from "../src/viewport/camera";

const POINTS: Vec[] = [
  [10, 0, 3],
  [-4, 8, 1],
  [2, -7, 12],
  [5, 5, 20],
];

/** About z by an angle, then about x by the same, then shifted. */
function moved([x, y, z]: Vec, angle: number): Vec {
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const [p, q] = [c * x - s * y, s * x + c * y];
  return [p + 100, c * q - s * z - 30, s * q + c * z + 5];
}

it("fits points that were moved as one, by any angle", () => {
  for (const angle of [0, 0.3, 1.6, 3, Math.PI, -2.5]) {
    const off = residuals(
      POINTS,
      POINTS.map((p) => moved(p, angle)),
    );
    for (const one of off) expect(one).toBeLessThan(1e-6);
  }
});

it("tells the point that was picked wrongly by the largest distance", () => {
  const wrong = POINTS.map((p) => moved(p, 0.7));
  wrong[2] = [wrong[2][0] + 6, wrong[2][1], wrong[2][2]];
  const off = residuals(POINTS, wrong);
  expect(off.indexOf(Math.max(...off))).toBe(2);
  expect(Math.max(...off)).toBeGreaterThan(1.5);
});

it("does not turn a part into its mirror image", () => {
  const mirrored = POINTS.map(([x, y, z]): Vec => [-x, y, z]);
  expect(Math.max(...residuals(POINTS, mirrored))).toBeGreaterThan(2);
});
