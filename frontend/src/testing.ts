/** What tests may read of the page; nothing can be changed through it. */

import { cursor, history, holes, type Mark, mark, mesh, profile, shownRevision } from "./part";
import { onPage } from "./repair/panes";
import { connection } from "./state";
import { currentViewport } from "./viewport/place";

export interface Readable {
  readonly connection: string;
  readonly revision: number;
  readonly vertices: number;
  readonly faces: number;
  readonly selected: number;
  /** Selected faces that look away from the eye. */
  readonly selectedAway: number;
  readonly pictures: number;
  readonly fullMs: number;
  readonly gpu: string;
  readonly edits: number;
  readonly cursor: number;
  readonly holes: number | null;
  readonly mark: Mark | null;
  /** The profile on the page. */
  readonly profile: { grid: number; step: number } | null;
  readonly camera: { azimuth: number; elevation: number; distance: number; target: readonly number[] } | null;
  /** Where a point of the part is in the window, CSS pixels. */
  place(point: [number, number, number]): { x: number; y: number } | null;
  /** Where a step and a line of the grid on the page are in the window, CSS pixels. */
  cell(step: number, line: number): { x: number; y: number } | null;
}

declare global {
  interface Window {
    turnscan: Readable;
  }
}

export function expose(): void {
  const readable: Readable = {
    get connection() {
      return connection.value;
    },
    get revision() {
      return shownRevision();
    },
    get vertices() {
      return mesh.value?.vertexCount ?? 0;
    },
    get faces() {
      return mesh.value?.aliveCount ?? 0;
    },
    get selected() {
      return currentViewport()?.selection.count ?? 0;
    },
    get selectedAway() {
      return currentViewport()?.selectedAway() ?? 0;
    },
    get pictures() {
      return currentViewport()?.pictures ?? 0;
    },
    get fullMs() {
      return currentViewport()?.fullMs ?? 0;
    },
    get gpu() {
      return currentViewport()?.gpu ?? "";
    },
    get edits() {
      return history.value.length;
    },
    get cursor() {
      return cursor.value;
    },
    get holes() {
      return holes.value?.length ?? null;
    },
    get mark() {
      return mark.value && { ...mark.value };
    },
    get profile() {
      const shown = profile.value;
      return shown && { grid: shown.grid, step: shown.step };
    },
    get camera() {
      const view = currentViewport();
      if (!view) return null;
      const { azimuth, elevation, distance, target } = view.camera;
      return { azimuth, elevation, distance, target: [...target] };
    },
    place(point) {
      return currentViewport()?.windowPlace(point) ?? null;
    },
    cell(step, line) {
      return onPage.grid?.cell(step, line) ?? null;
    },
  };
  Object.defineProperty(window, "turnscan", { value: Object.freeze(readable) });
}
