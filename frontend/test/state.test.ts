import { afterEach, describe, expect, it, vi } from "vitest";
import { PROTOCOL } from "../src/protocol";
import { closePage, openPage } from "./page";

afterEach(closePage);

const HELLO = { kind: "hello", protocol: PROTOCOL, version: "1", client: "me", operator: "me", scans: [] } as const;
const JOB = {
  kind: "job",
  job: "j1",
  title: "Export",
  text: "The disk is full.",
  hint: "Make room.",
  scan: null,
} as const;
const texts = (page: Awaited<ReturnType<typeof openPage>>) => page.state.notices.value.map(({ text }) => text);

it("hears nothing and touches nothing before it is started", async () => {
  const on = vi.fn();
  vi.doMock("../src/bus", () => ({ on, onConnection: on, link: {} }));
  vi.resetModules();
  // Neither window, document, location nor localStorage is here: whatever reads one of them fails.
  const modules = import.meta.glob(["../src/**/*.ts", "../src/**/*.tsx", "!../src/main.tsx"]);
  for (const load of Object.values(modules)) await load();
  vi.doUnmock("../src/bus");
  expect(Object.keys(modules).length).toBeGreaterThan(50);
  expect(on).not.toHaveBeenCalled();
});

describe("who is the operator", () => {
  it("is said by hello, and its loss is noticed", async () => {
    const page = await openPage();
    await page.connect();
    await page.say({ ...HELLO });
    expect(page.state.isOperator.value).toBe(true);
    await page.say({ kind: "control", operator: "other", clients: 2 });
    expect(page.state.isOperator.value).toBe(false);
    expect(page.state.clients.value).toBe(2);
    expect(page.state.notices.value).toMatchObject([{ severity: "warning" }]);
    await page.say({ kind: "control", operator: "third", clients: 3 });
    expect(page.state.notices.value).toHaveLength(1);
  });

  it("is nobody's question where the server speaks another protocol: the page is loaded anew", async () => {
    const page = await openPage();
    await page.say({ ...HELLO, protocol: PROTOCOL + 1 });
    expect(page.reload).toHaveBeenCalledOnce();
    expect(page.state.hello.value).toBeNull();
  });
});

describe("jobs", () => {
  it("are forgotten some seconds after their end, not before", async () => {
    const page = await openPage();
    await page.say({ ...JOB, what: "export", state: "running" });
    await vi.advanceTimersByTimeAsync(60_000);
    expect([...page.state.jobs.value.keys()]).toEqual(["j1"]);
    await page.say({ ...JOB, what: "export", state: "done" });
    await vi.advanceTimersByTimeAsync(7_000);
    expect(page.state.jobs.value.get("j1")?.state).toBe("done");
    await vi.advanceTimersByTimeAsync(2_000);
    expect(page.state.jobs.value.size).toBe(0);
  });

  it("say why they failed, but for edits, whose answer says it", async () => {
    const page = await openPage();
    await page.say({ ...JOB, what: "edit", state: "failed" });
    expect(page.state.notices.value).toEqual([]);
    await page.say({ ...JOB, what: "export", state: "failed" });
    expect(page.state.notices.value).toMatchObject([
      { severity: "error", text: "Export: The disk is full.", hint: "Make room." },
    ]);
  });
});

describe("the connection", () => {
  it("is said to be lost once, after five seconds without one", async () => {
    const page = await openPage();
    await page.connect();
    await page.disconnect();
    expect(page.state.connection.value).toBe("lost");
    await vi.advanceTimersByTimeAsync(4_900);
    expect(page.state.notices.value).toEqual([]);
    await vi.advanceTimersByTimeAsync(200);
    expect(page.state.notices.value).toMatchObject([{ severity: "error" }]);
  });

  it("that comes back in time is not spoken of", async () => {
    const page = await openPage();
    await page.connect();
    await page.disconnect();
    await vi.advanceTimersByTimeAsync(1_000);
    await page.connect();
    await vi.advanceTimersByTimeAsync(10_000);
    expect(page.state.connection.value).toBe("open");
    expect(page.state.notices.value).toEqual([]);
  });
});

