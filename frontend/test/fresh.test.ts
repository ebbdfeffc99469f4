/** What of a view belongs to the scan that it shows. */
import { afterEach, expect, it } from "vitest";
import { closePage, openPage, type Page } from "./page";

afterEach(closePage);

async function open(page: Page, scan: string): Promise<void> {
  await page.say({
    kind: "opened",
    id: page.asked("open").at(-1)?.id,
    scan,
    name: scan,
    revision: 0,
    epoch: 0,
    steps: 4,
    grids: [{ grid: 0, laser: "l", first_step: 0, last_step: 3 }],
    figures: { vertices: 9, faces: 8, bounds: null, closed: false, volume: null },
    history: [],
    cursor: 0,
    branches: [],
    scanned_picture: "",
    findings: [],
    measures: [],
  });
}

it("starts anew with another scan, and goes on with the same one", async () => {
  const page = await openPage({ hash: "#repair/cup" });
  const repair = await import("../src/repair/state");
  const { colouring, tool } = await import("../src/viewport/place");
  repair.startRepair();
  await page.connect();
  await open(page, "cup");
  const fresh = [tool.value, repair.tab.value, repair.pictureTool.value, repair.gridShown.value];
  tool.value = "lasso";
  colouring.value = "shapes";
  repair.tab.value = "history";
  repair.gridShown.value = 1;
  repair.large.value = "picture";
  page.part.mark.value = { grid: 0, step: 1, line: 2 } as never;
  await open(page, "cup");
  expect(tool.value).toBe("lasso");
  expect(page.part.mark.value).not.toBeNull();
  await page.walk("#repair/vase");
  await open(page, "vase");
  expect([tool.value, repair.tab.value, repair.pictureTool.value, repair.gridShown.value]).toEqual(fresh);
  expect(colouring.value).toBe("plain");
  expect(repair.large.value).toBeNull();
  expect(page.part.mark.value).toBeNull();
  expect(page.part.profile.value).toBeNull();
});
