import { expect, test } from "vitest";
import { idleIn } from "../src/repair/choices";

test("settings without an effect are those that turnscan refuses", () => {
  const usual = { close: false, merge: "auto", spacing: null };
  const closing = ["fill", "top", "bottom", "largest_hole"];
  expect(idleIn(usual)).toEqual([...closing, "spacing_by"]);
  expect(idleIn({ ...usual, close: true, spacing: 1 })).toEqual([]);
  expect(idleIn({ ...usual, merge: "tsdf" })).not.toContain("voxel");
  for (const merge of ["grid", "paste"]) expect(idleIn({ ...usual, merge })).toContain("voxel");
});
