/** The open scan: its mesh, grids, profile, history and lists, kept in step with the server. */
import { batch, computed, effect, signal } from "@preact/signals";
import { link, on } from "./bus";
import type { AnyArray, Arrays } from "./envelope";
import { Grid } from "./grid/data";
import { getArrays, openedFor, type Received, RefusedError, reopening } from "./link";
import { type MeshArrays, MeshModel, type Part, plainMesh } from "./mesh/model";
import { Profile } from "./profile/data";
import type {
  BranchEntry,
  Defect,
  Figures,
  GridHeader,
  HistoryEntry,
  HoleEntry,
  Measure,
  MeshHeader,
  Opened,
  Patch,
  ProfileHeader,
  ScanSettings,
  SettingsChanged,
} from "./protocol";
import { complain, connection, go, notify, place, scans } from "./state";

export const opened = signal<Opened | null>(null);
export const figures = signal<Figures | null>(null);
export const history = signal<readonly HistoryEntry[]>([]);
/** Other histories, left when an edit was made after stepping back. */
export const branches = signal<readonly BranchEntry[]>([]);
/** Names the picture of the surface before any edit; empty for none. */
export const scannedPicture = signal("");
export const cursor = signal(0);
/** What the surface is made with. */
export const settings = signal<ScanSettings | null>(null);
export const holes = signal<readonly Hole[] | null>(null);
/** How many there are; only some are listed. */
export const holeCount = signal(0);
export const defects = signal<readonly Defect[] | null>(null);
/** The lists of holes and defects are of an earlier surface; who shows them asks again. */
export const listsAreOld = signal(true);
export const measures = signal<readonly Measure[]>([]);
/** The mesh itself changes in place: `shape` counts when it does. */
export const mesh = signal<MeshModel | null>(null);
export const shape = signal(0);
/** What the numbers in the mesh's array of lasers stand for. */
export const lasers = signal<readonly string[]>([]);
/** Some of the profiles of a large scan, to look at until the surface is there; nothing is edited on it. */
export const firstSurface = signal<FirstLook | null>(null);
export const loading = signal<string | null>(null);
export const grids = signal<readonly (Grid | null)[]>([]);
export const profile = signal<Profile | null>(null);

export interface FirstLook {
  model: MeshModel;
  /** One in so many profiles is in it. */
  every: number;
  /** Repairs in the file, which are not in it. */
  edits: number;
}

export interface Hole extends HoleEntry {
  /** (3m) mm, the border */
  loop: Float32Array;
}

/** The point that all views show. */
export interface Mark {
  grid: number;
  step: number;
  line: number;
  point: [number, number, number] | null;
}

export const mark = signal<Mark | null>(null);
/** The whole is there or under way: until then there is nothing to edit, measure or export. */
export const isOpen = computed(() => opened.value !== null);
export const scanName = computed(() => opened.value?.name ?? null);

let revision = -1;
let epoch = -1;
/** The revision whose holes are listed. */
let holesOf = -1;
/** The mesh that is on its way, and of which scan. */
let underWay: { scan: string; arrival: Promise<void> } | null = null;
type MeshListener = (parts: readonly Part[] | null) => void;
const meshListeners = new Set<MeshListener>();

/** Hear of changes of the mesh: the parts of a patch, or null for another mesh. */
export function onMesh(listener: MeshListener): () => void {
  meshListeners.add(listener);
  return () => meshListeners.delete(listener);
}

/** The revision that the mesh on the screen shows. */
export function shownRevision(): number {
  return revision;
}

async function open(scan: string): Promise<void> {
  loading.value = "Opening";
  try {
    const { header } = await link.request({ kind: "open", scan });
    if (header.kind === "opened") await show(header);
  } catch (error) {
    loading.value = null;
    complain(error);
    go("projects", null);
  }
}

/** Open a scan on the server, and wait until it is. */
export function openScan(scan: string): Promise<Opened> {
  return new Promise((done, fail) => {
    const end = (error: Error | null, message?: Opened) => {
      for (const stop of stops) stop();
      if (message) done(message);
      else if (error) fail(error);
    };
    const stops = [
      on("opened", (message) => message.scan === scan && end(null, message)),
      on("job", (message) => {
        if (message.what !== "open" || message.scan !== scan) return;
        if (message.state === "failed" || message.state === "cancelled")
          end(new RefusedError(message.state, message.text, message.hint));
      }),
    ];
    link.request({ kind: "open", scan }).catch(end);
  });
}

