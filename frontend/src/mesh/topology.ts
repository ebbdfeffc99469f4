/** Which faces touch: grow, shrink, connected pieces, regions up to a crease. */
import type { MeshModel } from "./model";

export class Topology {
  private readonly start: Uint32Array;
  private readonly list: Uint32Array;
  readonly version: number;

  constructor(private readonly mesh: MeshModel) {
    this.version = mesh.topology;
    const start = new Uint32Array(mesh.vertexCount + 1);
    const corners = 3 * mesh.faceCount;
    for (let i = 0; i < corners; i++) start[mesh.faces[i] + 1]++;
    for (let v = 0; v < mesh.vertexCount; v++) start[v + 1] += start[v];
    const next = start.slice(0, mesh.vertexCount);
    const list = new Uint32Array(corners);
    for (let i = 0; i < corners; i++) list[next[mesh.faces[i]]++] = Math.floor(i / 3);
    this.start = start;
    this.list = list;
  }

  /** Calls `visit` for every living face that shares a corner with `face`. */
  private around(face: number, visit: (other: number) => void): void {
    for (let corner = 0; corner < 3; corner++) {
      const v = this.mesh.faces[3 * face + corner];
      for (let i = this.start[v]; i < this.start[v + 1]; i++) {
        if (this.mesh.alive[this.list[i]]) visit(this.list[i]);
      }
    }
  }

  grow(selected: Uint8Array): Uint8Array {
    const out = selected.slice();
    for (let face = 0; face < this.mesh.faceCount; face++) {
      if (selected[face]) this.around(face, (other) => (out[other] = 1));
    }
    return out;
  }

  shrink(selected: Uint8Array): Uint8Array {
    const out = selected.slice();
    for (let face = 0; face < this.mesh.faceCount; face++) {
      if (!selected[face]) continue;
      this.around(face, (other) => {
        if (!selected[other]) out[face] = 0;
      });
    }
    return out;
  }

  /** All faces that can be reached from the seeds. */
  connected(seeds: Iterable<number>): Uint8Array {
    return this.flood(seeds, () => true);
  }

  /** All faces that can be reached from the seeds without an edge sharper than `angle` radians. */
  smooth(seeds: Iterable<number>, angle: number): Uint8Array {
    const limit = Math.cos(angle);
    const a = new Float64Array(3);
    const b = new Float64Array(3);
    return this.flood(seeds, (from, to) => {
      this.mesh.faceNormal(from, a);
      this.mesh.faceNormal(to, b);
      const dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
      return dot >= limit * Math.hypot(a[0], a[1], a[2]) * Math.hypot(b[0], b[1], b[2]);
    });
  }

  private flood(seeds: Iterable<number>, may: (from: number, to: number) => boolean): Uint8Array {
    const out = new Uint8Array(this.mesh.faceCount);
    const stack: number[] = [];
    for (const seed of seeds) {
      if (this.mesh.alive[seed] && !out[seed]) {
        out[seed] = 1;
        stack.push(seed);
      }
    }
    for (let face = stack.pop(); face !== undefined; face = stack.pop()) {
      const from = face;
      this.around(from, (to) => {
        if (out[to] || !may(from, to)) return;
        out[to] = 1;
        stack.push(to);
      });
    }
    return out;
  }
}

/** Mark (v) the vertices that belong to some faces. */
export function markVertices(mesh: MeshModel, faces: Uint32Array, marks: Uint8Array): void {
  for (const face of faces) for (let corner = 0; corner < 3; corner++) marks[mesh.faces[3 * face + corner]] = 1;
}

/**
 * The borders after faces have gone or come whose vertices are marked (v), from those before: only
 * edges between marked vertices can have become a border, or be none any more.
 */
export function bordersAfter(mesh: MeshModel, before: Uint32Array, marks: Uint8Array): Uint32Array {
  const kept: number[] = [];
  for (let i = 0; i < before.length; i += 2) {
    if (!(marks[before[i]] & marks[before[i + 1]])) kept.push(before[i], before[i + 1]);
  }
  const found = borderEdges(mesh, marks);
  const out = new Uint32Array(kept.length + found.length);
  out.set(kept);
  out.set(found, kept.length);
  return out;
}

/**
 * Segments (pairs of vertex numbers) of the borders of the surface: edges of one living face; with
 * `marks` (v) those between marked vertices.
 */
export function borderEdges(mesh: MeshModel, marks: Uint8Array | null = null): Uint32Array {
  // Every vertex keeps a chain of the edges that leave it towards a higher number; an edge met
  // twice is struck out. Linear in the number of faces, without a hash.
  const head = new Int32Array(mesh.vertexCount).fill(-1);
  const next = new Int32Array(3 * mesh.faceCount);
  const other = new Uint32Array(3 * mesh.faceCount);
  const count = new Uint8Array(3 * mesh.faceCount);
  let used = 0;
  for (let face = 0; face < mesh.faceCount; face++) {
    if (!mesh.alive[face]) continue;
    for (let corner = 0; corner < 3; corner++) {
      const a = mesh.faces[3 * face + corner];
      const b = mesh.faces[3 * face + ((corner + 1) % 3)];
      if (marks && !(marks[a] & marks[b])) continue;
      const low = Math.min(a, b);
      const high = Math.max(a, b);
      let at = head[low];
      while (at >= 0 && other[at] !== high) at = next[at];
      if (at >= 0) {
        count[at] = 2;
      } else {
        other[used] = high;
        count[used] = 1;
        next[used] = head[low];
        head[low] = used++;
      }
    }
  }
  const out: number[] = [];
  for (let v = 0; v < mesh.vertexCount; v++) {
    for (let at = head[v]; at >= 0; at = next[at]) if (count[at] === 1) out.push(v, other[at]);
  }
  return Uint32Array.from(out);
}
