import { afterEach, describe, expect, it, vi } from "vitest";
import type { Figures } from "../src/protocol";
import { closePage, openPage, type Page } from "./page";
import { plate } from "./shapes";

afterEach(closePage);

const FIGURES: Figures = { vertices: 9, faces: 8, bounds: null, closed: false, volume: null };

function opened(scan: string, revision = 3, epoch = 1) {
  return {
    kind: "opened",
    id: null,
    scan,
    name: `the ${scan}`,
    revision,
    epoch,
    steps: 4,
    grids: [{ grid: 0, laser: "l", first_step: 0, last_step: 3 }],
    figures: FIGURES,
    history: [],
    cursor: 0,
    branches: [],
    scanned_picture: "",
    findings: [],
    measures: [],
  } as const;
}

const patch = (scan: string, revision: number, parts: object[] = [], epoch = 1) =>
  ({ kind: "patch", scan, revision, epoch, text: "", parts, figures: { ...FIGURES, faces: 7 } }) as const;

const header = (scan: string, revision = 3, epoch = 1) => ({ scan, revision, epoch, lasers: ["l"], unit: "mm" });
const meshPath = (scan: string) => `api/scans/${scan}/mesh`;
const serveMesh = (page: Page, scan: string, revision = 3, epoch = 1) =>
  page.serve(meshPath(scan), header(scan, revision, epoch), { ...plate(2) });

/** The page with a scan in its address, open and shown. */
async function shown(scan = "cup"): Promise<Page> {
  const page = await openPage({ hash: `#repair/${scan}` });
  await page.connect();
  await page.say({ ...opened(scan), id: page.asked("open")[0].id });
  await serveMesh(page, scan);
  return page;
}

describe("opening", () => {
  it("asks when the connection is there, and shows the mesh", async () => {
    const page = await openPage({ hash: "#repair/cup" });
    expect(page.asked("open")).toEqual([]);
    await page.connect();
    expect(page.asked("open")).toMatchObject([{ scan: "cup" }]);
    await page.say({ ...opened("cup"), id: page.asked("open")[0].id });
    expect(page.part.loading.value).toBe("Opening");
    await serveMesh(page, "cup");
    expect(page.part.mesh.value?.aliveCount).toBe(8);
    expect(page.part.shownRevision()).toBe(3);
    expect(page.part.scanName.value).toBe("the cup");
    expect(page.part.loading.value).toBeNull();
  });

  it("that is refused leads back to the list, with the reason", async () => {
    const page = await openPage({ hash: "#repair/cup" });
    await page.connect();
    const { id } = page.asked("open")[0];
    await page.say({ kind: "refused", id, code: "gone", text: "There is no such scan.", hint: "" });
    expect(page.state.place.value).toEqual({ room: "projects", scan: null });
    expect(page.state.notices.value).toMatchObject([{ text: "There is no such scan." }]);
  });

  it("whose job fails leads back to the list", async () => {
    const page = await openPage({ hash: "#repair/cup" });
    await page.connect();
    await page.say({ kind: "started", id: page.asked("open")[0].id, job: "j" });
    const job = { kind: "job", job: "j", what: "open", scan: "cup", title: "Open", text: "It is torn.", hint: "" };
    await page.say({ ...job, state: "running" });
    expect(page.state.place.value.room).toBe("repair");
    await page.say({ ...job, state: "failed" });
    expect(page.state.place.value.room).toBe("projects");
  });

  it("happens again after the connection was lost; a mesh that is still right is not fetched", async () => {
    const page = await shown();
    await page.disconnect();
    await vi.advanceTimersByTimeAsync(300);
    await page.connect();
    expect(page.asked("open")).toHaveLength(1);
    await page.say({ ...opened("cup"), id: page.asked("open")[0].id });
    expect(page.fetched).toEqual([]);
    await page.say(opened("cup", 5));
    expect(page.fetched).toMatchObject([{ path: meshPath("cup") }]);
  });

  it("of a second scan while the first mesh is on its way shows the second", async () => {
    const page = await openPage({ hash: "#repair/cup" });
    await page.connect();
    await page.say({ ...opened("cup"), id: page.asked("open")[0].id });
    await page.walk("#repair/box");
    await page.say({ ...opened("box", 9), id: page.asked("open")[1].id });
    await serveMesh(page, "cup");
    expect(page.part.mesh.value).toBeNull();
    await serveMesh(page, "box", 9);
    expect(page.part.mesh.value?.faceCount).toBe(8);
    expect(page.part.shownRevision()).toBe(9);
    expect(page.part.loading.value).toBeNull();
  });
});

