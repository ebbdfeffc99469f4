/** The wire to the server: one WebSocket that comes back by itself, and GETs for what is large. */
import { type AnyArray, type Message, NO_ARRAYS, pack, unpack } from "./envelope";
import type { ClientMessage, Problem, Refused, RemedyOption, ServerMessage } from "./protocol";

export type Received = Message<ServerMessage>;

type Answered = Extract<ClientMessage, { id: number }>;
/** A request as callers write it: the link adds the number. */
export type Request = Answered extends infer R ? (R extends { id: number } ? Omit<R, "id"> : never) : never;

/** What the server said no to, in words for a person. */
export class RefusedError extends Error {
  constructor(
    readonly code: string,
    text: string,
    readonly hint: string,
    readonly options: readonly RemedyOption[] = [],
  ) {
    super(text);
  }
}

const REQUEST_SECONDS = 120;
/** A little less than what the server takes in one message. */
const MOST_BYTES = 3.5 * 2 ** 20;
const FETCH_SECONDS = 120;
const RETRY_MS = [250, 500, 1000, 2000, 4000];

interface Waiting {
  resolve: (message: Received) => void;
  reject: (error: Error) => void;
  timer: ReturnType<typeof setTimeout>;
}

export class Link {
  private socket: WebSocket | null = null;
  private readonly waiting = new Map<number, Waiting>();
  /** Jobs that the server has said to be running, and not yet that they are over. */
  private readonly living = new Set<string>();
  private nextId = 1;
  private attempt = 0;

  constructor(
    private readonly onMessage: (message: Received) => void,
    private readonly onState: (state: "open" | "lost") => void,
  ) {}

  connect(): void {
    const url = new URL("ws", document.baseURI);
    url.protocol = url.protocol.replace("http", "ws");
    const socket = new WebSocket(url);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.attempt = 0;
      this.onState("open");
    };
    socket.onmessage = (event) => this.receive(event.data);
    socket.onclose = () => {
      this.onState("lost");
      this.living.clear();
      for (const [id] of this.waiting) {
        this.settle(id)?.reject(
          new RefusedError(
            "lost",
            "The connection to turnscan was lost.",
            "It is restored automatically while the server runs.",
          ),
        );
      }
      const pause = RETRY_MS[Math.min(this.attempt++, RETRY_MS.length - 1)];
      setTimeout(() => this.connect(), pause);
    };
  }

  /**
   * Let the socket go while the page is left: browsers keep pages alive that somebody may come back to, and
   * such a page would stay the operator, with lasers lit. It connects again when it is shown.
   */
  leave(): void {
    this.socket?.close();
  }

  /**
   * Send a request; resolves with its answer, rejects with `RefusedError`. Where its scan was closed
   * meanwhile, it is opened again first; an edit is up to the caller, since it names a revision.
   */
  request(request: Request, arrays: Record<string, AnyArray> = {}): Promise<Received> {
    const ask = () => this.once(request, arrays);
    if (!("scan" in request) || typeof request.scan !== "string" || request.kind === "edit") return ask();
    return openedFor(request.scan, ask, Object.keys(arrays).length > 0);
  }

  private once(request: Request, arrays: Record<string, AnyArray>): Promise<Received> {
    const id = this.nextId++;
    return new Promise((resolve, reject) => {
      const bytes = Object.values(arrays).reduce((sum, array) => sum + array.byteLength, 0);
      if (bytes > MOST_BYTES) {
        reject(
          new RefusedError(
            "too-large",
            `The request is too large: ${(bytes / 2 ** 20).toFixed(1)} MB, the limit is ${MOST_BYTES / 2 ** 20} MB.`,
            "Select fewer triangles, or decimate first.",
          ),
        );
        return;
      }
      this.waiting.set(id, { resolve, reject, timer: this.patience(id) });
      if (!this.send({ ...request, id }, arrays)) {
        this.settle(id)?.reject(
          new RefusedError(
            "lost",
            "There is no connection to turnscan.",
            "It is restored automatically while the server runs.",
          ),
        );
      }
    });
  }

  /** Give up on a request that takes long, unless the server says that it is at work. */
  private patience(id: number): ReturnType<typeof setTimeout> {
    return setTimeout(() => {
      const waiting = this.waiting.get(id);
      if (waiting && this.living.size) waiting.timer = this.patience(id);
      else
        this.settle(id)?.reject(
          new RefusedError("late", "The server did not reply.", "Check the terminal in which it runs."),
        );
    }, REQUEST_SECONDS * 1000);
  }

  /** How many requests wait for their answers. */
  get pending(): number {
    return this.waiting.size;
  }

  /** Send without waiting for an answer; false when there is no connection. */
  send(message: object, arrays: Record<string, AnyArray> = {}): boolean {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    const binary = Object.keys(arrays).length > 0;
    this.socket.send(binary ? pack(message, arrays) : JSON.stringify(message));
    return true;
  }

  private receive(data: string | ArrayBuffer): void {
    const message: Received =
      typeof data === "string" ? { header: JSON.parse(data), arrays: NO_ARRAYS } : unpack<ServerMessage>(data);
    // Patches come before the answer to the edit that made them: everybody hears first.
    this.onMessage(message);
    const { header } = message;
    if (header.kind === "job") {
      if (header.state === "running") this.living.add(header.job);
      else this.living.delete(header.job);
    }
    if (!("id" in header) || header.id === null) return;
    const waiting = this.settle(header.id);
    if (header.kind === "refused") waiting?.reject(refusal(header));
    else waiting?.resolve(message);
  }

  private settle(id: number): Waiting | undefined {
    const waiting = this.waiting.get(id);
    this.waiting.delete(id);
    clearTimeout(waiting?.timer);
    return waiting;
  }
}

function refusal(message: Refused): RefusedError {
  return new RefusedError(message.code, message.text, message.hint, message.options);
}

/** An HTTP request that changes something needs this header, which no foreign page can send. */
export async function http(path: string, init: RequestInit = {}): Promise<Response> {
  const response = await fetch(path, {
    ...init,
    headers: { ...init.headers, "X-Turnscan": "1" },
    signal: AbortSignal.timeout(FETCH_SECONDS * 1000),
  });
  if (response.ok) return response;
  const problem: Problem = await response
    .json()
    .catch(() => ({ code: String(response.status), text: `The server answered ${response.status}.`, hint: "" }));
  throw new RefusedError(problem.code, problem.text, problem.hint);
}

/** How a scan is opened again that was closed to make room; whether its faces have the numbers they had. */
export const reopening: { of: ((scan: string) => Promise<boolean>) | null } = { of: null };

/** Ask of a scan; where it is not open any more, once again when it is. */
export async function openedFor<T>(scan: string, ask: () => Promise<T>, numbered: boolean): Promise<T> {
  try {
    return await ask();
  } catch (error) {
    if (!(error instanceof RefusedError && error.code === "not-open" && reopening.of)) throw error;
    const same = await reopening.of(scan);
    if (same || !numbered) return ask();
    throw new RefusedError(
      "stale",
      "The scan was closed to make room, and opened again; nothing was changed.",
      "Select again, then repeat.",
    );
  }
}

const OF_SCAN = /^api\/scans\/([^/]+)\//;

/** What is large; `again` opens its scan again where it was closed meanwhile. */
export async function getArrays<H>(path: string, again = true): Promise<Message<H>> {
  const ask = async () => unpack<H>(await (await http(path)).arrayBuffer());
  const scan = again && OF_SCAN.exec(path)?.[1];
  return scan ? openedFor(scan, ask, false) : ask();
}
