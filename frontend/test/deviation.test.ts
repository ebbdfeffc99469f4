import { expect, test } from "vitest";
import { readDatums, toleranceTable } from "../src/inspect/deviation";
import { isMesh } from "../src/verbs/result";

test("datums are whole numbers from 1 on, and nothing else is guessed", () => {
  expect(readDatums("1, 3;2  4")).toEqual([1, 3, 2, 4]);
  expect(readDatums(" ")).toEqual([]);
  for (const text of ["1.5", "-1", "0", "1-3", "A, B"]) expect(readDatums(text)).toBeNull();
});

test("tolerances that are typed in become a table", () => {
  expect(toleranceTable("", null)).toBe("");
  expect(toleranceTable('±0.1 "fine"', 0.2)).toBe('feature,quantity,tolerance\n*,*,"±0.1 ""fine"""\n*,profile,0.2\n');
});

test("a drawing is not shown as a surface", () => {
  expect(isMesh("cup.ply")).toBe(true);
  expect(isMesh("cut.dxf")).toBe(false);
});
