/** What tests may read of the page; nothing can be changed through it. */

import { link } from "./bus";
import { cursor, firstSurface, history, holes, loading, type Mark, mark, mesh, profile, shownRevision } from "./part";
import { onPage } from "./repair/panes";
import { connection } from "./state";
import { ownViews } from "./verbs/ownview";
import { currentViewport } from "./viewport/place";

export interface Readable {
  readonly connection: string;
  /** How many requests wait for their answers. */
  readonly requests: number;
  /** A scan is being opened, or its mesh is under way. */
  readonly loading: boolean;
  readonly revision: number;
  /** Of the mesh on the screen: the same for the same vertices, faces and deletions, to the bit. */
  readonly digest: string;
  readonly vertices: number;
  readonly faces: number;
  /** How many different colours the vertices have from texture images. */
  readonly shades: number;
  readonly selected: number;
  /** Selected faces that look away from the eye. */
  readonly selectedAway: number;
  readonly pictures: number;
  /** Faces of the surface in the picture on the screen, be it only the preview of it. */
  readonly drawnFaces: number;
  /** Faces of the preview that is shown until the surface is there; 0 for none. */
  readonly firstFaces: number;
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
  /** The same in a view of its own, by its label. */
  placeIn(label: string, point: [number, number, number]): { x: number; y: number } | null;
  /** Where a handle of the working volume is in the window, CSS pixels. */
  handle(part: string): { x: number; y: number } | null;
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
    get requests() {
      return link.pending;
    },
    get loading() {
      return loading.value !== null;
    },
    get revision() {
      return shownRevision();
    },
    get digest() {
      return digest();
    },
    get vertices() {
      return mesh.value?.vertexCount ?? 0;
    },
    get faces() {
      return mesh.value?.aliveCount ?? 0;
    },
    get shades() {
      const colour = mesh.value?.colour ?? new Uint8Array();
      const found = new Set<number>();
      for (let i = 0; i < colour.length; i += 3) found.add((colour[i] << 16) | (colour[i + 1] << 8) | colour[i + 2]);
      return found.size;
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
    get drawnFaces() {
      return currentViewport()?.drawnFaces ?? 0;
    },
    get firstFaces() {
      return firstSurface.value?.model.faceCount ?? 0;
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
    placeIn(label, point) {
      return ownViews.get(label)?.windowPlace(point) ?? null;
    },
    handle(part) {
      return currentViewport()?.handlePlace(part) ?? null;
    },
    cell(step, line) {
      return onPage.grid?.cell(step, line) ?? null;
    },
  };
  Object.defineProperty(window, "turnscan", { value: Object.freeze(readable) });
}

const CRC = Uint32Array.from({ length: 256 }, (_, k) => {
  let c = k;
  for (let bit = 0; bit < 8; bit++) c = c & 1 ? 0xedb88320 ^ (c >>> 1) : c >>> 1;
  return c;
});

/** How many vertices and faces there are, and CRC-32 of their arrays as the server sends them. */
function digest(): string {
  const model = mesh.value;
  if (!model) return "";
  const { vertexCount: v, faceCount: f } = model;
  const parts = [
    model.positions.subarray(0, 3 * v),
    model.faces.subarray(0, 3 * f),
    model.alive.subarray(0, f),
    model.measured.subarray(0, f),
    model.laser.subarray(0, v),
    model.step.subarray(0, v),
    model.line.subarray(0, v),
  ];
  let crc = 0xffffffff;
  for (const part of parts)
    for (const byte of new Uint8Array(part.buffer, part.byteOffset, part.byteLength))
      crc = CRC[(crc ^ byte) & 0xff] ^ (crc >>> 8);
  return `${v} ${f} ${(~crc >>> 0).toString(16)}`;
}
