/** A range grid as the server tells it: steps × lines of points, and why some are missing. */
import type { Arrays } from "../envelope";
import type { GridHeader } from "../protocol";

export const FLAGS = [
  [1, "dark"],
  [2, "outside"],
  [4, "ambiguous"],
  [8, "saturated"],
  [16, "stray light"],
  [32, "edge"],
  [64, "several candidates"],
  [128, "grazing"],
] as const;

export class Grid {
  readonly steps: Int32Array;
  readonly angles: Float32Array;
  readonly points: Float32Array;
  readonly sigma: Float32Array;
  readonly amplitude: Float32Array;
  readonly flags: Uint16Array;
  readonly cause: Uint8Array;
  readonly edited: Uint8Array;
  readonly off: Uint8Array;
  readonly lines: number;

  constructor(
    readonly header: GridHeader,
    arrays: Arrays,
  ) {
    this.steps = arrays.i32("steps");
    this.angles = arrays.f32("angles");
    this.points = arrays.f32("points");
    this.sigma = arrays.f32("sigma");
    this.amplitude = arrays.f32("amplitude");
    this.flags = arrays.u16("flags");
    this.cause = arrays.u8("cause");
    this.edited = arrays.u8("edited");
    this.off = arrays.u8("off");
    this.lines = arrays.shape("points")[1];
  }

  row(step: number): number {
    return this.steps.indexOf(step);
  }

  point(row: number, line: number): [number, number, number] | null {
    const at = 3 * (row * this.lines + line);
    const x = this.points[at];
    return Number.isNaN(x) || x === undefined ? null : [x, this.points[at + 1], this.points[at + 2]];
  }

  /** The same grid with the rows of another one in place of its own. */
  withRows(other: Grid): Grid {
    const next: Grid = Object.assign(Object.create(Grid.prototype), this, {
      points: this.points.slice(),
      sigma: this.sigma.slice(),
      amplitude: this.amplitude.slice(),
      flags: this.flags.slice(),
      cause: this.cause.slice(),
      edited: this.edited.slice(),
      off: this.off.slice(),
    });
    other.steps.forEach((step, from) => {
      const to = this.row(step);
      if (to < 0) return;
      const n = this.lines;
      next.points.set(other.points.subarray(3 * from * n, 3 * (from + 1) * n), 3 * to * n);
      for (const name of ["sigma", "amplitude", "flags", "cause", "edited"] as const) {
        next[name].set(other[name].subarray(from * n, (from + 1) * n), to * n);
      }
      next.off[to] = other.off[from];
    });
    return next;
  }
}

export function flagWords(flags: number): string {
  return FLAGS.filter(([bit]) => flags & bit)
    .map(([, word]) => word)
    .join(", ");
}
