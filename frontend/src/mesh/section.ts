/** Where a plane meets the surface. */
import type { MeshModel } from "./model";

type Vec = readonly [number, number, number];

/**
 * The outline of the living faces in a plane: (6n) mm, two ends for each face that it crosses.
 * A vertex in the plane counts as above it, so that every crossed face has exactly one piece.
 */
export function outline(mesh: MeshModel, normal: Vec, offset: number): Float32Array {
  const { positions, faces, alive, faceCount, vertexCount } = mesh;
  const above = new Float32Array(vertexCount);
  for (let v = 0; v < vertexCount; v++) {
    const at = 3 * v;
    above[v] = normal[0] * positions[at] + normal[1] * positions[at + 1] + normal[2] * positions[at + 2] - offset;
  }
  const out: number[] = [];
  for (let face = 0; face < faceCount; face++) {
    if (!alive[face]) continue;
    const a = faces[3 * face];
    const b = faces[3 * face + 1];
    const c = faces[3 * face + 2];
    const up = above[a] >= 0;
    if (up === above[b] >= 0 && up === above[c] >= 0) continue;
    // The one vertex that is alone on its side, and the two edges from it.
    const [p, q, r] = up === above[b] >= 0 ? [c, a, b] : up === above[c] >= 0 ? [b, c, a] : [a, b, c];
    for (const other of [q, r]) {
      const t = above[p] / (above[p] - above[other]);
      for (let k = 0; k < 3; k++) {
        const from = positions[3 * p + k];
        out.push(from + t * (positions[3 * other + k] - from));
      }
    }
  }
  return Float32Array.from(out);
}

/** mm: the length of an outline. */
export function lengthOf(pieces: Float32Array): number {
  let sum = 0;
  for (let i = 0; i < pieces.length; i += 6) {
    sum += Math.hypot(pieces[i + 3] - pieces[i], pieces[i + 4] - pieces[i + 1], pieces[i + 5] - pieces[i + 2]);
  }
  return sum;
}
