/** A calibration in the making: what was chosen for it, how far it is, and the picture that is shown. */
import { computed, signal } from "@preact/signals";
import { on } from "../bus";
import { kept } from "../kept";
import type { Calibration, CalibrationView, VerificationRuns } from "../protocol";
import { isScanning, orientation, picture } from "../scanner/live";
import type { ShownPicture } from "../scanner/picture";
import { ask, devices, isOperator, jobs } from "../state";

export type Range = [number, number];
export type Carrier = "hand" | "table";

export const STEPS = ["target", "camera", "laser", "table", "result", "verify"] as const;
export type Step = (typeof STEPS)[number];

export const step = signal<Step>("target");
export const board = kept<string>("board", "charuco:9x6:12:9:DICT_5X5_100");
export const onTable = kept<string>("table-target", "charuco:9x6:12:9:DICT_5X5_100");
export const paper = kept<"a4" | "a3" | "letter">("paper", "a4", ["a4", "a3", "letter"]);
/** mm that the two printed rulers of 100 mm measure. */
export const rulers = signal<Range>([100, 100]);
export const rigName = kept<string>("rig-name", "rig");
/** mm from the table up to the lowest corner between squares of the board on it. */
export const lowest = signal(0);
/** How the board gets from one picture to the next. */
export const carrier = signal<Carrier>("hand");
export const count = signal(8);
/** s that a hand has to move the board. */
export const every = signal(3);
export const arc = signal<Range>([-40, 40]);
export const stops = signal(11);
/** Degrees; null is what suits the target: markers are seen from everywhere, a board from its front. */
export const turn = signal<Range | null>(null);
/** ms of room light; null is what the devices usually take. */
export const exposure = signal<number | null>(null);
const seconds = () => (exposure.value === null ? null : exposure.value / 1000);

export interface Progress {
  header: Calibration;
  /** u and v px of every corner seen, and the number of its view: three numbers each. */
  marked: Float32Array;
  /** x, y and z mm of every corner before the camera, and the number of its view: four numbers each. */
  placed: Float32Array;
}

export const progress = signal<Progress | null>(null);
/** An earlier picture that is shown again, in place of the live one. */
export const again = signal<{ view: number; shown: ShownPicture } | null>(null);
export const histories = signal<readonly VerificationRuns[]>([]);

/** Follow how far the calibration is: once. */
export function startCalibration(): void {
  on("calibration", (header, arrays) => {
    progress.value = { header, marked: arrays.f32("marked"), placed: arrays.f32("placed") };
    if (again.value && !header.views.some(({ view }) => view === again.value?.view)) again.value = null;
  });
  on("frame", () => (again.value = null));
}

export const markers = () => onTable.value.startsWith("markers:");
export const turnRange = (): Range => turn.value ?? (markers() ? [0, 360] : [-50, 50]);
export const connected = () => (devices.value?.addresses.length ?? 0) > 0;
export const working = computed(() =>
  [...jobs.value.values()].find((job) => job.what === "calibrate" && job.state === "running"),
);
export const ready = computed(() => isOperator.value && connected() && !isScanning() && !working.value);

export async function begin(): Promise<void> {
  const begun = await ask({
    kind: "calibrate_begin",
    board: board.value,
    table: onTable.value,
    lowest_mm: lowest.value,
    orientation: orientation.value,
    rulers_mm: rulers.value,
  });
  if (begun) step.value = "camera";
}

export function capture(stage: "camera" | "laser"): void {
  const how = carrier.value === "hand" ? { every: every.value } : { range_deg: arc.value };
  void ask({ kind: "capture", stage, count: count.value, seconds: seconds(), ...how });
}

export function captureTable(): void {
  void ask({ kind: "capture", stage: "table", count: stops.value, range_deg: turnRange(), seconds: seconds() });
}

/** Live pictures in which the board is looked for, lasers dark. */
export function watch(running: boolean): void {
  void ask({ kind: "look", on: running, seconds: seconds() ?? undefined, orientation: orientation.value, board: true });
}

export function finish(): void {
  void ask({ kind: "calibrate_finish", name: rigName.value });
}

/** Corners of one view, u and v px in turn. */
export function cornersOf(view: number, marked: Float32Array): Float32Array {
  const out: number[] = [];
  for (let k = 0; k < marked.length; k += 3) if (marked[k + 2] === view) out.push(marked[k], marked[k + 1]);
  return new Float32Array(out);
}

/** Show a picture that was taken before, with the corners that were found in it. */
export async function showAgain({ view }: CalibrationView): Promise<void> {
  const answer = await fetch(`api/calibration/${view}.jpg`);
  const now = progress.value;
  if (!answer.ok || !now) return;
  const image = await createImageBitmap(await answer.blob());
  const { width, height } = now.header.width > 1 ? now.header : (picture.value?.header ?? image);
  const shown = {
    header: { width, height, orientation: orientation.value },
    image,
    stripe: new Float32Array(),
    corners: cornersOf(view, now.marked),
  };
  again.value = { view, shown };
}

/** The third of the picture, each way, in which the fewest corners were seen. */
export function poorest({ cells, columns, rows }: Pick<Calibration, "cells" | "columns" | "rows">) {
  const sums = new Array<number>(9).fill(0);
  for (let k = 0; k < cells.length; k++) {
    const row = Math.floor((3 * Math.floor(k / columns)) / rows);
    const column = Math.floor((3 * (k % columns)) / columns);
    sums[3 * row + column] += cells[k];
  }
  const at = sums.indexOf(Math.min(...sums));
  return { row: Math.floor(at / 3), column: at % 3, corners: sums[at] };
}

const VERTICAL = ["top", "middle", "bottom"];
const ACROSS = ["left", "centre", "right"];

/** Where the board is wanted next, in words. */
export function wantedPlace(of: Pick<Calibration, "cells" | "columns" | "rows">): string {
  const { row, column } = poorest(of);
  return row === 1 && column === 1 ? "middle" : `${VERTICAL[row]} ${ACROSS[column]}`;
}
