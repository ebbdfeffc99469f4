import type { MeshModel } from "./model";

/** Normals of the vertices, weighted by the area of the faces that are there; (4v) in −127…127, padded. */
export function vertexNormals(mesh: MeshModel): Int8Array {
  const sums = new Float32Array(3 * mesh.vertexCount);
  const n = new Float64Array(3);
  for (let face = 0; face < mesh.faceCount; face++) {
    if (!mesh.alive[face]) continue;
    mesh.faceNormal(face, n);
    for (let corner = 0; corner < 3; corner++) {
      const at = 3 * mesh.faces[3 * face + corner];
      sums[at] += n[0];
      sums[at + 1] += n[1];
      sums[at + 2] += n[2];
    }
  }
  const out = new Int8Array(4 * mesh.vertexCount);
  for (let v = 0; v < mesh.vertexCount; v++) {
    const x = sums[3 * v];
    const y = sums[3 * v + 1];
    const z = sums[3 * v + 2];
    const scale = 127 / (Math.hypot(x, y, z) || 1);
    out[4 * v] = x * scale;
    out[4 * v + 1] = y * scale;
    out[4 * v + 2] = z * scale;
  }
  return out;
}
