/** The scan as a picture: what its colours say. */
import { expect, test } from "vitest";
import { Grid } from "../src/grid/data";
import { GridView } from "../src/grid/view";
import { CAUSES } from "../src/palette";

test("every cause of a gap has a colour of its own, and so has what is there", () => {
  const causes = ["", ...CAUSES.map((_, i) => `cause ${i + 1}`)];
  const grid: Grid = Object.assign(Object.create(Grid.prototype), {
    header: { causes },
    cause: Uint8Array.from(causes.keys()),
  });
  const key = GridView.key(grid, "cause");
  expect(key.map((one) => one.text)).toEqual(["measured", ...causes.slice(1)]);
  expect(key.slice(1).map((one) => one.colour)).toEqual(CAUSES);
  const apart = key.flatMap((a, i) =>
    key.slice(i + 1).map((b) => Math.hypot(...a.colour.map((x, k) => x - b.colour[k]))),
  );
  expect(Math.min(...apart)).toBeGreaterThan(40);
});