/** The scans that are being opened again. */
const openedAgain = new Map<string, Promise<boolean>>();

/** Open a scan that the server has closed to make room; whether the faces on the screen are still its own. */
function reopen(scan: string): Promise<boolean> {
  const known = openedAgain.get(scan);
  if (known) return known;
  const mine = takeAgain(scan).finally(() => openedAgain.delete(scan));
  openedAgain.set(scan, mine);
  return mine;
}

async function takeAgain(scan: string): Promise<boolean> {
  const before = mesh.value;
  const here = () => opened.value?.scan === scan;
  if (!here()) {
    await openScan(scan);
    return false;
  }
  notify("note", `${scanName.value} was closed to make room for other scans; it is opened again.`);
  loading.value = "Opening again";
  try {
    await show(await openScan(scan));
  } finally {
    if (here()) loading.value = null;
  }
  return here() && before !== null && before === mesh.value;
}

async function show(message: Opened): Promise<void> {
  if (message.scan !== place.value.scan) return;
  const same = opened.value?.scan === message.scan;
  batch(() => {
    opened.value = message;
    figures.value = message.figures;
    history.value = message.history;
    branches.value = message.branches;
    scannedPicture.value = message.scanned_picture;
    cursor.value = message.cursor;
    measures.value = message.measures;
    settings.value = message.settings;
    holes.value = defects.value = null;
    listsAreOld.value = true;
    grids.value = message.grids.map(() => null);
    if (!same) mark.value = profile.value = null;
  });
  if (!same || message.epoch !== epoch || message.revision !== revision) {
    // What is on the screen is of no use to patches that come before the mesh does.
    revision = epoch = -1;
    await fetchMeshOf(message);
  }
  loading.value = null;
}

/** Get the mesh of the open scan, or wait for the one that is on its way. */
function fetchMesh(): Promise<void> {
  const scan = opened.value?.scan;
  if (!scan) return Promise.resolve();
  if (underWay?.scan !== scan) {
    const mine = { scan, arrival: takeMesh(scan) };
    underWay = mine;
    void mine.arrival.finally(() => {
      if (underWay === mine) underWay = null;
    });
  }
  return underWay.arrival;
}

/** Get the mesh as it is after a message: what was on its way before may be older than that. */
async function fetchMeshOf(message: { scan: string; revision: number; epoch: number }): Promise<void> {
  const asked = underWay?.scan === message.scan;
  await fetchMesh();
  if (!asked || opened.value?.scan !== message.scan) return;
  if (epoch !== message.epoch || revision < message.revision) await fetchMesh();
}

async function takeMesh(scan: string): Promise<void> {
  try {
    loading.value ??= "Loading the surface";
    // Whoever opens it again waits for this.
    const { header, arrays } = await getArrays<MeshHeader>(`api/scans/${scan}/mesh`, false);
    if (opened.value?.scan !== scan) return;
    revision = header.revision;
    epoch = header.epoch;
    lasers.value = header.lasers;
    const next = modelOf(arrays);
    if (!mesh.value?.equals(next)) {
      mesh.value = next;
      changed(null);
    }
    firstSurface.value = null;
  } catch (error) {
    complain(error);
  } finally {
    if (opened.value?.scan === scan) loading.value = null;
  }
}

function changed(parts: readonly Part[] | null): void {
  shape.value += 1;
  for (const listener of meshListeners) listener(parts);
}

/** The mesh that an answer of the server holds. */
export function modelOf(arrays: Arrays): MeshModel {
  return new MeshModel({ ...vertexArrays(arrays, ""), alive: arrays.u8("alive") });
}

function vertexArrays(arrays: Arrays, prefix: string): Omit<MeshArrays, "alive"> {
  return {
    positions: arrays.f32(`${prefix}positions`),
    faces: arrays.u32(`${prefix}faces`),
    measured: arrays.u8(`${prefix}measured`),
    sigma: arrays.f32(`${prefix}sigma`),
    laser: arrays.i32(`${prefix}laser`),
    step: arrays.i32(`${prefix}step`),
    line: arrays.i32(`${prefix}line`),
  };
}

