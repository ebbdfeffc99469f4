/** A page without a browser: the modules of the front end, loaded anew, and a server that the test plays. */
import { vi } from "vitest";
import { type AnyArray, pack, unpack } from "../src/envelope";

interface Asked {
  id: number;
  kind: string;
  [key: string]: unknown;
}

class Socket {
  static readonly OPEN = 1;
  static last: Socket;
  readyState = 1;
  sent: (string | ArrayBuffer)[] = [];
  onopen = () => {};
  onclose = () => {};
  onmessage = (_: { data: string | ArrayBuffer }) => {};
  constructor() {
    Socket.last = this;
  }
  send(data: string | ArrayBuffer) {
    this.sent.push(data);
  }
}

/** What the page has fetched and not been answered: path → how to answer. */
type Fetched = { path: string; answer: (body: ArrayBuffer, ok?: boolean) => void };

export interface Page {
  state: typeof import("../src/state");
  part: typeof import("../src/part");
  stored: Map<string, string>;
  reload: ReturnType<typeof vi.fn>;
  fetched: Fetched[];
  /** Requests of one kind, as sent so far. */
  asked(kind: string): Asked[];
  /** The server says something; the page has acted on it when this resolves. */
  say(message: { kind: string; [key: string]: unknown }, arrays?: Record<string, AnyArray>): Promise<void>;
  /** Answer the oldest fetch of a path. */
  serve(path: string, header: object, arrays: Record<string, AnyArray>): Promise<void>;
  connect(): Promise<void>;
  /** Until the page has done what it can without an answer. */
  settle(): Promise<void>;
  disconnect(): Promise<void>;
  /** As the back button does, or a link. */
  walk(hash: string): Promise<void>;
}

const settled = async () => void (await vi.advanceTimersByTimeAsync(0));

/** Load the page's state and part with this storage, address and theme of the system. */
export async function openPage({ stored = {}, hash = "", light = false }: Partial<Options> = {}): Promise<Page> {
  vi.useFakeTimers();
  vi.resetModules();
  const storage = new Map(Object.entries(stored));
  const heard: (() => void)[] = [];
  const reload = vi.fn();
  const address = {
    reload,
    get hash() {
      return this.now;
    },
    set hash(to: string) {
      this.now = `#${to.replace(/^#/, "")}`;
      for (const listener of heard) listener();
    },
    now: hash,
  };
  const fetched: Fetched[] = [];
  vi.stubGlobal("WebSocket", Socket);
  vi.stubGlobal("location", address);
  vi.stubGlobal("window", { addEventListener: (_: string, listener: () => void) => heard.push(listener) });
  vi.stubGlobal("document", { baseURI: "http://127.0.0.1:1/", documentElement: { dataset: {} } });
  vi.stubGlobal("matchMedia", () => ({ matches: light }));
  vi.stubGlobal("localStorage", {
    getItem: (key: string) => storage.get(key) ?? null,
    setItem: (key: string, value: string) => storage.set(key, value),
  });
  vi.stubGlobal(
    "fetch",
    (path: string) =>
      new Promise((resolve) => {
        const answer = (body: ArrayBuffer, ok = true) => resolve(new Response(body, { status: ok ? 200 : 410 }));
        fetched.push({ path, answer });
      }),
  );
  const state = await import("../src/state");
  const part = await import("../src/part");
  const { link } = await import("../src/bus");
  state.startState();
  part.startPart();
  link.connect();
  const asked = (kind: string) =>
    Socket.last.sent
      .map((data) => (typeof data === "string" ? (JSON.parse(data) as Asked) : unpack<Asked>(data).header))
      .filter((one) => one.kind === kind);
  return {
    state,
    part,
    stored: storage,
    reload,
    fetched,
    asked,
    async say(message, arrays) {
      Socket.last.onmessage({ data: arrays ? pack(message, arrays) : JSON.stringify(message) });
      await settled();
    },
    async serve(path, header, arrays) {
      const k = fetched.findIndex((one) => one.path === path);
      if (k < 0) throw new Error(`nobody has fetched ${path}`);
      fetched.splice(k, 1)[0].answer(pack(header, arrays));
      await settled();
    },
    settle: settled,
    async connect() {
      Socket.last.onopen();
      await settled();
    },
    async disconnect() {
      Socket.last.readyState = 3;
      Socket.last.onclose();
      await settled();
    },
    async walk(to) {
      address.hash = to;
      await settled();
    },
  };
}

interface Options {
  stored: Record<string, string>;
  hash: string;
  light: boolean;
}

export function closePage(): void {
  vi.useRealTimers();
  vi.unstubAllGlobals();
}
