/** A region of the screen as a mask of pixels, and the faces that lie under it. */
import type { MeshModel } from "../mesh/model";
import { vertexNormals } from "../mesh/normals";
import type { ViewCamera } from "./camera";

export interface Region {
  x: number;
  y: number;
  width: number;
  height: number;
  /** (height × width) 1 inside */
  mask: Uint8Array;
}

export type Point = readonly [number, number];

/**
 * The inside of a closed outline by the nonzero rule, so that an outline that crosses itself has no
 * slivers left out: per row of pixels, the crossings are sorted and their turns summed.
 */
export function fillOutline(outline: readonly Point[]): Region {
  const xs = outline.map((point) => point[0]);
  const ys = outline.map((point) => point[1]);
  const x = Math.floor(Math.min(...xs));
  const y = Math.floor(Math.min(...ys));
  const width = Math.max(1, Math.ceil(Math.max(...xs)) - x);
  const height = Math.max(1, Math.ceil(Math.max(...ys)) - y);
  const mask = new Uint8Array(width * height);
  for (let row = 0; row < height; row++) {
    const middle = y + row + 0.5;
    const crossings: [number, number][] = [];
    outline.forEach((a, i) => {
      const b = outline[(i + 1) % outline.length];
      if (a[1] <= middle === b[1] <= middle) return;
      const at = a[0] + ((middle - a[1]) / (b[1] - a[1])) * (b[0] - a[0]);
      crossings.push([at - x, b[1] > a[1] ? 1 : -1]);
    });
    crossings.sort((a, b) => a[0] - b[0]);
    let turns = 0;
    crossings.forEach(([from, turn], i) => {
      turns += turn;
      if (turns === 0 || i + 1 === crossings.length) return;
      const first = row * width + Math.max(0, Math.ceil(from - 0.5));
      const last = row * width + Math.min(width, Math.ceil(crossings[i + 1][0] - 0.5));
      if (last > first) mask.fill(1, first, last);
    });
  }
  return { x, y, width, height, mask };
}

/** Linear depth of what is seen, one value per pixel of the drawing buffer; Infinity for none. */
export interface DepthPicture {
  width: number;
  height: number;
  /** Pixels of the picture per CSS pixel. */
  ratio: number;
  /** mm along the view, rows from the bottom, as WebGL reads them back. */
  depth: Float32Array;
}

/** Middles of the faces on the screen: x, y in CSS pixels and depth in mm; NaN for dead faces. */
export class Projection {
  readonly x: Float32Array;
  readonly y: Float32Array;
  readonly depth: Float32Array;

  constructor(
    private readonly mesh: MeshModel,
    private readonly camera: ViewCamera,
  ) {
    const n = mesh.faceCount;
    this.x = new Float32Array(n);
    this.y = new Float32Array(n);
    this.depth = new Float32Array(n);
    const project = camera.projector();
    const at = new Float64Array(3);
    const p = mesh.positions;
    for (let face = 0; face < n; face++) {
      if (!mesh.alive[face]) {
        this.x[face] = NaN;
        continue;
      }
      const a = 3 * mesh.faces[3 * face];
      const b = 3 * mesh.faces[3 * face + 1];
      const c = 3 * mesh.faces[3 * face + 2];
      project((p[a] + p[b] + p[c]) / 3, (p[a + 1] + p[b + 1] + p[c + 1]) / 3, (p[a + 2] + p[b + 2] + p[c + 2]) / 3, at);
      this.x[face] = at[0];
      this.y[face] = at[1];
      this.depth[face] = at[2];
    }
  }

  /** Faces whose middle lies in the region; only those that are seen when a depth picture is given. */
  inside(region: Region, seen: DepthPicture | null): number[] {
    const out: number[] = [];
    for (let face = 0; face < this.x.length; face++) {
      const column = Math.floor(this.x[face] - region.x);
      const row = Math.floor(this.y[face] - region.y);
      if (!(column >= 0 && row >= 0 && column < region.width && row < region.height)) continue;
      if (!region.mask[row * region.width + column] || this.depth[face] <= 0) continue;
      if (!seen || this.isSeen(face, seen)) out.push(face);
    }
    return out;
  }

  /** Faces whose middle lies in a circle; the mask of a brush would only repeat this. */
  within(x: number, y: number, radius: number, seen: DepthPicture | null): number[] {
    const out: number[] = [];
    for (let face = 0; face < this.x.length; face++) {
      const dx = this.x[face] - x;
      const dy = this.y[face] - y;
      if (!(dx * dx + dy * dy <= radius * radius) || this.depth[face] <= 0) continue;
      if (!seen || this.isSeen(face, seen)) out.push(face);
    }
    return out;
  }

  /**
   * True for a face at the depth of one of its 3 × 3 pixels. What looks away from the eye is not
   * seen there, but a face that noise has tilted is, where the surface about it looks at the eye.
   */
  private isSeen(face: number, seen: DepthPicture): boolean {
    if (!this.looksAtEye(face) && !this.smoothLooksAtEye(face)) return false;
    const column = Math.floor(this.x[face] * seen.ratio);
    const row = seen.height - 1 - Math.floor(this.y[face] * seen.ratio);
    // A pixel's slack: a steep face spans this much depth between two pixels' middles.
    const slack = 0.4 + 2 * this.camera.scale();
    for (let r = Math.max(0, row - 1); r <= Math.min(seen.height - 1, row + 1); r++) {
      for (let c = Math.max(0, column - 1); c <= Math.min(seen.width - 1, column + 1); c++) {
        if (this.depth[face] <= seen.depth[r * seen.width + c] + slack) return true;
      }
    }
    return false;
  }

  private readonly normal = new Float64Array(3);
  private normals: Int8Array | null = null;

  looksAtEye(face: number): boolean {
    this.mesh.faceNormal(face, this.normal);
    return this.facesEye(face);
  }

  /** Whether the mean of the normals at the face's corners looks at the eye. */
  private smoothLooksAtEye(face: number): boolean {
    this.normals ??= vertexNormals(this.mesh);
    this.normal.fill(0);
    for (let corner = 0; corner < 3; corner++) {
      const at = 4 * this.mesh.faces[3 * face + corner];
      for (let axis = 0; axis < 3; axis++) this.normal[axis] += this.normals[at + axis];
    }
    return this.facesEye(face);
  }

  private facesEye(face: number): boolean {
    const n = this.normal;
    if (this.camera.orthographic) {
      const f = this.camera.axes()[2];
      return n[0] * f[0] + n[1] * f[1] + n[2] * f[2] < 0;
    }
    const e = this.camera.eye();
    const at = 3 * this.mesh.faces[3 * face];
    const p = this.mesh.positions;
    return n[0] * (p[at] - e[0]) + n[1] * (p[at + 1] - e[1]) + n[2] * (p[at + 2] - e[2]) < 0;
  }
}
