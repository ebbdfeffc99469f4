import { expect, test } from "vitest";
import { csvOf, fitsOf, type Picked, readPlace, sideBySide, withPlace } from "../src/verbs/points";

const POSES = [
  ["a", "up"],
  ["b", "lying, turned"],
] as const;

test("a click belongs to the first point that its pose has not", () => {
  let points: readonly Picked[] = [];
  points = withPlace(points, "a", [1, 0, 0]);
  points = withPlace(points, "a", [2, 0, 0]);
  points = withPlace(points, "b", [3, 0, 0]);
  expect(points).toHaveLength(2);
  expect(points[0].get("b")).toEqual([3, 0, 0]);
  expect(points[1].has("b")).toBe(false);
});

test("points known in one pose alone are left out, and names with commas are quoted", () => {
  const points: readonly Picked[] = [
    new Map([["a", [1, 2, 3]]]),
    new Map([
      ["a", [1, 2, 3]],
      ["b", [-0.5, 1e-9, 7.12345]],
    ]),
  ] as Picked[];
  expect(csvOf(points, POSES)).toBe('point,pose,x,y,z\n2,up,1.000,2.000,3.000\n2,"lying, turned",-0.500,0.000,7.123\n');
  expect(csvOf(points.slice(0, 1), POSES)).toBe("");
  expect(csvOf(points, POSES.slice(0, 1))).toBe("");
});

test("four poses are side by side; of more, the last place is for one of the rest", () => {
  expect(sideBySide(["a", "b", "c"], "")).toEqual({ shown: ["a", "b", "c"], choice: [] });
  expect(sideBySide(["a", "b", "c", "d"], "b")).toEqual({ shown: ["a", "b", "c", "d"], choice: [] });
  const five = ["a", "b", "c", "d", "e"];
  expect(sideBySide(five, "e")).toEqual({ shown: ["a", "b", "c", "e"], choice: ["d", "e"] });
  expect(sideBySide(five, "a")).toEqual({ shown: ["a", "b", "c", "d"], choice: ["d", "e"] });
});

test("a place is three numbers", () => {
  expect(readPlace("1, -2.5; 3e1")).toEqual([1, -2.5, 30]);
  for (const text of ["", "1 2", "1 2 3 4", "1, x, 3"]) expect(readPlace(text)).toBeNull();
});

test("a pose is compared with the first one before it that it shares three points with", () => {
  const corners = [
    [0, 0, 0],
    [10, 0, 0],
    [0, 20, 0],
  ] as const;
  const pair = (one: string, other: string) =>
    corners.map(
      ([x, y, z]) =>
        new Map([
          [one, [x, y, z]],
          [other, [5 - y, x + (x ? 0.3 : 0), z]],
        ]),
    ) as unknown as Picked[];
  const [alone] = fitsOf(pair("b", "c"), ["a", "b", "c"]);
  expect([alone.pose, alone.to, [...alone.off.keys()]]).toEqual(["c", "b", [0, 1, 2]]);
  expect(Math.max(...alone.off.values())).toBeGreaterThan(0.05);
  expect(Math.max(...alone.off.values())).toBeLessThan(0.3);
  const both = fitsOf([...pair("b", "c"), ...pair("a", "c"), ...pair("a", "b")], ["a", "b", "c"]);
  expect(both.map(({ pose, to }) => [pose, to])).toEqual([
    ["b", "a"],
    ["c", "a"],
  ]);
  expect(fitsOf(pair("b", "c").slice(1), ["a", "b", "c"])).toEqual([]);
});