/** The parts of a patch with their arrays; null where the mesh must be got anew. */
function partsOf(message: Patch, arrays: Arrays): Part[] | null {
  const out: Part[] = [];
  for (const [k, part] of message.parts.entries()) {
    if (part.kind === "replace") return null;
    if (part.kind === "alive") out.push({ ...part, faces: arrays.u32(`${k}.faces`) });
    else if (part.kind === "verts")
      out.push({ ...part, ids: arrays.u32(`${k}.ids`), positions: arrays.f32(`${k}.positions`) });
    else if (part.kind === "append") out.push({ ...part, ...vertexArrays(arrays, `${k}.`) });
    else out.push(part);
  }
  return out;
}

async function patch(message: Patch, arrays: Arrays): Promise<void> {
  figures.value = message.figures;
  listsAreOld.value = true;
  // A mesh that was fetched may be newer than what is still on its way to say so.
  if (message.epoch === epoch && message.revision <= revision) return;
  const parts = message.epoch === epoch && message.revision === revision + 1 ? partsOf(message, arrays) : null;
  if (!parts || !mesh.value) {
    await fetchMeshOf(message);
    return;
  }
  for (const part of parts) mesh.value.apply(part);
  revision = message.revision;
  changed(parts);
}

// Edits

export type EditValue = { kind: string } & Record<string, unknown>;

/** Of each scan with edits or steps of the history under way: whether the last of them was done. */
const lastEdits = new Map<string, Promise<boolean>>();
/** How many edits of each scan are under way. */
const editing = signal<ReadonlyMap<string, number>>(new Map());
/** There is something to undo, or will be once the edits that it waits for are done. */
export const canUndo = computed(() => cursor.value > 0 || editing.value.has(opened.value?.scan ?? ""));

function countEdits(scan: string, by: number): void {
  const next = new Map(editing.peek());
  const left = (next.get(scan) ?? 0) + by;
  if (left) next.set(scan, left);
  else next.delete(scan);
  editing.value = next;
}

/** Ask once what was asked for before of this scan is answered; a step back only if that was done. */
function inTurn(scan: string, what: string, ask: () => Promise<Received>): Promise<Received> {
  const before = lastEdits.get(scan) ?? Promise.resolve(true);
  const mine = before.then((done) => {
    if (done || what !== "undo") return ask();
    throw new RefusedError("stale", "The edit before it was not made; nothing was undone.", "");
  });
  const end = mine.then(
    () => (what === "preview" ? before : true),
    () => (what === "preview" ? before : false),
  );
  lastEdits.set(scan, end);
  if (what === "edit") countEdits(scan, 1);
  void end.then(() => {
    if (lastEdits.get(scan) === end) lastEdits.delete(scan);
    if (what === "edit") countEdits(scan, -1);
  });
  return mine;
}

/** One edit after another, each on the surface that the one before it left. */
function editRequest(edit: EditValue, arrays: Record<string, AnyArray>, preview: boolean): Promise<Received> {
  const scan = opened.value?.scan;
  if (!scan) {
    const text = "The scan is still being opened; nothing was edited.";
    return Promise.reject(new RefusedError("stale", text, "Wait until the whole surface is there."));
  }
  const numbered = Object.keys(arrays).length > 0;
  const selectedIn = epoch;
  return inTurn(scan, preview ? "preview" : "edit", async () => {
    if (opened.value?.scan !== scan) {
      throw new RefusedError("stale", "Another scan was opened meanwhile; nothing was edited.", "");
    }
    await underWay?.arrival;
    if (revision < 0) await fetchMesh();
    if (revision < 0) throw new RefusedError("stale", "The surface is not loaded; nothing was edited.", "Repeat.");
    if (numbered && epoch !== selectedIn) {
      throw new RefusedError(
        "stale",
        "The surface was rebuilt after the selection was made; nothing was edited.",
        "Select again, then repeat.",
      );
    }
    const send = () => link.request({ kind: "edit", scan, base_revision: revision, edit, preview }, arrays);
    return openedFor(scan, send, numbered);
  });
}

