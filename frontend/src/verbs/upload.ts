/** Files on their way to the server: a large one in pieces, resumed where the connection broke. */
import { http, RefusedError } from "../link";
import type { Uploaded } from "../protocol";

const PIECE = 8 << 20;
const PATIENCE = 120_000;
const AGAIN = 1_000;

export interface Sent {
  received: number;
  /** Whether the server does not answer at the moment. */
  waiting: boolean;
}

export interface Wire {
  http(path: string, init?: RequestInit): Promise<Response>;
  sleep(ms: number): Promise<void>;
  now(): number;
  /** Bytes that go at a time. */
  piece: number;
  storage: Pick<Storage, "getItem" | "setItem" | "removeItem">;
}

const real = (): Wire => ({
  http,
  sleep: (ms) => new Promise((done) => setTimeout(done, ms)),
  now: () => performance.now(),
  piece: PIECE,
  storage: sessionStorage,
});

/** POST a file to a path; `tell` hears how much of it the server has. Rejects when it is refused, or
 * when the server does not answer for two minutes. */
export async function put(path: string, file: File, tell: (sent: Sent) => void, wire = real()): Promise<Response> {
  if (file.size <= wire.piece) return wire.http(path, { method: "POST", body: file });
  // The same file that was begun before, also before a reload, goes on where it ended.
  const key = `turnscan.upload.${file.name}.${file.size}.${file.lastModified}`;
  let upload = wire.storage.getItem(key) ?? "";
  let received = upload ? await here(upload, wire) : -1;
  if (received < 0) {
    const begun: Uploaded = await (await wire.http(`api/uploads?bytes=${file.size}`, { method: "POST" })).json();
    upload = begun.upload;
    received = 0;
    wire.storage.setItem(key, upload);
  }
  while (received < file.size) {
    tell({ received, waiting: false });
    received = await answered(
      wire,
      async () => {
        const body = file.slice(received, received + wire.piece);
        const answer: Uploaded = await (
          await wire.http(`api/uploads?upload=${upload}&at=${received}`, { method: "POST", body })
        ).json();
        return answer.received;
      },
      () => tell({ received, waiting: true }),
    );
  }
  tell({ received, waiting: false });
  wire.storage.removeItem(key);
  return wire.http(`${path}&upload=${upload}`, { method: "POST" });
}

/** Bytes of an upload that the server has; -1 where it does not know it. */
async function here(upload: string, wire: Wire): Promise<number> {
  try {
    const known: Uploaded = await (await wire.http(`api/uploads/${upload}`)).json();
    return known.received;
  } catch (error) {
    if (error instanceof RefusedError) return -1;
    throw error;
  }
}

/** The server heard a part of the piece, and then nothing. */
const TOO_LATE = "request timeout";

/** Try until the server answers; what it refuses is not tried again. */
async function answered<T>(wire: Wire, act: () => Promise<T>, lost: () => void): Promise<T> {
  const end = wire.now() + PATIENCE;
  for (;;) {
    try {
      return await act();
    } catch (error) {
      const refused = error instanceof RefusedError && error.code !== TOO_LATE;
      if (refused || wire.now() > end) throw error;
      lost();
      await wire.sleep(AGAIN);
    }
  }
}
