/** A coarse mesh to turn while the full one is too slow to draw. */
import type { MeshModel } from "./model";

export interface StandIn {
  index: Uint32Array;
  faces: number;
}

/**
 * Vertices of one cube of space become one of them (vertex clustering, Rossignac & Borrel 1993);
 * faces that collapse go. The stand-in uses the vertices of the mesh, so it needs no buffer of its
 * own but the index, and it is made of the living faces, so nothing deleted comes back.
 */
export function standIn(mesh: MeshModel, wanted: number): StandIn {
  const box = mesh.bounds();
  if (!box) return { index: new Uint32Array(0), faces: 0 };
  const size = [0, 1, 2].map((axis) => box.high[axis] - box.low[axis]);
  // A surface of area A cut into cubes of side h keeps about 2 A / h² triangles.
  const area = 2 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0]);
  const cell = Math.max(Math.sqrt((2 * area) / wanted), 1e-6);
  const nx = Math.ceil(size[0] / cell) + 1;
  const ny = Math.ceil(size[1] / cell) + 1;
  const first = new Map<number, number>();
  const of = new Uint32Array(mesh.vertexCount);
  for (let v = 0; v < mesh.vertexCount; v++) {
    const x = Math.floor((mesh.positions[3 * v] - box.low[0]) / cell);
    const y = Math.floor((mesh.positions[3 * v + 1] - box.low[1]) / cell);
    const z = Math.floor((mesh.positions[3 * v + 2] - box.low[2]) / cell);
    const key = x + nx * (y + ny * z);
    const known = first.get(key);
    if (known === undefined) first.set(key, v);
    of[v] = known ?? v;
  }
  const index = new Uint32Array(3 * mesh.aliveCount);
  let n = 0;
  for (let face = 0; face < mesh.faceCount; face++) {
    if (!mesh.alive[face]) continue;
    const a = of[mesh.faces[3 * face]];
    const b = of[mesh.faces[3 * face + 1]];
    const c = of[mesh.faces[3 * face + 2]];
    if (a === b || b === c || c === a) continue;
    index[n] = a;
    index[n + 1] = b;
    index[n + 2] = c;
    n += 3;
  }
  return { index: index.slice(0, n), faces: n / 3 };
}