/** Do an edit; true when it is in the scan file. */
export async function doEdit(edit: EditValue, arrays: Record<string, AnyArray> = {}): Promise<boolean> {
  try {
    await editRequest(edit, arrays, false);
    return true;
  } catch (error) {
    complain(error);
    return false;
  }
}

export interface Preview {
  positions: Float32Array;
  faces: Uint32Array;
  dead: Uint32Array;
  figures: Figures;
}

export async function previewEdit(edit: EditValue, arrays: Record<string, AnyArray> = {}): Promise<Preview | null> {
  try {
    const { header, arrays: got } = await editRequest(edit, arrays, true);
    if (header.kind !== "preview") return null;
    return { positions: got.f32("positions"), faces: got.u32("faces"), dead: got.u32("dead"), figures: header.figures };
  } catch (error) {
    complain(error);
    return null;
  }
}

async function toScan(
  what:
    | { kind: "undo" }
    | { kind: "redo" }
    | { kind: "go_to"; edit: number }
    | { kind: "name_edit"; edit: number; name: string }
    | { kind: "switch"; edit: number; on: boolean },
) {
  const scan = opened.value?.scan;
  if (!scan) return;
  try {
    await inTurn(scan, what.kind, () => link.request({ ...what, scan }));
  } catch (error) {
    complain(error);
  }
}

export const undo = () => toScan({ kind: "undo" });
export const redo = () => toScan({ kind: "redo" });
/** To the state after an edit, of a branch too; 0: as scanned. */
export const goTo = (edit: number) => toScan({ kind: "go_to", edit });
export const nameEdit = (edit: number, name: string) => toScan({ kind: "name_edit", edit, name });
export const switchEdit = (edit: number, isOn: boolean) => toScan({ kind: "switch", edit, on: isOn });

/** Other settings hold: the grids have other steps, and what was marked may be gone. */
function changeSettings(message: SettingsChanged): void {
  const now = opened.value;
  if (now?.scan !== message.scan) return;
  const same = JSON.stringify(message.settings.options) === JSON.stringify(settings.value?.options);
  const shown = grids.value.flatMap((grid, k) => (grid ? [k] : []));
  batch(() => {
    settings.value = message.settings;
    opened.value = { ...now, grids: message.grids, findings: message.findings };
    if (same) return;
    grids.value = message.grids.map(() => null);
    mark.value = profile.value = null;
  });
  if (!same) for (const k of shown) if (k < message.grids.length) loadGrid(k).catch(complain);
}

// Lists

/** The largest holes; with `more` the next ones, after those that are listed. */
export async function listHoles(more = false): Promise<void> {
  const scan = opened.value?.scan;
  if (!scan) return;
  const known = more ? (holes.value ?? []) : [];
  try {
    const { header, arrays } = await link.request({ kind: "list_holes", scan, first: known.length });
    if (header.kind !== "holes" || (more && header.revision !== holesOf)) return;
    const next = header.holes.map((hole) => ({ ...hole, loop: arrays.f32(`loop_${hole.hole}`) }));
    holesOf = header.revision;
    holeCount.value = header.many;
    holes.value = [...known, ...next];
  } catch (error) {
    complain(error);
  }
}

export async function listDefects(): Promise<void> {
  const scan = opened.value?.scan;
  if (!scan) return;
  try {
    const { header } = await link.request({ kind: "list_defects", scan });
    if (header.kind === "defects") defects.value = header.defects;
  } catch (error) {
    complain(error);
  }
}

// Grids and profiles

export async function loadGrid(number: number): Promise<Grid | null> {
  const scan = opened.value?.scan;
  if (!scan) return null;
  const known = grids.value[number];
  if (known) return known;
  try {
    const { header, arrays } = await getArrays<GridHeader>(`api/scans/${scan}/grid/${number}`);
    if (opened.value?.scan !== scan) return null;
    const grid = new Grid(header, arrays);
    grids.value = grids.value.map((old, i) => (i === number ? grid : old));
    return grid;
  } catch (error) {
    complain(error);
    return null;
  }
}