const first = (scan: string) => ({ kind: "first_surface", scan, every: 14, edits: 2 });
const few = () => {
  const { positions, faces } = plate(1);
  return { positions, faces };
};

describe("a preview of a large scan", () => {
  it("is shown until the mesh is there", async () => {
    const page = await openPage({ hash: "#repair/cup" });
    await page.connect();
    const { id } = page.asked("open")[0];
    await page.say({ kind: "started", id, job: "j" });
    await page.say(first("box"), few());
    expect(page.part.firstSurface.value).toBeNull();
    await page.say(first("cup"), few());
    expect(page.part.firstSurface.value).toMatchObject({ every: 14, edits: 2, model: { faceCount: 2 } });
    expect(page.part.mesh.value).toBeNull();
    expect(page.part.isOpen.value).toBe(false);
    await page.say(opened("cup"));
    expect(page.part.firstSurface.value).not.toBeNull();
    await serveMesh(page, "cup");
    expect(page.part.firstSurface.value).toBeNull();
    expect(page.part.mesh.value?.faceCount).toBe(8);
  });

  it("that comes late, or of a scan that does not open, is not left", async () => {
    const page = await shown();
    await page.say(first("cup"), few());
    expect(page.part.firstSurface.value).toBeNull();
    await page.walk("#repair/box");
    await page.say(first("box"), few());
    expect(page.part.firstSurface.value).not.toBeNull();
    const job = { kind: "job", job: "j", what: "open", scan: "box", title: "Open", text: "It is torn.", hint: "" };
    await page.say({ ...job, state: "failed" });
    expect(page.part.firstSurface.value).toBeNull();
    await page.walk("#repair/box");
    await page.say(first("box"), few());
    await page.walk("#repair/cup");
    expect(page.part.firstSurface.value).toBeNull();
  });

  it("is not edited, nor is the scan that was there before undone", async () => {
    const page = await shown();
    await page.say({ kind: "history", scan: "cup", history: [{}], branches: [], cursor: 1, scanned_picture: "" });
    await page.walk("#repair/box");
    await page.say(first("box"), few());
    expect([page.part.cursor.value, page.part.history.value.length]).toEqual([0, 0]);
    await page.part.undo();
    expect(await page.part.doEdit({ kind: "delete" }, { faces: Uint32Array.of(1) })).toBe(false);
    expect([...page.asked("undo"), ...page.asked("edit")]).toEqual([]);
    expect(page.state.notices.value).toMatchObject([{ text: "The scan is still being opened; nothing was edited." }]);
  });
});

const notOpen = (id: number) => ({ kind: "refused", id, code: "not-open", text: "It is not open.", hint: "" });
const last = (page: Page, kind: string) => page.asked(kind).at(-1)!;

