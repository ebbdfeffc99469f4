import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { Link } from "../src/link";

class Socket {
  static readonly OPEN = 1;
  static last: Socket;
  readyState = 1;
  sent: string[] = [];
  onopen = () => {};
  onclose = () => {};
  onmessage = (_: { data: string }) => {};
  constructor() {
    Socket.last = this;
  }
  send(data: string) {
    this.sent.push(data);
  }
  say(message: object) {
    this.onmessage({ data: JSON.stringify(message) });
  }
}

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal("WebSocket", Socket);
  vi.stubGlobal("document", { baseURI: "http://127.0.0.1:1/" });
});
afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

function asked(): { answer: Promise<string>; id: number } {
  const link = new Link(
    () => {},
    () => {},
  );
  link.connect();
  const answer = link.request({ kind: "undo", scan: "abcd" }).then(
    ({ header }) => header.kind,
    (error) => error.code,
  );
  return { answer, id: JSON.parse(Socket.last.sent[0]).id };
}

test("a request that nobody answers is given up", async () => {
  const { answer } = asked();
  await vi.advanceTimersByTimeAsync(121_000);
  expect(await answer).toBe("late");
});

test("a request is waited for while the server says that a job lives, and not longer", async () => {
  const { answer, id } = asked();
  Socket.last.say({ kind: "job", job: "edit", state: "running" });
  await vi.advanceTimersByTimeAsync(1_000_000);
  Socket.last.say({ kind: "job", job: "edit", state: "done" });
  Socket.last.say({ kind: "done", id });
  expect(await answer).toBe("done");
  const other = asked();
  Socket.last.say({ kind: "job", job: "edit", state: "running" });
  await vi.advanceTimersByTimeAsync(200_000);
  Socket.last.say({ kind: "job", job: "edit", state: "failed" });
  await vi.advanceTimersByTimeAsync(121_000);
  expect(await other.answer).toBe("late");
});
