/** How well points that belong together fit when one set is moved onto the other. */
import type { Vec } from "../viewport/camera";

type Square = number[][];

/** The eigenvector of the largest eigenvalue of a symmetric matrix: Jacobi's rotations. */
function strongest(matrix: Square): number[] {
  const n = matrix.length;
  const a = matrix.map((row) => [...row]);
  const v: Square = a.map((_, i) => a.map((__, j) => Number(i === j)));
  for (let sweep = 0; sweep < 30; sweep++) {
    for (let p = 0; p < n; p++) {
      for (let q = p + 1; q < n; q++) {
        if (a[p][q] === 0) continue;
        const angle = 0.5 * Math.atan2(2 * a[p][q], a[q][q] - a[p][p]);
        const c = Math.cos(angle);
        const s = Math.sin(angle);
        for (let k = 0; k < n; k++) [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
        for (let k = 0; k < n; k++) [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
        for (let k = 0; k < n; k++) [v[k][p], v[k][q]] = [c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]];
      }
    }
  }
  const best = a.reduce((at, row, i) => (row[i] > a[at][at] ? i : at), 0);
  return v.map((row) => row[best]);
}

/** The rotation (3, 3) that brings centred points onto others best: Horn 1987, by quaternions. */
function rotation(from: readonly Vec[], to: readonly Vec[]): Square {
  const s = [0, 1, 2].map((i) => [0, 1, 2].map((j) => from.reduce((sum, p, k) => sum + p[i] * to[k][j], 0)));
  const [[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]] = s;
  const [w, x, y, z] = strongest([
    [xx + yy + zz, yz - zy, zx - xz, xy - yx],
    [yz - zy, xx - yy - zz, xy + yx, zx + xz],
    [zx - xz, xy + yx, yy - xx - zz, yz + zy],
    [xy - yx, zx + xz, yz + zy, zz - xx - yy],
  ]);
  return [
    [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
    [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
    [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
  ];
}

function centred(points: readonly Vec[]): Vec[] {
  const middle = [0, 1, 2].map((i) => points.reduce((sum, p) => sum + p[i], 0) / points.length);
  return points.map((p) => p.map((x, i) => x - middle[i]) as Vec);
}

/** mm: how far each point stays off its partner after the best rigid move of all of them. */
export function residuals(from: readonly Vec[], to: readonly Vec[]): number[] {
  const [a, b] = [centred(from), centred(to)];
  const turn = rotation(a, b);
  return a.map((p, k) => Math.hypot(...turn.map((row, i) => row[0] * p[0] + row[1] * p[1] + row[2] * p[2] - b[k][i])));
}