describe("a scan that was closed to make room", () => {
  it("is opened again by an edit of selected faces, which is made where they are the same", async () => {
    const page = await shown();
    const before = page.part.mesh.value;
    const heard = vi.fn();
    page.part.onMesh(heard);
    const done = page.part.doEdit({ kind: "close_gaps" });
    await page.settle();
    await page.say(notOpen(last(page, "edit").id));
    await page.say({ kind: "started", id: last(page, "open").id, job: "j" });
    await page.say(opened("cup", 0, 77));
    await serveMesh(page, "cup", 0, 77);
    expect(page.asked("edit").map((one) => one.base_revision)).toEqual([3, 0]);
    await page.say({ kind: "done", id: last(page, "edit").id });
    expect(await done).toBe(true);
    expect(page.part.mesh.value).toBe(before);
    expect(heard).not.toHaveBeenCalled();
    expect(page.state.notices.value).toMatchObject([{ severity: "note" }]);
  });

  it.each([
    [2, "It was not open."],
    [3, "The scan was closed to make room, and opened again; nothing was changed."],
  ])("is measured on the same faces alone (%i cells)", async (cells, said) => {
    const page = await shown();
    const { link } = await import("../src/bus");
    const faces = { faces: Uint32Array.of(1) };
    const asked = link
      .request({ kind: "measure", scan: "cup", what: "area", places: [] }, faces)
      .catch((e) => e.message);
    const sent = link.pending;
    expect(sent).toBe(1);
    await page.say(notOpen(2));
    await page.say({ ...opened("cup", 0, 77), id: last(page, "open").id });
    await page.serve(meshPath("cup"), header("cup", 0, 77), { ...plate(cells) });
    if (cells === 2) await page.say({ kind: "refused", id: 4, code: "x", text: "It was not open.", hint: "" });
    expect(await asked).toBe(said);
  });

  it("is opened once for all that ask meanwhile, and each asks again", async () => {
    const page = await shown();
    const both = [page.part.listHoles(), page.part.listDefects()];
    await page.settle();
    for (const kind of ["list_holes", "list_defects"]) await page.say(notOpen(last(page, kind).id));
    expect(page.asked("open")).toHaveLength(2);
    await page.say({ ...opened("cup", 0, 77), id: last(page, "open").id });
    await serveMesh(page, "cup", 0, 77);
    const revision = 0;
    await page.say({ kind: "holes", id: last(page, "list_holes").id, scan: "cup", revision, many: 0, holes: [] });
    await page.say({ kind: "defects", id: last(page, "list_defects").id, scan: "cup", revision, defects: [] });
    await Promise.all(both);
    expect(page.part.holes.value).toEqual([]);
    expect(page.part.defects.value).toEqual([]);
  });

  it("that does not open any more refuses what was asked", async () => {
    const page = await shown();
    const done = page.part.undo();
    await page.settle();
    await page.say(notOpen(last(page, "undo").id));
    await page.say({ kind: "refused", id: last(page, "open").id, code: "gone", text: "It is gone.", hint: "" });
    await done;
    expect(page.state.notices.value.map(({ text }) => text)).toContain("It is gone.");
    expect(page.part.loading.value).toBeNull();
  });
});

describe("undo", () => {
  it("is offered as soon as the first edit is under way, and no more where it is refused", async () => {
    const page = await shown();
    expect(page.part.canUndo.value).toBe(false);
    const done = page.part.doEdit({ kind: "close_gaps" });
    expect(page.part.canUndo.value).toBe(true);
    await page.settle();
    await page.say({ kind: "refused", id: last(page, "edit").id, code: "x", text: "No.", hint: "" });
    expect(await done).toBe(false);
    await page.settle();
    expect(page.part.canUndo.value).toBe(false);
  });
});