async function refreshGrid(number: number, steps: readonly number[]): Promise<void> {
  const scan = opened.value?.scan;
  const old = grids.value[number];
  if (!scan || !old) return;
  if (steps.length > 4) {
    grids.value = grids.value.map((grid, i) => (i === number ? null : grid));
    await loadGrid(number);
  } else {
    let next = old;
    for (const step of steps) {
      const { header, arrays } = await getArrays<GridHeader>(`api/scans/${scan}/grid/${number}?step=${step}`);
      next = next.withRows(new Grid(header, arrays));
    }
    grids.value = grids.value.map((grid, i) => (i === number ? next : grid));
  }
}

let profileWanted = 0;

export async function loadProfile(grid: number, step: number, again = false): Promise<void> {
  const scan = opened.value?.scan;
  const known = profile.value;
  if (!scan || (!again && known?.grid === grid && known.step === step)) return;
  const turn = ++profileWanted;
  try {
    const { header, arrays } = await getArrays<ProfileHeader>(`api/scans/${scan}/profile/${grid}/${step}`);
    if (turn === profileWanted) profile.value = new Profile(header, arrays);
  } catch (error) {
    if (turn === profileWanted) complain(error);
  }
}

/** The address of the picture of a profile. */
export function pictureOf(of: Profile): string {
  return `api/scans/${opened.value?.scan ?? ""}/picture/${of.grid}/${of.step}.png`;
}

/** Follow the address and the server's messages: once, after the page's state has begun to. */
export function startPart(): void {
  reopening.of = reopen;
  hearServer();
  followPage();
}

function hearServer(): void {
  on("first_surface", (message, arrays) => {
    const { scan, every, edits } = message;
    if (scan !== place.value.scan || scan === opened.value?.scan) return;
    firstSurface.value = { model: plainMesh(arrays.f32("positions"), arrays.u32("faces"), null), every, edits };
  });
  on("opened", (message) => {
    if (message.id === null) void show(message);
  });
  on("patch", (message, arrays) => {
    if (message.scan === opened.value?.scan) void patch(message, arrays);
  });
  on("history", (message) => {
    if (message.scan !== opened.value?.scan) return;
    history.value = message.history;
    branches.value = message.branches;
    scannedPicture.value = message.scanned_picture;
    cursor.value = message.cursor;
  });
  on("closed", ({ scan }) => {
    if (scan !== opened.value?.scan) return;
    leave();
    if (scan === place.value.scan) go("projects", null);
  });
  on("settings", changeSettings);
  on("measures", (message) => {
    if (message.scan === opened.value?.scan) measures.value = message.measures;
  });
  on("grid", (message) => {
    if (message.scan !== opened.value?.scan) return;
    refreshGrid(message.grid, message.steps).catch(complain);
    const shown = profile.value;
    if (shown?.grid === message.grid && message.steps.includes(shown.step))
      void loadProfile(shown.grid, shown.step, true);
  });

  on("job", ({ what, state, scan }) => {
    if (
      what !== "open" ||
      state === "running" ||
      state === "done" ||
      scan !== place.value.scan ||
      scan === opened.value?.scan
    )
      return;
    // It will not open: back to what there is. The message itself stays.
    loading.value = firstSurface.value = null;
    go("projects", null);
  });
}

/** Nothing is open: what was shown is of no use to what is opened next, nor may be edited meanwhile. */
function leave(): void {
  revision = epoch = -1;
  batch(() => {
    opened.value = figures.value = settings.value = holes.value = defects.value = null;
    mesh.value = firstSurface.value = mark.value = profile.value = null;
    history.value = branches.value = measures.value = grids.value = [];
    scannedPicture.value = "";
    cursor.value = 0;
    listsAreOld.value = true;
  });
}

/** Open the scan of the address, again whenever the connection comes back. */
function followPage(): void {
  effect(() => {
    const { scan } = place.value;
    if (connection.value !== "open") return;
    if (scan && scan !== opened.peek()?.scan) leave();
    if (scan) void open(scan);
  });
  const gone = computed(() => {
    const current = opened.value;
    const listed = scans.value.length === 0 || scans.value.some((entry) => entry.scan === current?.scan);
    return current && !listed ? current.name : null;
  });
  effect(() => {
    if (gone.value !== null) notify("warning", `${gone.value} is no longer in the list of scans.`);
  });
  effect(() => {
    const at = mark.value;
    if (at && at.step >= 0) void loadProfile(at.grid, at.step);
  });
}
