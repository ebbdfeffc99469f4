import { expect, test } from "vitest";
import { crc32, dropped, stored } from "../src/start/folders";

const bytes = async (file: Blob) => new Uint8Array(await file.arrayBuffer());

test("the checksum is that of the format", () => {
  expect(crc32(new TextEncoder().encode("123456789"))).toBe(0xcbf43926);
});

test("what is packed has its directory behind it", async () => {
  const file = await stored("turn", [
    { path: "left/a.png", file: new File(["abc"], "a.png", { lastModified: 7 }) },
    { path: "ü.png", file: new File([""], "ü.png", { lastModified: 9 }) },
  ]);
  expect([file.name, file.lastModified]).toEqual(["turn.zip", 9]);
  const view = new DataView((await bytes(file)).buffer);
  const end = file.size - 22;
  expect(view.getUint32(end, true)).toBe(0x06054b50);
  expect(view.getUint16(end + 10, true)).toBe(2);
  const directory = view.getUint32(end + 16, true);
  expect(view.getUint32(directory, true)).toBe(0x02014b50);
  expect(directory + view.getUint32(end + 12, true)).toBe(end);
});

/** A folder as browsers hand it out: a few entries at a time. */
function folder(name: string, inside: object[]): object {
  const rest = [inside.slice(0, 1), inside.slice(1), []];
  return {
    name,
    isDirectory: true,
    createReader: () => ({ readEntries: (done: (some: object[]) => void) => done(rest.shift() ?? []) }),
  };
}

const leaf = (name: string) => ({
  name,
  isDirectory: false,
  file: (done: (file: File) => void) => done(new File([name], name)),
});

test("a folder that is dropped is one file, and what lies beside it stays", async () => {
  const tree = folder("part", [folder("left", [leaf("a.png"), leaf("b.png")]), leaf("c.png"), leaf(".DS_Store")]);
  const data = {
    files: [new File(["x"], "part"), new File(["y"], "rig.json")],
    items: [
      { kind: "file", webkitGetAsEntry: () => tree },
      { kind: "file", webkitGetAsEntry: () => leaf("rig.json") },
    ],
  };
  const sent = await dropped(data as unknown as DataTransfer);
  expect(sent.map(({ name }) => name)).toEqual(["rig.json", "part.zip"]);
  const text = new TextDecoder().decode(await bytes(sent[1]));
  for (const name of ["left/a.png", "left/b.png", "c.png"]) expect(text).toContain(name);
  expect(text).not.toContain("DS_Store");
});
