/** The repairs: what each asks the server to do. */

import type { AnyArray } from "../envelope";
import { doEdit, type EditValue, type Hole, holes, mark, opened, type Preview, previewEdit, profile } from "../part";
import type { Profile } from "../profile/data";
import { notify } from "../state";
import { count } from "../ui/controls";
import { currentViewport } from "../viewport/place";
import { bridgeFrom, chosenHoles, lines, preview, smoothing, wholePiece } from "./state";

export type FillHow = "auto" | "flat" | "membrane" | "tangent" | "curvature";
export const FILL_HOW: readonly (readonly [FillHow, string])[] = [
  ["auto", "automatic"],
  ["flat", "flat"],
  ["membrane", "minimal surface"],
  ["tangent", "tangent"],
  ["curvature", "curvature"],
];

type Faces = Record<string, AnyArray>;

function selectedFaces(): Faces | null {
  const selection = currentViewport()?.selection;
  if (!selection?.count) {
    notify("note", "Nothing is selected.", "Use a tool on the left first, for instance the lasso (L).");
    return null;
  }
  return selection.arrays();
}

export async function deleteSelected(): Promise<void> {
  const faces = selectedFaces();
  if (faces) await doEdit({ kind: "delete" }, faces);
}

export async function deleteUnselected(): Promise<void> {
  if (!selectedFaces()) return;
  currentViewport()?.invert();
  await deleteSelected();
}

/** The selection as arrays of an edit; empty where nothing is selected, which means everywhere. */
export function selectionArrays(): Faces {
  const selection = currentViewport()?.selection;
  return selection?.count ? selection.arrays() : {};
}

/** Smooth what the brush has passed over, or else the selection. */
export async function smoothFaces(painted?: Uint32Array<ArrayBuffer>): Promise<void> {
  const faces = painted ? { faces: painted } : selectedFaces();
  if (faces) await doEdit({ kind: "smooth", ...smoothing.value }, faces);
}

/** The two ends of a bridge, one after the other. */
export async function bridgeAt(point: [number, number, number]): Promise<void> {
  const from = bridgeFrom.value;
  bridgeFrom.value = from ? null : point;
  if (from) await doEdit({ kind: "bridge_sides", a: from, b: point });
}

/** A band between the borders of two holes. */
export function bridgeValue(which: readonly Hole[], how: FillHow): EditValue {
  const [a, b] = holeNames(which);
  return { kind: "bridge_holes", a, b, how };
}

function holeNames(which: readonly Hole[]) {
  return which.map(({ centre, size }) => ({ centre, size }));
}

/** Holes named by a click, or all below a size. */
export function fillValue(which: readonly Hole[] | null, how: FillHow, largest: number | null): EditValue {
  return which ? { kind: "fill", holes: holeNames(which), how } : { kind: "fill", how, largest };
}

export function chosenHoleList(): Hole[] {
  return (holes.value ?? []).filter(({ hole }) => chosenHoles.value.has(hole));
}

/** Show what an edit would do. */
export async function show(edit: EditValue, arrays: Faces = {}): Promise<Preview | null> {
  const shown = await previewEdit(edit, arrays);
  preview.value = shown && { ...shown, of: edit.kind };
  return shown;
}

export async function apply(edit: EditValue, arrays: Faces = {}): Promise<boolean> {
  preview.value = null;
  const done = await doEdit(edit, arrays);
  if (done) chosenHoles.value = new Set();
  return done;
}

/** The name of the laser of the marked point. */
function laser(): string {
  return opened.value?.grids.find(({ grid }) => grid === mark.value?.grid)?.laser ?? "";
}

export async function deletePoints(): Promise<void> {
  const at = mark.value;
  if (!at || at.step < 0) return;
  const which = lines.value.length ? lines.value : [at.line];
  if (await doEdit({ kind: "delete_points", laser: laser(), step: at.step, lines: which })) lines.value = [];
}

export async function placePoint(line: number, position: number): Promise<void> {
  const at = mark.value;
  if (!at || at.step < 0) return;
  await doEdit({ kind: "set_point", laser: laser(), step: at.step, line, position });
}

/** The lines about one that have several candidates, as a reflection gives them: a piece of stripe. */
function pieceAbout(line: number): readonly [number, number] {
  const shown = profile.value;
  if (!shown) return [line, line];
  const several = (at: number) => at >= 0 && at < shown.lines && shown.of(at).length > 1;
  let [first, last] = [line, line];
  while (several(first - 1) || several(first - 2)) first--;
  while (several(last + 1) || several(last + 2)) last++;
  while (!several(first) && first < line) first++;
  while (!several(last) && last > line) last--;
  return [first, last];
}

/**
 * Take another candidate: in the lines chosen in the profile, else in the whole piece of stripe,
 * else in this line alone.
 */
export async function pickCandidate(line: number, position: number): Promise<void> {
  const at = mark.value;
  if (!at || at.step < 0) return;
  const chosen = lines.value.includes(line) ? ([Math.min(...lines.value), Math.max(...lines.value)] as const) : null;
  const span = chosen ?? (wholePiece.value ? pieceAbout(line) : ([line, line] as const));
  // The position is that of the first line; the server follows the stripe from there.
  const shown = profile.value;
  const start = shown ? followed(shown, line, position, span[0]) : position;
  await doEdit({ kind: "pick_candidate", laser: laser(), step: at.step, lines: span, position: start });
}

/** Where the stripe through a candidate is in an earlier line. */
function followed(shown: Profile, from: number, position: number, to: number): number {
  let at = position;
  for (let line = from - 1; line >= to; line--) {
    const near = shown
      .of(line)
      .map((candidate) => candidate.position)
      .toSorted((a, b) => Math.abs(a - at) - Math.abs(b - at))[0];
    if (near !== undefined) at = near;
  }
  return at;
}

export async function switchProfilesOff(steps: readonly [number, number]): Promise<void> {
  await doEdit({ kind: "profile_off", laser: laser(), steps });
}

export interface Seeking {
  steps: readonly [number, number];
  lines: readonly [number, number];
  threshold: number | null;
  strategy: string | null;
  choose: string | null;
}

export async function detectAgain(how: Seeking): Promise<void> {
  if (await doEdit({ kind: "redetect", laser: laser(), ...how })) {
    notify("note", `Detected again: ${count(how.steps[1] - how.steps[0] + 1)} of the profiles.`);
  }
}
