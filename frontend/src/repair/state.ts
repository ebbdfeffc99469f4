/** What the Edit room has in hand. */
import { batch, computed, signal } from "@preact/signals";
import type { GridColouring, Range } from "../grid/view";
import { grids, lasers, loadGrid, type Mark, mark, mesh, onMesh, opened, type Preview } from "../part";
import type { PictureTool } from "../profile/picture";
import type { Hit } from "../viewport/pick";
import { angleLimit, brushRadius, colouring, currentViewport, tool, visibleOnly } from "../viewport/place";

export type Tab = "repair" | "point" | "holes" | "history" | "settings";
export const tab = signal<Tab>("repair");
export type Large = "surface" | "profile" | "picture" | "grid";
/** The view that fills the room, or null for all of them. */
export const large = signal<Large | null>(null);
export const gridShown = signal(0);
export const gridColouring = signal<GridColouring>("quality");
/** Steps and lines chosen in the grid. */
export const range = signal<Range | null>(null);
/** Lines chosen in the profile. */
export const lines = signal<readonly number[]>([]);
/** The first end of a bridge that is being laid. */
export const bridgeFrom = signal<[number, number, number] | null>(null);
/** Whether picking a candidate takes the whole piece of stripe, or one line. */
export const wholePiece = signal(true);
export const pictureTool = signal<PictureTool>("mark");
export const smoothing = signal({ strength: 0.5, rounds: 5 });
export const chosenHoles = signal<ReadonlySet<number>>(new Set());
/** What an edit would do; shown until it is done or dropped. */
export const preview = signal<(Preview & { of: string }) | null>(null);
export const markedGrid = computed(() => (mark.value ? (grids.value[mark.value.grid] ?? null) : null));

/** Follow the surface and show previews on it: once. */
export function startRepair(): void {
  // Another surface: holes have other numbers, and what was previewed is done or out of date.
  onMesh(() => {
    preview.value = null;
    chosenHoles.value = new Set();
  });
  preview.subscribe((shown) => currentViewport()?.showPreview(shown));
  let scan: string | null = null;
  opened.subscribe((now) => {
    if (now && now.scan !== scan) {
      scan = now.scan;
      startAnew();
    }
  });
}

/** Another scan: no tool, choice or view of the one before is carried over. */
function startAnew(): void {
  batch(() => {
    tool.value = "navigate";
    colouring.value = "plain";
    pictureTool.value = "mark";
    tab.value = "repair";
    large.value = bridgeFrom.value = range.value = null;
    lines.value = [];
    gridShown.value = 0;
  });
}

/** The grid (one turn of one laser) that a vertex was measured in. */
export function gridOf(laser: string, step: number): number {
  const found = opened.value?.grids.find(
    (grid) => grid.laser === laser && step >= grid.first_step && step <= grid.last_step,
  );
  return found?.grid ?? -1;
}

/** Mark a place of a grid in all views. */
export async function markPlace(grid: number, step: number, line: number, look = false): Promise<void> {
  gridShown.value = grid;
  const data = await loadGrid(grid);
  const row = data?.row(step) ?? -1;
  const point = data && row >= 0 ? data.point(row, line) : null;
  set({ grid, step, line, point });
  if (look && point) currentViewport()?.lookAt(point, 25);
}

/** A click on the surface marks the point that was measured there. */
export function markHit(hit: Hit): void {
  const model = mesh.value;
  if (!model) return;
  const { vertex } = hit;
  const step = model.step[vertex];
  const grid = step >= 0 ? gridOf(lasers.value[model.laser[vertex]], step) : -1;
  if (grid < 0) {
    set({ grid: -1, step: -1, line: -1, point: hit.point });
    return;
  }
  const at = model.positions.subarray(3 * vertex, 3 * vertex + 3);
  gridShown.value = grid;
  set({ grid, step, line: model.line[vertex], point: [at[0], at[1], at[2]] });
  void loadGrid(grid);
}

function set(at: Mark): void {
  mark.value = at;
  lines.value = [];
  tab.value = "point";
}

/** Go to a neighbouring profile or line; where nothing is marked, to the middle of the first profile. */
export async function stepMark(steps: number, alongLines: number): Promise<void> {
  const at = mark.value?.step === -1 ? null : mark.value;
  const grid = await loadGrid(at?.grid ?? gridShown.value);
  if (!grid) return;
  if (!at) {
    void markPlace(gridShown.value, grid.steps[0], Math.floor(grid.lines / 2));
    return;
  }
  const line = Math.max(0, Math.min(grid.lines - 1, at.line + alongLines));
  if (!steps) {
    void markPlace(at.grid, at.step, line);
    return;
  }
  const s = grid.steps.length;
  const before = grid.steps.filter((step) => step < at.step).length;
  // A profile that is switched off has no row: the next one stands in its place.
  const row = before + (grid.row(at.step) < 0 && steps > 0 ? steps - 1 : steps);
  const wrapped = grid.header.closed ? (row + s) % s : Math.max(0, Math.min(s - 1, row));
  void markPlace(at.grid, grid.steps[wrapped], line);
}

export const TOOL_HINTS = computed(() => {
  const seen = visibleOnly.value ? "visible surface only" : "through the part";
  switch (tool.value) {
    case "navigate":
      return "Click: mark a point in all views · drag: turn · double click: turn about this point";
    case "box":
      return `Drag a box: ${seen} · Shift adds, Ctrl removes`;
    case "lasso":
      return `Draw round the faces: ${seen} · Shift adds, Ctrl removes`;
    case "polygon":
      return `Click the polygon's corners; right click or Enter closes it: ${seen}`;
    case "brush":
      return `Paint: ${seen} · Ctrl+wheel or [ ]: size ${brushRadius.value.toFixed(0)} px`;
    case "connected":
      return "Click a piece: all connected triangles";
    case "angle":
      return `Click a face: the region bounded by edges sharper than ${angleLimit.value}°`;
    case "smooth":
      return "Paint where the surface is to be smoothed";
    case "bridge":
      return bridgeFrom.value ? "Click the boundary on the other side" : "Click the surface beside a boundary";
    case "cut":
      return "Drag the disc to shift the plane, the ball to tilt it";
  }
});