describe("notices", () => {
  it("go by themselves, errors last, and four are kept", async () => {
    const { state } = await openPage();
    state.notify("error", "e");
    state.notify("note", "n");
    await vi.advanceTimersByTimeAsync(5_100);
    expect(state.notices.value.map(({ text }) => text)).toEqual(["e"]);
    await vi.advanceTimersByTimeAsync(10_000);
    expect(state.notices.value).toEqual([]);
    for (const text of "abcde") state.notify("note", text);
    expect(state.notices.value.map(({ text }) => text)).toEqual(["b", "c", "d", "e"]);
  });

  it("weigh what the server refused, and let faults of the page through", async () => {
    const page = await openPage();
    const { RefusedError: Refused } = await import("../src/link");
    for (const code of ["stale", "cancelled", "busy"]) page.state.complain(new Refused(code, code, ""));
    expect(page.state.notices.value.map(({ severity }) => severity)).toEqual(["warning", "note", "error"]);
    page.state.complain(new DOMException("", "TimeoutError"));
    expect(texts(page).at(-1)).toContain("in time");
    expect(() => page.state.complain(new TypeError("undefined is not a function"))).toThrow(TypeError);
  });
});

describe("a request that is only to be done", () => {
  it("tells whether it was, and shows why not", async () => {
    const page = await openPage();
    await page.connect();
    const done = page.state.ask({ kind: "take_control" });
    await page.say({ kind: "done", id: page.asked("take_control")[0].id });
    expect(await done).toBe(true);
    const refused = page.state.ask({ kind: "take_control" });
    const { id } = page.asked("take_control")[1];
    await page.say({ kind: "refused", id, code: "busy", text: "A scan is running.", hint: "" });
    expect(await refused).toBe(false);
    expect(texts(page)).toEqual(["A scan is running."]);
  });
});

describe("what the browser remembers", () => {
  it("is taken where it is allowed, and follows what changes", async () => {
    const page = await openPage({ stored: { "turnscan.theme": "light", "turnscan.level": "wizard" } });
    expect(page.state.theme.value).toBe("light");
    expect(document.documentElement.dataset.theme).toBe("light");
    expect(page.state.level.value).toBe("beginner");
    page.state.level.value = "expert";
    page.state.theme.value = "dark";
    expect(page.stored.get("turnscan.level")).toBe("expert");
    expect(document.documentElement.dataset.theme).toBe("dark");
  });

  it("is the system's theme on the first visit", async () => {
    expect((await openPage({ light: true })).state.theme.value).toBe("light");
    expect((await openPage({ light: false })).state.theme.value).toBe("dark");
  });
});

describe("the address", () => {
  it("says the room and the scan, and going somewhere keeps the scan", async () => {
    const page = await openPage({ hash: "#repair/abcd" });
    expect(page.state.place.value).toEqual({ room: "repair", scan: "abcd" });
    page.state.go("measure");
    expect(page.state.place.value).toEqual({ room: "measure", scan: "abcd" });
    page.state.go("projects", null);
    expect(page.state.place.value).toEqual({ room: "projects", scan: null });
    await page.walk("");
    expect(page.state.place.value).toEqual({ room: "projects", scan: null });
  });
});

it("knows within a second that the server fell silent, and that it is back", async () => {
  const page = await openPage();
  await page.connect();
  await page.say({ kind: "beat" });
  await vi.advanceTimersByTimeAsync(700);
  expect(page.state.answering.value).toBe(true);
  await vi.advanceTimersByTimeAsync(300);
  expect(page.state.answering.value).toBe(false);
  await page.say({ kind: "beat" });
  await vi.advanceTimersByTimeAsync(100);
  expect(page.state.answering.value).toBe(true);
  await page.disconnect();
  await vi.advanceTimersByTimeAsync(100);
  expect(page.state.answering.value).toBe(false);
});

it("tells whoever did not press STOP that somebody did, and whether the lasers are dark", async () => {
  const page = await openPage();
  await page.connect();
  await page.say({ kind: "stopped", client: "somebody", confirmed: false });
  expect(page.state.notices.value[0]).toMatchObject({ severity: "error" });
  await page.say({ kind: "stopped", client: "somebody", confirmed: true });
  expect(page.state.notices.value[1]).toMatchObject({ severity: "warning" });
});

it("sends STOP by HTTP where the socket is open but silent", async () => {
  const page = await openPage();
  const { stop } = await import("../src/commands");
  await page.connect();
  await page.say({ kind: "beat" });
  await vi.advanceTimersByTimeAsync(100);
  void stop();
  expect(page.asked("stop")).toHaveLength(1);
  await vi.advanceTimersByTimeAsync(1000);
  expect(page.state.answering.value).toBe(false);
  void stop();
  await page.settle();
  expect(page.asked("stop")).toHaveLength(1);
  expect(page.fetched.map(({ path }) => path)).toEqual([expect.stringContaining("api/stop")]);
});
