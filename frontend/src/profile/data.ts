/** One stripe as the server tells it: where it is in the picture, and where else it could be. */
import type { Arrays } from "../envelope";
import type { ProfileHeader } from "../protocol";

export interface Candidate {
  position: number;
  amplitude: number;
  chosen: boolean;
  point: [number, number, number] | null;
}

export class Profile {
  readonly grid: number;
  readonly step: number;
  readonly lines: number;
  readonly most: number;
  readonly position: Float32Array;
  readonly candidates: Float32Array;
  readonly amplitude: Float32Array;
  readonly points: Float32Array;
  readonly chosen: Int8Array;

  constructor(
    readonly header: ProfileHeader,
    arrays: Arrays,
  ) {
    this.grid = header.grid;
    this.step = header.step;
    this.position = arrays.f32("position");
    this.candidates = arrays.f32("candidates");
    this.amplitude = arrays.f32("candidate_amplitude");
    this.points = arrays.f32("candidate_points");
    this.chosen = arrays.i8("chosen");
    [this.lines, this.most] = arrays.shape("candidates");
  }

  of(line: number): Candidate[] {
    const out: Candidate[] = [];
    for (let k = 0; k < this.most; k++) {
      const at = line * this.most + k;
      const position = this.candidates[at];
      if (Number.isNaN(position) || position === undefined) continue;
      const x = this.points[3 * at];
      out.push({
        position,
        amplitude: this.amplitude[at],
        chosen: this.chosen[line] === k,
        point: Number.isNaN(x) ? null : [x, this.points[3 * at + 1], this.points[3 * at + 2]],
      });
    }
    return out;
  }

  /** Pixel (u, v) of a place on a line. */
  pixel(line: number, position: number): [number, number] {
    return this.header.orientation === "vertical" ? [position, line] : [line, position];
  }
}
