import { expect, test } from "vitest";
import { RefusedError } from "../src/link";
import { put, type Sent, type Wire } from "../src/verbs/upload";

const KB = 1 << 10;

/** A server that keeps pieces, loses some of them on the way, and a browser's storage. */
class World implements Wire {
  kept = new Map<string, { total: number; parts: Uint8Array[] }>();
  taken: { path: string; bytes: Uint8Array }[] = [];
  paths: string[] = [];
  /** Bytes of the next pieces that arrive before the connection breaks; null: all of them. */
  breaks: (number | null)[] = [];
  down = 0;
  clock = 0;
  piece = 8 * KB;
  store = new Map<string, string>();
  storage = {
    getItem: (key: string) => this.store.get(key) ?? null,
    setItem: (key: string, value: string) => void this.store.set(key, value),
    removeItem: (key: string) => void this.store.delete(key),
  };
  now = () => this.clock;
  sleep = async (ms: number) => {
    this.clock += ms;
  };

  private size = (name: string) => this.kept.get(name)?.parts.reduce((sum, part) => sum + part.length, 0) ?? -1;

  async http(path: string, init: RequestInit = {}): Promise<Response> {
    this.paths.push(path);
    if (this.down > 0) {
      this.down--;
      throw new TypeError("network");
    }
    const query = new URLSearchParams(path.split("?")[1] ?? "");
    const name = query.get("upload") ?? path.split("/")[2] ?? "";
    if (path.startsWith("api/uploads?bytes")) {
      const fresh = `u${this.kept.size}`;
      this.kept.set(fresh, { total: Number(query.get("bytes")), parts: [] });
      return Response.json({ upload: fresh, received: 0 });
    }
    if (path.startsWith("api/uploads")) {
      const one = this.kept.get(name);
      if (!one) throw new RefusedError("not found", "no such upload", "");
      if (init.body && Number(query.get("at")) === this.size(name)) {
        const bytes = new Uint8Array(await (init.body as Blob).arrayBuffer());
        const ends = this.breaks.shift() ?? null;
        one.parts.push(ends === null ? bytes : bytes.slice(0, ends));
        if (ends !== null) throw new TypeError("connection lost");
      }
      return Response.json({ upload: name, received: this.size(name) });
    }
    const parts = query.has("upload")
      ? (this.kept.get(name)?.parts ?? [])
      : [new Uint8Array(await (init.body as Blob).arrayBuffer())];
    this.taken.push({ path, bytes: Uint8Array.from(parts.flatMap((part) => [...part])) });
    return Response.json({ into: "x", files: ["f"] });
  }
}

function large(size = 20 * KB + 5): File {
  const bytes = new Uint8Array(size);
  for (let k = 0; k < size; k += 977) bytes[k] = k % 251;
  return new File([bytes], "large.zip", { lastModified: 5 });
}
const bytesOf = async (file: File) => new Uint8Array(await file.arrayBuffer());
const same = (a: Uint8Array, b: Uint8Array) => a.length === b.length && a.every((byte, k) => byte === b[k]);

test("a small file goes in one request", async () => {
  const world = new World();
  await put("api/files?name=a.stl", new File(["abc"], "a.stl"), () => {}, world);
  expect(world.paths).toEqual(["api/files?name=a.stl"]);
});

test("a large file goes in pieces, and its progress is said", async () => {
  const world = new World();
  const file = large();
  const said: Sent[] = [];
  await put("api/files?name=large.zip", file, (sent) => void said.push(sent), world);
  expect(world.taken[0].path).toBe("api/files?name=large.zip&upload=u0");
  expect(same(world.taken[0].bytes, await bytesOf(file))).toBe(true);
  expect(said.map(({ received }) => received)).toEqual([0, 8 * KB, 16 * KB, file.size]);
  expect(world.store.size).toBe(0);
});

test("a broken connection costs no byte twice that arrived, and none is lost", async () => {
  const world = new World();
  const file = large();
  world.breaks = [null, 3 * KB + 1, 0, null];
  const said: Sent[] = [];
  await put("api/files?name=large.zip", file, (sent) => void said.push(sent), world);
  expect(same(world.taken[0].bytes, await bytesOf(file))).toBe(true);
  expect(said.filter(({ waiting }) => waiting).length).toBe(2);
});

test("after a reload the same file is resumed, where the server still has it", async () => {
  const world = new World();
  const file = large();
  world.breaks = [null];
  world.sleep = async (ms) => {
    world.clock += ms * 1000; // patience ends at once
  };
  const failing = put(
    "api/files?name=large.zip",
    file,
    ({ received }) => {
      world.down = received ? 5 : 0;
    },
    world,
  );
  await expect(failing).rejects.toThrow("network");
  world.down = 0;
  const said: number[] = [];
  await put("api/files?name=large.zip", file, ({ received }) => void said.push(received), world);
  expect(said[0]).toBe(8 * KB);
  expect(same(world.taken[0].bytes, await bytesOf(file))).toBe(true);
  world.store.set("turnscan.upload.large.zip.20485.5", "gone");
  await put("api/files?name=large.zip", file, () => {}, world);
  expect(same(world.taken[1].bytes, await bytesOf(file))).toBe(true);
});

test("what the server refuses is not tried again", async () => {
  const world = new World();
  world.http = async () => {
    throw new RefusedError("limit-exceeded", "2000 MB", "at most 1 GB can be sent");
  };
  await expect(put("api/files?name=large.zip", large(), () => {}, world)).rejects.toThrow("2000 MB");
  expect(world.clock).toBe(0);
});