describe("a patch", () => {
  it("of the next revision changes the mesh in place and says what changed", async () => {
    const page = await shown();
    const heard: unknown[] = [];
    page.part.onMesh((parts) => heard.push(parts));
    const before = page.part.mesh.value;
    page.part.listsAreOld.value = false;
    await page.say(patch("cup", 4, [{ kind: "alive", value: false }]), { "0.faces": Uint32Array.of(2, 5) });
    expect(page.part.mesh.value).toBe(before);
    expect(before?.aliveCount).toBe(6);
    expect(before?.alive[2]).toBe(0);
    expect(page.part.shownRevision()).toBe(4);
    expect(page.part.figures.value?.faces).toBe(7);
    expect(page.part.listsAreOld.value).toBe(true);
    expect(heard).toMatchObject([[{ kind: "alive", value: false }]]);
    expect(page.fetched).toEqual([]);
  });

  it("moves and adds vertices", async () => {
    const page = await shown();
    const moved = { "0.ids": Uint32Array.of(0), "0.positions": Float32Array.of(7, 8, 9) };
    const { alive: _, ...added } = plate(1);
    const arrays = Object.fromEntries(Object.entries(added).map(([name, array]) => [`1.${name}`, array]));
    await page.say(patch("cup", 4, [{ kind: "verts" }, { kind: "append" }]), { ...moved, ...arrays });
    const mesh = page.part.mesh.value!;
    expect([...mesh.positions.subarray(0, 3)]).toEqual([7, 8, 9]);
    expect([mesh.vertexCount, mesh.faceCount]).toEqual([9 + 4, 8 + 2]);
  });

  it.each([
    ["that skips a revision", patch("cup", 5)],
    ["of another epoch", patch("cup", 4, [], 2)],
    ["that replaces the mesh", patch("cup", 4, [{ kind: "replace" }])],
  ])("%s has the mesh fetched", async (_, message) => {
    const page = await shown();
    await page.say(message);
    expect(page.fetched).toMatchObject([{ path: meshPath("cup") }]);
    await serveMesh(page, "cup", message.revision, message.epoch);
    expect(page.part.shownRevision()).toBe(message.revision);
    expect(page.fetched).toEqual([]);
  });

  it("that comes while an older mesh is on its way has it fetched again", async () => {
    const page = await openPage({ hash: "#repair/cup" });
    await page.connect();
    await page.say({ ...opened("cup"), id: page.asked("open")[0].id });
    await page.say(patch("cup", 4, [{ kind: "alive", value: false }]), { "0.faces": Uint32Array.of(2) });
    await serveMesh(page, "cup", 3);
    await serveMesh(page, "cup", 4);
    expect(page.part.shownRevision()).toBe(4);
    expect(page.fetched).toEqual([]);
  });

  it("that says what a mesh fetched since shows already changes nothing, and no selection is lost", async () => {
    const page = await openPage({ hash: "#repair/cup" });
    await page.connect();
    await page.say({ ...opened("cup"), id: page.asked("open")[0].id });
    await serveMesh(page, "cup", 4);
    const before = page.part.mesh.value;
    await page.say(patch("cup", 4, [{ kind: "alive", value: false }]), { "0.faces": Uint32Array.of(2) });
    expect(page.fetched).toEqual([]);
    expect(page.part.mesh.value).toBe(before);
    expect(before?.aliveCount).toBe(8);
  });

  it("that says what a mesh fetched since shows already has its figures shown, and lists asked for again", async () => {
    const page = await openPage({ hash: "#repair/cup" });
    await page.connect();
    await page.say({ ...opened("cup"), id: page.asked("open")[0].id });
    await serveMesh(page, "cup", 4);
    page.part.listsAreOld.value = false;
    await page.say(patch("cup", 4));
    expect(page.part.figures.value?.faces).toBe(7);
    expect(page.part.listsAreOld.value).toBe(true);
  });

  it.each([1, 9])(
    "of a scan that was opened anew (epoch %i) is not taken for an old one of the shown mesh",
    async (epoch) => {
      const page = await shown();
      await page.say(patch("cup", 4));
      await page.say(opened("cup", 0, epoch));
      await page.say(patch("cup", 1, [], epoch));
      await serveMesh(page, "cup", 0, epoch);
      await serveMesh(page, "cup", 1, epoch);
      expect(page.part.shownRevision()).toBe(1);
      expect(page.fetched).toEqual([]);
    },
  );

  it("has a mesh of the opening before, which was on its way, fetched again", async () => {
    const page = await shown();
    await page.say(patch("cup", 6));
    await page.say(opened("cup", 0, 9));
    await serveMesh(page, "cup", 6);
    await serveMesh(page, "cup", 0, 9);
    expect(page.part.shownRevision()).toBe(0);
    expect(page.fetched).toEqual([]);
  });

  it("of another scan is nothing to this page", async () => {
    const page = await shown();
    await page.say(patch("box", 4, [{ kind: "alive", value: false }]), { "0.faces": Uint32Array.of(2) });
    expect(page.part.mesh.value?.aliveCount).toBe(8);
    expect(page.part.shownRevision()).toBe(3);
  });
});

