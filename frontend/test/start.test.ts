import { afterEach, describe, expect, it, test, vi } from "vitest";
import { PROTOCOL } from "../src/protocol";
import { copyName, findingWords } from "../src/start/gallery";
import { fullTurn, pictureOf, ranges } from "../src/verbs/preview";
import { closePage, openPage } from "./page";

afterEach(closePage);

describe("a card of the gallery", () => {
  test("counts findings in words, and says nothing of what is not known", () => {
    expect(findingWords(null)).toBe("");
    expect(findingWords({ errors: 0, warnings: 0, notes: 0 })).toBe("no findings");
    expect(findingWords({ errors: 1, warnings: 0, notes: 3 })).toBe("1 error, 3 notes");
  });

  test("a copy gets a name that no scan has", () => {
    expect(copyName("cup", ["cup"])).toBe("cup copy");
    expect(copyName("cup", ["cup", "cup copy", "cup copy 2"])).toBe("cup copy 3");
  });
});

it("leaves a scan whose file was renamed or thrown away", async () => {
  const page = await openPage({ hash: "#repair/abcd" });
  await page.connect();
  await page.say({ kind: "hello", protocol: PROTOCOL, client: "me", operator: "me", scans: [], binned: [] });
  await page.say({ kind: "closed", scan: "other" });
  expect(page.state.place.value.room).toBe("repair");
  vi.spyOn(page.part.opened, "value", "get").mockReturnValue({ scan: "abcd" } as never);
  await page.say({ kind: "closed", scan: "abcd" });
  expect(page.state.place.value).toEqual({ room: "projects", scan: null });
});

describe("what is said of pictures before their import", () => {
  test("even steps of a turn count what is missing", () => {
    expect(fullTurn([{ steps: [0, 1, 3], missing: [2] }])).toBe("step:90");
    expect(
      fullTurn([
        { steps: [0, 1], missing: [] },
        { steps: [0, 1, 2], missing: [] },
      ]),
    ).toBe("step:120");
    expect(fullTurn([])).toBeNull();
  });

  test("gaps are written as ranges", () => {
    expect(ranges([3, 7, 8, 9])).toBe("3, 7–9");
    expect(ranges([])).toBe("");
  });

  test("a finding leads to the first picture that it names", () => {
    const series = { pictures: ["s1.png", "s11.png", "s2.png"] };
    expect(pictureOf({ where: "s11.png, s2.png" }, series)).toBe(1);
    expect(pictureOf({ where: "laser right" }, series)).toBeNull();
  });
});
