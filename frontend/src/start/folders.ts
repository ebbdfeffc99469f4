/** Folders on their way to the server: each is a zip, stored as it is, which the server takes apart again. */
import { notify } from "../state";

export interface Placed {
  /** Within the folder that was chosen or dropped, with slashes. */
  path: string;
  file: File;
}

const MOST_BYTES = 2 ** 32 - 2 ** 20;
const MOST_FILES = 2 ** 16 - 1;

const CRC = new Uint32Array(256).map((_, n) => {
  let c = n;
  for (let k = 0; k < 8; k++) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
  return c;
});

export function crc32(bytes: Uint8Array): number {
  let c = 0xffffffff;
  for (let i = 0; i < bytes.length; i++) c = CRC[(c ^ bytes[i]) & 0xff] ^ (c >>> 8);
  return (c ^ 0xffffffff) >>> 0;
}

/** A header of the format: numbers of two and four bytes, in turn as they are listed, and a name. */
function header(fields: readonly (readonly [number, 2 | 4])[], name: Uint8Array): Uint8Array<ArrayBuffer> {
  const size = fields.reduce((sum, [, bytes]) => sum + bytes, 0);
  const out = new Uint8Array(size + name.length);
  const view = new DataView(out.buffer);
  let at = 0;
  for (const [value, bytes] of fields) {
    if (bytes === 2) view.setUint16(at, value, true);
    else view.setUint32(at, value, true);
    at += bytes;
  }
  out.set(name, size);
  return out;
}

const UTF8 = 0x800;
/** 1 January 1980: the times of the files say nothing to us. */
const DAY = 0x21;

/** Pack files, uncompressed; the file that comes of it refers to them and holds no copy. */
export async function stored(name: string, all: readonly Placed[]): Promise<File> {
  const parts: BlobPart[] = [];
  const directory: BlobPart[] = [];
  let [at, listed] = [0, 0];
  for (const { path, file } of all) {
    const written = new TextEncoder().encode(path);
    const sum = crc32(new Uint8Array(await file.arrayBuffer()));
    const common = [
      [20, 2],
      [UTF8, 2],
      [0, 2],
      [0, 2],
      [DAY, 2],
      [sum, 4],
      [file.size, 4],
      [file.size, 4],
      [written.length, 2],
      [0, 2],
    ] as const;
    const local = header([[0x04034b50, 4], ...common], written);
    const entry = header([[0x02014b50, 4], [20, 2], ...common, [0, 2], [0, 2], [0, 2], [0, 4], [at, 4]], written);
    parts.push(local, file);
    directory.push(entry);
    at += local.length + file.size;
    listed += entry.length;
  }
  const end = header(
    [
      [0x06054b50, 4],
      [0, 2],
      [0, 2],
      [all.length, 2],
      [all.length, 2],
      [listed, 4],
      [at, 4],
      [0, 2],
    ],
    new Uint8Array(0),
  );
  // The same folder, dropped again after a reload, is the same file: its upload is resumed.
  const lastModified = Math.max(0, ...all.map(({ file }) => file.lastModified));
  return new File([...parts, ...directory, end], `${name}.zip`, { type: "application/zip", lastModified });
}

const hidden = (path: string) => path.split("/").some((part) => part.startsWith("."));

async function packed(name: string, inside: readonly Placed[]): Promise<File[]> {
  const all = inside.filter(({ path }) => !hidden(path));
  const bytes = all.reduce((sum, { file }) => sum + file.size, 0);
  if (!all.length) notify("warning", `${name}: an empty folder.`, "Drop the folder that the pictures are in.");
  else if (bytes > MOST_BYTES || all.length > MOST_FILES)
    notify(
      "error",
      `${name}: ${all.length} files of ${(bytes / 1e9).toFixed(1)} GB are too many.`,
      "Drop its folders one by one.",
    );
  else return [await stored(name, all)];
  return [];
}

/** Everything in a folder that was dropped. */
async function within(folder: FileSystemDirectoryEntry, path = ""): Promise<Placed[]> {
  const reader = folder.createReader();
  const out: Placed[] = [];
  for (;;) {
    // It hands out a part of the entries at a time, and none when it is through.
    const some = await new Promise<FileSystemEntry[]>((done, fail) => reader.readEntries(done, fail));
    if (!some.length) return out;
    for (const entry of some) {
      const place = `${path}${entry.name}`;
      if (entry.isDirectory) out.push(...(await within(entry as FileSystemDirectoryEntry, `${place}/`)));
      else {
        const file = await new Promise<File>((done, fail) => (entry as FileSystemFileEntry).file(done, fail));
        out.push({ path: place, file });
      }
    }
  }
}

/** What was dropped, each folder as one file. To be called while the event is heard: later it forgets. */
export async function dropped(data: DataTransfer | null): Promise<File[]> {
  const plain = [...(data?.files ?? [])];
  const entries = [...(data?.items ?? [])].filter(({ kind }) => kind === "file").map((item) => item.webkitGetAsEntry());
  const folders = entries.filter((entry) => entry?.isDirectory) as FileSystemDirectoryEntry[];
  if (!folders.length) return plain;
  const names = new Set(folders.map(({ name }) => name));
  const out = plain.filter(({ name }) => !names.has(name));
  try {
    for (const folder of folders) out.push(...(await packed(folder.name, await within(folder))));
  } catch {
    notify("error", "The folder cannot be read.", "Check whether it is still there, and drop it again.");
  }
  return out;
}

/** The files of a folder that was chosen in a dialog, as one file. */
export async function chosenFolder(list: Iterable<File>): Promise<File[]> {
  const all = [...list];
  const name = all[0]?.webkitRelativePath.split("/")[0];
  if (!name) return [];
  return packed(
    name,
    all.map((file) => ({ path: file.webkitRelativePath.slice(name.length + 1), file })),
  );
}