describe("an edit", () => {
  it("has a surface that could not be loaded loaded before it", async () => {
    const page = await shown();
    await page.say(opened("cup", 5));
    page.fetched.splice(0, 1)[0].answer(new ArrayBuffer(0), false);
    await page.settle();
    void page.part.doEdit({ kind: "close" });
    await page.settle();
    expect(page.asked("edit")).toEqual([]);
    await serveMesh(page, "cup", 5);
    expect(page.asked("edit")).toMatchObject([{ base_revision: 5 }]);
  });

  it("names the revision that the page shows", async () => {
    const page = await shown();
    const done = page.part.doEdit({ kind: "close" });
    await page.settle();
    expect(page.asked("edit")).toMatchObject([{ scan: "cup", base_revision: 3, preview: false }]);
    await page.say({ kind: "done", id: page.asked("edit")[0].id });
    expect(await done).toBe(true);
  });

  it("waits for the one before it, and names the revision that this one left", async () => {
    const page = await shown();
    const first = page.part.doEdit({ kind: "close" });
    const second = page.part.doEdit({ kind: "smooth" });
    await page.settle();
    expect(page.asked("edit")).toMatchObject([{ edit: { kind: "close" }, base_revision: 3 }]);
    await page.say(patch("cup", 4));
    await page.say({ kind: "done", id: page.asked("edit")[0].id });
    expect(page.asked("edit")[1]).toMatchObject({ edit: { kind: "smooth" }, base_revision: 4 });
    await page.say({ kind: "refused", id: page.asked("edit")[1].id, code: "InputError", text: "No.", hint: "" });
    expect([await first, await second]).toEqual([true, false]);
  });

  it("is undone in its turn: a step of the history waits for the edits before it", async () => {
    const page = await shown();
    void page.part.doEdit({ kind: "close" });
    void page.part.doEdit({ kind: "smooth" });
    void page.part.undo();
    await page.settle();
    expect(page.asked("undo")).toEqual([]);
    for (const k of [0, 1]) {
      await page.say(patch("cup", 4 + k));
      expect(page.asked("undo")).toEqual([]);
      await page.say({ kind: "done", id: page.asked("edit")[k].id });
    }
    expect(page.asked("undo")).toMatchObject([{ scan: "cup" }]);
  });

  it("that is refused takes the undo that waited for it along, and no later one", async () => {
    const page = await shown();
    void page.part.doEdit({ kind: "close" });
    void page.part.undo();
    await page.settle();
    await page.say({ kind: "refused", id: page.asked("edit")[0].id, code: "stale", text: "No.", hint: "" });
    expect(page.asked("undo")).toEqual([]);
    expect(page.state.notices.value.map(({ text }) => text).join()).toMatch(/nothing was undone/);
    void page.part.undo();
    await page.settle();
    expect(page.asked("undo").length).toBe(1);
  });

  it("of another scan is not waited for", async () => {
    const page = await shown();
    void page.part.doEdit({ kind: "close" });
    await page.walk("#repair/box");
    await page.say({ ...opened("box"), id: page.asked("open")[1].id });
    await serveMesh(page, "box");
    void page.part.undo();
    await page.settle();
    expect(page.asked("undo")).toMatchObject([{ scan: "box" }]);
  });

  it("of a selection is not sent when the edit before it has renumbered the surface", async () => {
    const page = await shown();
    const first = page.part.doEdit({ kind: "decimate" });
    const second = page.part.doEdit({ kind: "delete" }, { faces: Uint32Array.of(1) });
    await page.settle();
    await page.say(patch("cup", 4, [{ kind: "replace" }], 2));
    await page.say({ kind: "done", id: page.asked("edit")[0].id });
    await serveMesh(page, "cup", 4, 2);
    expect([await first, await second]).toEqual([true, false]);
    expect(page.asked("edit").length).toBe(1);
    expect(page.state.notices.value).toMatchObject([
      { severity: "warning", text: expect.stringMatching(/rebuilt after the selection/) },
    ]);
  });

  it("that is refused is not done, and says why", async () => {
    const page = await shown();
    const done = page.part.doEdit({ kind: "close" });
    await page.settle();
    const { id } = page.asked("edit")[0];
    await page.say({ kind: "refused", id, code: "stale", text: "The surface has changed.", hint: "" });
    expect(await done).toBe(false);
    expect(page.state.notices.value).toMatchObject([{ severity: "warning" }]);
  });

  it("as a preview gives the surface it would make", async () => {
    const page = await shown();
    const asked = page.part.previewEdit({ kind: "close" });
    await page.settle();
    const { id } = page.asked("edit")[0];
    const arrays = { positions: new Float32Array(9), faces: new Uint32Array(3), dead: Uint32Array.of(1) };
    await page.say({ kind: "preview", id, figures: FIGURES }, arrays);
    expect([...((await asked)?.dead ?? [])]).toEqual([1]);
    expect(page.part.shownRevision()).toBe(3);
  });
});

