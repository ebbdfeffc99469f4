import { expect, test } from "vitest";
import { depths, dots } from "../src/calibrate/space";

const CORNERS = new Float32Array([10, -20, 400, 1, 30, 5, 300, 2, -10, 0, 500, 1]);

test("the nearest and the farthest corner", () => {
  expect(depths(CORNERS)).toEqual([300, 500]);
  expect(depths(new Float32Array())).toBeNull();
});

test("corners of some views, away from the camera to the right", () => {
  expect(dots(CORNERS, 0, new Set([1]), 0.1)).toBe("M40.0 1.0h0M50.0 -1.0h0");
  expect(dots(CORNERS, 1, new Set([2]), 0.1)).toBe("M30.0 0.5h0");
  expect(dots(CORNERS, 0, new Set(), 0.1)).toBe("");
});
