import type { MeshModel } from "./model";

/** Normals of the vertices, weighted by the area of the faces that are there; (4v) in −127…127, padded. */
export function vertexNormals(mesh: MeshModel): Int8Array {
  const out = new Int8Array(4 * mesh.vertexCount);
  putNormals(mesh, out, null);
  return out;
}

/** The same for the marked vertices alone (v), put into `out`: after faces at them have gone or come. */
export function putNormals(mesh: MeshModel, out: Int8Array, marks: Uint8Array | null): void {
  const { faces } = mesh;
  const sums = new Float32Array(3 * mesh.vertexCount);
  const n = new Float64Array(3);
  for (let face = 0; face < mesh.faceCount; face++) {
    if (!mesh.alive[face]) continue;
    const at = 3 * face;
    if (marks && !(marks[faces[at]] | marks[faces[at + 1]] | marks[faces[at + 2]])) continue;
    mesh.faceNormal(face, n);
    for (let corner = 0; corner < 3; corner++) {
      const to = 3 * faces[at + corner];
      sums[to] += n[0];
      sums[to + 1] += n[1];
      sums[to + 2] += n[2];
    }
  }
  for (let v = 0; v < mesh.vertexCount; v++) {
    if (marks && !marks[v]) continue;
    const x = sums[3 * v];
    const y = sums[3 * v + 1];
    const z = sums[3 * v + 2];
    const scale = 127 / (Math.hypot(x, y, z) || 1);
    out[4 * v] = x * scale;
    out[4 * v + 1] = y * scale;
    out[4 * v + 2] = z * scale;
  }
}