describe("what belongs to the scan", () => {
  it("follows the server, and only for this scan", async () => {
    const page = await shown();
    const entry = { index: 0, edit: 1, name: "close", text: "", on: true, at: "", title: "", picture: "" };
    await page.say({ kind: "history", scan: "box", history: [entry], cursor: 1, branches: [], scanned_picture: "" });
    expect(page.part.history.value).toEqual([]);
    await page.say({ kind: "history", scan: "cup", history: [entry], cursor: 1, branches: [], scanned_picture: "" });
    expect([page.part.history.value.length, page.part.cursor.value]).toEqual([1, 1]);
  });

  it("is gone from the list: the person is told once", async () => {
    const page = await shown();
    await page.say({ kind: "scans", scans: [{ scan: "box" }] });
    await page.say({ kind: "scans", scans: [{ scan: "plate" }] });
    expect(page.state.notices.value.map(({ text }) => text)).toEqual(["the cup is no longer in the list of scans."]);
  });

  it("the lists are asked for, borders of holes with them", async () => {
    const page = await shown();
    const listed = page.part.listHoles();
    const { id } = page.asked("list_holes")[0];
    const message = { kind: "holes", id, scan: "cup", revision: 3, holes: [{ hole: 4 }] };
    await page.say(message, { loop_4: Float32Array.of(1, 2, 3) });
    await listed;
    expect([...(page.part.holes.value?.[0].loop ?? [])]).toEqual([1, 2, 3]);
  });
});

describe("profiles", () => {
  const path = (step: number) => `api/scans/cup/profile/0/${step}`;
  const profile = (page: Page, step: number) =>
    page.serve(
      path(step),
      { scan: "cup", grid: 0, step, orientation: "vertical" },
      {
        position: new Float32Array(2),
        candidates: new Float32Array(2),
        candidate_amplitude: new Float32Array(2),
        candidate_points: new Float32Array(6),
        chosen: new Int8Array(2),
      },
    );

  it("follow the mark; the one asked for last is shown, however late the others come", async () => {
    const page = await shown();
    page.part.mark.value = { grid: 0, step: 1, line: 0, point: null };
    page.part.mark.value = { grid: 0, step: 2, line: 0, point: null };
    await profile(page, 2);
    expect(page.part.profile.value?.step).toBe(2);
    await profile(page, 1);
    expect(page.part.profile.value?.step).toBe(2);
  });

  it("are fetched again when their step of the grid has changed, not for another", async () => {
    const page = await shown();
    page.part.mark.value = { grid: 0, step: 1, line: 0, point: null };
    await profile(page, 1);
    await page.say({ kind: "grid", scan: "cup", grid: 0, steps: [3] });
    expect(page.fetched).toEqual([]);
    await page.say({ kind: "grid", scan: "cup", grid: 0, steps: [1] });
    expect(page.fetched).toMatchObject([{ path: path(1) }]);
  });
});
