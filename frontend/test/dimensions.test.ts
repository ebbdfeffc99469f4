import { expect, test } from "vitest";
import { csv, written } from "../src/inspect/dimensions";
import { colourVertices, diverging, UNMEASURED } from "../src/mesh/colours";
import { MeshModel } from "../src/mesh/model";
import type { Measure } from "../src/protocol";

const MEASURE: Measure = {
  measure: "edit-3",
  what: "diameter",
  value: 24.0123,
  unit: "mm",
  uncertainty: 0.0123,
  places: [],
  text: 'section at z = 4 mm, "loop"',
  name: "bore",
  nominal: 24,
  lower: -0.05,
  upper: 0.05,
  verdict: "pass",
  outdated: false,
  noise: 0.01,
  shared: null,
  complete: true,
  doubt: "",
};

test("a figure has the digits that its uncertainty leaves", () => {
  expect(written(MEASURE)).toBe("24.012 ± 0.012 mm");
  expect(written({ ...MEASURE, uncertainty: null })).toBe("24.012 mm");
});

test("the table names limits and verdict, and quotes words", () => {
  const [head, row] = csv([MEASURE]).split("\r\n");
  expect(head.split(",")).toHaveLength(11);
  expect(row).toBe('"bore",diameter,24.0123,0.0123,mm,24,-0.05,0.05,pass,no,"section at z = 4 mm, ""loop"""');
});

test("a deviation map is the same on both sides, and leaves out what is unknown", () => {
  const v = 4;
  const model = new MeshModel({
    positions: new Float32Array(3 * v),
    faces: new Uint32Array([0, 1, 2]),
    alive: new Uint8Array([1]),
    measured: new Uint8Array([1]),
    sigma: new Float32Array(v),
    laser: new Int32Array(v),
    step: new Int32Array(v),
    line: new Int32Array(v),
  });
  expect(colourVertices(model, "deviation").legend).toBeNull();
  model.deviation = new Float32Array([-0.1, 0, 0.2, Number.NaN]);
  const { rgba, legend } = colourVertices(model, "deviation");
  expect(legend?.low).toBeCloseTo(-0.2);
  expect(legend?.high).toBeCloseTo(0.2);
  const at = (k: number) => [...rgba.subarray(4 * k, 4 * k + 3)];
  const near = (t: number) => diverging(t).map(Math.round);
  expect(at(2)).toEqual(near(1));
  for (const [i, x] of at(1).entries()) expect(Math.abs(x - near(0.5)[i])).toBeLessThan(4);
  expect(at(3)).toEqual([...UNMEASURED]);
});
