/** The mesh as the server numbers it: faces keep their numbers for ever within an epoch. */

export interface MeshArrays {
  /** (v, 3) mm */
  positions: Float32Array;
  /** (f, 3) vertex numbers, of dead faces too */
  faces: Uint32Array;
  /** (f) 0 for a face that was deleted */
  alive: Uint8Array;
  /** (f) 0 for a face that closes a gap */
  measured: Uint8Array;
  /** (v) mm, NaN where not measured */
  sigma: Float32Array;
  /** (v) index into the names of the lasers, −1 where not measured */
  laser: Int32Array;
  /** (v) step number, −1 where not measured */
  step: Int32Array;
  /** (v) image line, −1 where not measured */
  line: Int32Array;
}

export type Added = Omit<MeshArrays, "alive">;

/** One part of a patch. */
export type Part =
  | { kind: "alive"; faces: Uint32Array; value: boolean }
  | { kind: "verts"; ids: Uint32Array; positions: Float32Array }
  | ({ kind: "append" } & Added)
  | { kind: "truncate"; vertices: number; faces: number };

export interface Bounds {
  low: [number, number, number];
  high: [number, number, number];
}

/** A surface of which nothing but its shape is known. */
export function plainMesh(positions: Float32Array, faces: Uint32Array, deviation: Float32Array | null): MeshModel {
  const vertices = positions.length / 3;
  const none = new Int32Array(vertices).fill(-1);
  const model = new MeshModel({
    positions,
    faces,
    alive: new Uint8Array(faces.length / 3).fill(1),
    measured: new Uint8Array(faces.length / 3).fill(1),
    sigma: new Float32Array(vertices).fill(Number.NaN),
    laser: none,
    step: none,
    line: none,
  });
  model.deviation = deviation;
  return model;
}

export class MeshModel {
  positions: Float32Array;
  faces: Uint32Array;
  alive: Uint8Array;
  measured: Uint8Array;
  sigma: Float32Array;
  laser: Int32Array;
  step: Int32Array;
  line: Int32Array;
  /** (3v) the colours that the file of a mesh holds, or of the texture images of a scan. */
  colour: Uint8Array | null = null;
  /** (v) mm from a reference, NaN where unknown; null where none was compared with. */
  deviation: Float32Array | null = null;
  /** mm at the ends of the map of deviations; null: as the deviations are. */
  deviationEnd: number | null = null;
  /** (v) index of the shape that a vertex lies on, −1 for none; null where none were sought. */
  shapes: Int32Array | null = null;
  /** (v) mm, sigma of the region about a vertex, NaN where unknown; null where it is not fetched. */
  quality: Float32Array | null = null;
  /** (v) what was done by hand at a vertex, see `TOUCHES`; null where it is not known yet. */
  touch: Uint8Array | null = null;
  vertexCount: number;
  faceCount: number;
  aliveCount: number;
  /** Counts every change of shape, so that what was derived knows when it is old. */
  version = 0;
  /** Counts appends and truncations: which faces touch depends on these alone. */
  topology = 0;

  constructor(arrays: MeshArrays) {
    this.positions = arrays.positions;
    this.faces = arrays.faces;
    this.alive = arrays.alive;
    this.measured = arrays.measured;
    this.sigma = arrays.sigma;
    this.laser = arrays.laser;
    this.step = arrays.step;
    this.line = arrays.line;
    this.vertexCount = arrays.positions.length / 3;
    this.faceCount = arrays.faces.length / 3;
    this.aliveCount = arrays.alive.reduce((sum, one) => sum + one, 0);
  }

  /** Whether another one has the same vertices and faces, by the same numbers. */
  equals(other: MeshModel): boolean {
    if (this.vertexCount !== other.vertexCount || this.faceCount !== other.faceCount) return false;
    const { vertexCount: v, faceCount: f } = this;
    const pairs = [
      [this.faces, other.faces, 3 * f],
      [this.positions, other.positions, 3 * v],
      [this.alive, other.alive, f],
      [this.measured, other.measured, f],
    ] as const;
    return pairs.every(([a, b, n]) => {
      for (let i = 0; i < n; i++) if (a[i] !== b[i]) return false;
      return true;
    });
  }

