/** Colours of the surface. Maps and palettes are chosen for eyes that confuse red and green. */
import { DISTINCT, type Rgb } from "../palette";
import type { MeshModel } from "./model";

export const COLOURINGS = ["plain", "sigma", "laser", "height", "measured", "deviation", "shapes", "edits"] as const;
/** `own` are the colours that the file of a mesh holds. */
export type Colouring = (typeof COLOURINGS)[number] | "own";

/** Cividis (Nuñez, Anderton & Renslow 2018): reads the same for every kind of colour vision. */
const CIVIDIS: readonly Rgb[] = [
  [0, 34, 78],
  [24, 54, 108],
  [63, 76, 107],
  [93, 98, 110],
  [122, 121, 119],
  [153, 145, 117],
  [187, 171, 106],
  [222, 199, 86],
  [254, 232, 56],
];

export const PLAIN: Rgb = [178, 187, 199];
export const UNMEASURED: Rgb = [122, 132, 214];
/** What was done by hand at a vertex: colour and word by the server's number. */
export const TOUCHES: readonly (readonly [Rgb, string])[] = [
  [PLAIN, "as measured"],
  [DISTINCT[0], "smoothed"],
  [DISTINCT[2], "added"],
  [DISTINCT[5], "beside what was deleted"],
  [DISTINCT[6], "changed in the scan grid"],
];

export function cividis(t: number): Rgb {
  return ramp(CIVIDIS, t);
}

function ramp(stops: readonly Rgb[], t: number): Rgb {
  const x = Math.min(Math.max(t, 0), 1) * (stops.length - 1);
  const i = Math.min(Math.floor(x), stops.length - 2);
  const w = x - i;
  const [a, b] = [stops[i], stops[i + 1]];
  return [a[0] + w * (b[0] - a[0]), a[1] + w * (b[1] - a[1]), a[2] + w * (b[2] - a[2])];
}

/** From Crameri's vik (2018): blue below, orange above, light where there is no deviation. */
const DIVERGING: readonly Rgb[] = [
  [5, 48, 122],
  [64, 128, 178],
  [163, 197, 219],
  [238, 236, 233],
  [231, 180, 145],
  [199, 107, 50],
  [125, 38, 6],
];

export function diverging(t: number): Rgb {
  return ramp(DIVERGING, t);
}

/** mm at the ends of a map of deviations, at least. */
const LEAST = 0.001;

/** Times the median sigma to which its map goes at least, and down to its part: what is alike has one colour. */
const ALIKE = 1.4;

/** The colours of a map, from its low end to its high one. */
export function mapOf(by: Colouring): (t: number) => Rgb {
  return by === "deviation" ? diverging : cividis;
}

export function css(rgb: Rgb): string {
  return `rgb(${rgb.map(Math.round).join(" ")})`;
}

export interface Legend {
  low: number;
  high: number;
  unit: string;
}

export interface Coloured {
  /** (4v) red, green, blue, 255 */
  rgba: Uint8Array;
  /** The ends of the map, where there is one. */
  legend: Legend | null;
}

/** One colour for every vertex. */
export function colourVertices(mesh: MeshModel, by: Colouring): Coloured {
  const rgba = new Uint8Array(4 * mesh.vertexCount).fill(255);
  const range = rangeOf(mesh, by);
  const map = mapOf(by);
  const table = range ? Array.from({ length: 256 }, (_, i) => map(i / 255)) : [];
  for (let v = 0; v < mesh.vertexCount; v++) {
    let colour: Rgb = PLAIN;
    if (range) {
      const x = valueAt(mesh, by, v);
      const t = (255 * (x - range.low)) / (range.high - range.low || 1);
      colour = Number.isNaN(x) ? UNMEASURED : table[Math.max(0, Math.min(255, Math.round(t)))];
    } else if (by === "own" && mesh.colour && 3 * v < mesh.colour.length) {
      colour = [mesh.colour[3 * v], mesh.colour[3 * v + 1], mesh.colour[3 * v + 2]];
    } else if (by === "shapes") {
      const shape = mesh.shapes?.[v] ?? -1;
      if (shape >= 0) colour = DISTINCT[shape % DISTINCT.length];
    } else if (by === "edits") {
      colour = TOUCHES[mesh.touch?.[v] ?? 0]?.[0] ?? PLAIN;
    } else if (by === "laser") {
      colour = mesh.laser[v] < 0 ? UNMEASURED : DISTINCT[mesh.laser[v] % DISTINCT.length];
    }
    rgba[4 * v] = colour[0];
    rgba[4 * v + 1] = colour[1];
    rgba[4 * v + 2] = colour[2];
  }
  return { rgba, legend: range };
}

function valueAt(mesh: MeshModel, by: Colouring, v: number): number {
  if (by === "height") return mesh.positions[3 * v + 2];
  // Of vertices that came later nothing is known yet.
  return (by === "sigma" ? (mesh.quality ?? mesh.sigma)[v] : mesh.deviation?.[v]) ?? Number.NaN;
}

function rangeOf(mesh: MeshModel, by: Colouring): Legend | null {
  if (by === "sigma" || by === "height") return spread(mesh, by);
  if (by !== "deviation" || !mesh.deviation) return null;
  // The same on both sides of no deviation; what is less than a micrometre has no colour.
  const { low, high } = spread(mesh, by);
  const end = Math.max(mesh.deviationEnd ?? Math.max(Math.abs(low), Math.abs(high)), LEAST);
  return { low: -end, high: end, unit: "mm" };
}

/** From the 2nd to the 98th hundredth, so that a few odd vertices do not take the whole map. */
function spread(mesh: MeshModel, by: "sigma" | "height" | "deviation"): Legend {
  const every = Math.max(1, Math.floor(mesh.vertexCount / 20000));
  const some: number[] = [];
  for (let v = 0; v < mesh.vertexCount; v += every) {
    const x = valueAt(mesh, by, v);
    if (!Number.isNaN(x)) some.push(x);
  }
  some.sort((a, b) => a - b);
  if (!some.length) return { low: 0, high: 1, unit: "mm" };
  const at = (share: number) => some[Math.round(share * (some.length - 1))];
  const [low, middle, high] = [at(0.02), at(0.5), at(0.98)];
  if (by !== "sigma") return { low, high, unit: "mm" };
  return { low: Math.min(low, middle / ALIKE), high: Math.max(high, middle * ALIKE), unit: "mm" };
}
