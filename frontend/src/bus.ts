/** Who wants to hear what the server says: by the kind of the message. */
import type { Arrays } from "./envelope";
import { Link, type Received } from "./link";
import type { ServerMessage } from "./protocol";

type Kind = ServerMessage["kind"];
type OfKind<K extends Kind> = Extract<ServerMessage, { kind: K }>;
type Listener = (header: ServerMessage, arrays: Arrays) => void;

const listeners = new Map<Kind, Set<Listener>>();
const stateListeners = new Set<(state: "open" | "lost") => void>();

/** Hear every message of a kind; returns how to hear no more. */
export function on<K extends Kind>(kind: K, listener: (header: OfKind<K>, arrays: Arrays) => void): () => void {
  const set = listeners.get(kind) ?? new Set();
  listeners.set(kind, set);
  set.add(listener as Listener);
  return () => set.delete(listener as Listener);
}

export function onConnection(listener: (state: "open" | "lost") => void): void {
  stateListeners.add(listener);
}

let heardAt = 0;

/** ms for which the server has not said anything, not even that it lives. */
export const silence = () => performance.now() - heardAt;

function tell({ header, arrays }: Received): void {
  heardAt = performance.now();
  for (const listener of listeners.get(header.kind) ?? []) listener(header, arrays);
}

export const link = new Link(tell, (state) => {
  for (const listener of stateListeners) listener(state);
});