  apply(part: Part): void {
    this.version += 1;
    switch (part.kind) {
      case "alive":
        for (const face of part.faces) {
          this.aliveCount += Number(part.value) - this.alive[face];
          this.alive[face] = Number(part.value);
        }
        break;
      case "verts":
        part.ids.forEach((id, i) => {
          this.positions.set(part.positions.subarray(3 * i, 3 * i + 3), 3 * id);
        });
        break;
      case "append":
        this.append(part);
        break;
      case "truncate":
        for (let face = part.faces; face < this.faceCount; face++) this.aliveCount -= this.alive[face];
        this.vertexCount = part.vertices;
        this.faceCount = part.faces;
        this.topology += 1;
        break;
    }
  }

  private append(more: Added): void {
    const v = this.vertexCount;
    const f = this.faceCount;
    const moreFaces = more.faces.length / 3;
    this.positions = put(this.positions, 3 * v, more.positions);
    this.sigma = put(this.sigma, v, more.sigma);
    this.laser = put(this.laser, v, more.laser);
    this.step = put(this.step, v, more.step);
    this.line = put(this.line, v, more.line);
    this.faces = put(this.faces, 3 * f, more.faces);
    this.measured = put(this.measured, f, more.measured);
    this.alive = put(this.alive, f, new Uint8Array(moreFaces).fill(1));
    this.vertexCount = v + more.positions.length / 3;
    this.faceCount = f + moreFaces;
    this.aliveCount += moreFaces;
    this.topology += 1;
  }

  private boundsKept: { version: number; box: Bounds | null } | null = null;

  /** The box around the faces that are there, or some of them; null for an empty mesh. */
  bounds(only?: Uint8Array): Bounds | null {
    if (only) return this.boxOf(only);
    if (this.boundsKept?.version !== this.version) this.boundsKept = { version: this.version, box: this.boxOf() };
    const { box } = this.boundsKept;
    return box && { low: [...box.low], high: [...box.high] };
  }

  private boxOf(only?: Uint8Array): Bounds | null {
    const { positions: p, faces } = this;
    let [x0, y0, z0] = [Infinity, Infinity, Infinity];
    let [x1, y1, z1] = [-Infinity, -Infinity, -Infinity];
    for (let face = 0; face < this.faceCount; face++) {
      if (!this.alive[face] || (only && !only[face])) continue;
      for (let i = 3 * face; i < 3 * face + 3; i++) {
        const at = 3 * faces[i];
        const [x, y, z] = [p[at], p[at + 1], p[at + 2]];
        if (x < x0) x0 = x;
        if (x > x1) x1 = x;
        if (y < y0) y0 = y;
        if (y > y1) y1 = y;
        if (z < z0) z0 = z;
        if (z > z1) z1 = z;
      }
    }
    return x0 <= x1 ? { low: [x0, y0, z0], high: [x1, y1, z1] } : null;
  }

  /** The normal of a face (not of length 1), written into `out`. */
  faceNormal(face: number, out: Float64Array): void {
    const p = this.positions;
    const a = 3 * this.faces[3 * face];
    const b = 3 * this.faces[3 * face + 1];
    const c = 3 * this.faces[3 * face + 2];
    const ux = p[b] - p[a];
    const uy = p[b + 1] - p[a + 1];
    const uz = p[b + 2] - p[a + 2];
    const vx = p[c] - p[a];
    const vy = p[c + 1] - p[a + 1];
    const vz = p[c + 2] - p[a + 2];
    out[0] = uy * vz - uz * vy;
    out[1] = uz * vx - ux * vz;
    out[2] = ux * vy - uy * vx;
  }
}

type Numbers = Float32Array | Uint32Array | Int32Array | Uint8Array;

/** Put `more` at `at`, in a larger array when the room does not suffice. */
function put<T extends Numbers>(array: T, at: number, more: T): T {
  const need = at + more.length;
  let room = array;
  if (need > array.length) {
    const Kind = array.constructor as new (length: number) => T;
    room = new Kind(Math.ceil(need * 1.25));
    room.set(array.subarray(0, at) as never);
  }
  room.set(more as never, at);
  return room;
}
