/** What the page knows: signals, set by the server's messages and by the person. */
import { computed, effect, signal } from "@preact/signals";
import { link, on, onConnection, silence } from "./bus";
import { kept, remember } from "./kept";
import { RefusedError, type Request } from "./link";
import { type BinEntry, type Devices, type Hello, type JobState, PROTOCOL, type ScanEntry } from "./protocol";

export const connection = signal<"connecting" | "open" | "lost">("connecting");
/** Whether the server says that it lives; while it does not, nobody here knows whether lasers are dark. */
export const answering = signal(false);
/** What became of the last STOP. */
export const stopping = signal<"none" | "sent" | "confirmed" | "unconfirmed">("none");
export const hello = signal<Hello | null>(null);
export const operator = signal<string | null>(null);
export const clients = signal(1);
export const isOperator = computed(() => hello.value !== null && hello.value.client === operator.value);
export const scans = signal<ScanEntry[]>([]);
export const binned = signal<BinEntry[]>([]);
export const devices = signal<Devices | null>(null);
export const jobs = signal<ReadonlyMap<string, JobState>>(new Map());

export interface Notice {
  id: number;
  severity: "note" | "warning" | "error";
  text: string;
  hint: string;
}

export const notices = signal<readonly Notice[]>([]);
let nextNotice = 1;
const LOST_MS = 5000;
const NOTICE_MS = { note: 5000, warning: 9000, error: 15000 };

export function notify(severity: Notice["severity"], text: string, hint = ""): void {
  const id = nextNotice++;
  // Whoever notifies does not depend on what else is shown.
  notices.value = [...notices.peek().slice(-3), { id, severity, text, hint }];
  setTimeout(() => dismiss(id), NOTICE_MS[severity]);
}

export function dismiss(id: number): void {
  notices.value = notices.value.filter((notice) => notice.id !== id);
}

const SEVERITY: Record<string, Notice["severity"]> = { stale: "warning", cancelled: "note" };

/** Show why something did not happen. */
export function complain(error: unknown): void {
  if (error instanceof RefusedError) notify(SEVERITY[error.code] ?? "error", error.message, error.hint);
  else if (error instanceof DOMException && error.name === "TimeoutError")
    notify("error", "The server did not reply in time.");
  else throw error;
}

/** Ask the server, and show its words where it refuses. */
export async function ask(request: Request): Promise<boolean> {
  try {
    await link.request(request);
    return true;
  } catch (error) {
    complain(error);
    return false;
  }
}

export const theme = kept<"dark" | "light">("theme", "dark", ["dark", "light"]);
export const level = kept<"beginner" | "expert">("level", "beginner", ["beginner", "expert"]);

// Where one is: #repair/SCAN

export interface Place {
  room: string;
  scan: string | null;
}

function readPlace(): Place {
  const [room, scan] = location.hash.slice(1).split("/");
  return { room: room || "projects", scan: scan || null };
}

export const place = signal<Place>({ room: "projects", scan: null });

export function go(room: string, scan = place.value.scan): void {
  location.hash = scan ? `${room}/${scan}` : room;
}

/** Follow the address, the server's messages and what this browser remembers: once, before the first picture. */
export function startState(): void {
  theme.value = matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark";
  remember(localStorage);
  effect(() => {
    document.documentElement.dataset.theme = theme.value;
  });
  place.value = readPlace();
  window.addEventListener("hashchange", () => {
    place.value = readPlace();
  });
  hearServer();
  watchConnection();
  watchSilence();
}

function hearServer(): void {
  on("hello", (message) => {
    if (message.protocol !== PROTOCOL) {
      location.reload();
      return;
    }
    hello.value = message;
    operator.value = message.operator;
    scans.value = message.scans;
    binned.value = message.binned;
  });
  on("control", (message) => {
    const was = isOperator.value;
    operator.value = message.operator;
    clients.value = message.clients;
    if (was && !isOperator.value)
      notify("warning", "Another browser is the operator now.", "You can watch, and take control back.");
  });
  on("scans", (message) => {
    scans.value = message.scans;
    binned.value = message.binned;
  });
  on("stopped", ({ client, confirmed }) => {
    if (client === hello.value?.client) return;
    const what = client ? "Another browser pressed STOP" : "STOP was pressed"; // by HTTP: perhaps here
    if (confirmed) notify("warning", `${what}: lasers dark, table still.`);
    else notify("error", `${what}; it is not confirmed that the lasers are dark.`);
  });
  on("devices", (message) => {
    devices.value = message;
  });
  on("job", (message) => {
    const next = new Map(jobs.value);
    next.set(message.job, message);
    jobs.value = next;
    // Why an edit failed is said by the answer to its request.
    if (message.state === "failed" && message.what !== "edit")
      notify("error", `${message.title}: ${message.text}`, message.hint);
    if (message.state !== "running") {
      setTimeout(() => {
        const rest = new Map(jobs.value);
        rest.delete(message.job);
        jobs.value = rest;
      }, 8000);
    }
  });
}

function watchConnection(): void {
  let lostTimer: ReturnType<typeof setTimeout> | undefined;
  onConnection((state) => {
    connection.value = state;
    if (state === "open") {
      clearTimeout(lostTimer);
      lostTimer = undefined;
    } else {
      lostTimer ??= setTimeout(() => {
        notify(
          "error",
          "There is no connection to turnscan.",
          "Check whether it still runs. If it was restarted, open the link that it printed.",
        );
      }, LOST_MS);
    }
  });
}

const SILENT_MS = 800;
const LOOK_MS = 100;

/** The server speaks four times a second: when it does not, that is known within a second. */
function watchSilence(): void {
  let looked = performance.now();
  let excused = false;
  setInterval(() => {
    const now = performance.now();
    // A page that was itself busy has messages waiting, which are heard before the next look.
    excused = !excused && now - looked > 4 * LOOK_MS;
    looked = now;
    if (!excused) answering.value = connection.value === "open" && silence() < SILENT_MS;
  }, LOOK_MS);
}
