/** Which face a ray meets first. */
import type { MeshModel } from "../mesh/model";
import type { Ray, Vec } from "./camera";

export interface Hit {
  face: number;
  /** The corner of the face nearest to the point. */
  vertex: number;
  point: Vec;
  distance: number;
}

/**
 * Möller & Trumbore 1997 over all living faces, from both sides: 200 000 take a few milliseconds,
 * which a click may cost, so no tree has to be built and kept in step with the edits.
 */
export function pick(mesh: MeshModel, ray: Ray): Hit | null {
  const p = mesh.positions;
  const f = mesh.faces;
  const [ox, oy, oz] = ray.origin;
  const [dx, dy, dz] = ray.direction;
  let best = Infinity;
  let face = -1;
  for (let i = 0, n = mesh.faceCount; i < n; i++) {
    if (!mesh.alive[i]) continue;
    const a = 3 * f[3 * i];
    const b = 3 * f[3 * i + 1];
    const c = 3 * f[3 * i + 2];
    const ax = p[a];
    const ay = p[a + 1];
    const az = p[a + 2];
    const ux = p[b] - ax;
    const uy = p[b + 1] - ay;
    const uz = p[b + 2] - az;
    const vx = p[c] - ax;
    const vy = p[c + 1] - ay;
    const vz = p[c + 2] - az;
    const hx = dy * vz - dz * vy;
    const hy = dz * vx - dx * vz;
    const hz = dx * vy - dy * vx;
    const det = ux * hx + uy * hy + uz * hz;
    if (det === 0) continue;
    const sx = ox - ax;
    const sy = oy - ay;
    const sz = oz - az;
    const s = (sx * hx + sy * hy + sz * hz) / det;
    if (s < 0 || s > 1) continue;
    const qx = sy * uz - sz * uy;
    const qy = sz * ux - sx * uz;
    const qz = sx * uy - sy * ux;
    const t = (dx * qx + dy * qy + dz * qz) / det;
    if (t < 0 || s + t > 1) continue;
    const distance = (vx * qx + vy * qy + vz * qz) / det;
    if (distance > 0 && distance < best) {
      best = distance;
      face = i;
    }
  }
  if (face < 0) return null;
  const point: Vec = [ox + dx * best, oy + dy * best, oz + dz * best];
  return { face, vertex: nearestCorner(mesh, face, point), point, distance: best };
}

function nearestCorner(mesh: MeshModel, face: number, point: Vec): number {
  let best = Infinity;
  let nearest = 0;
  for (let corner = 0; corner < 3; corner++) {
    const v = mesh.faces[3 * face + corner];
    const d = Math.hypot(
      mesh.positions[3 * v] - point[0],
      mesh.positions[3 * v + 1] - point[1],
      mesh.positions[3 * v + 2] - point[2],
    );
    if (d < best) {
      best = d;
      nearest = v;
    }
  }
  return nearest;
}
