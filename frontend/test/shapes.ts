import type { MeshArrays } from "../src/mesh/model";

function made(positions: number[], faces: number[]): MeshArrays {
  const v = positions.length / 3;
  return {
    positions: Float32Array.from(positions),
    faces: Uint32Array.from(faces),
    alive: new Uint8Array(faces.length / 3).fill(1),
    measured: new Uint8Array(faces.length / 3).fill(1),
    sigma: new Float32Array(v).fill(0.05),
    laser: new Int32Array(v),
    step: new Int32Array(v),
    line: new Int32Array(v),
  };
}

/** n × n squares of 1 mm, cut in two, at the height that `z` says. */
export function plate(n: number, z: (x: number) => number = () => 0): MeshArrays {
  const positions: number[] = [];
  const faces: number[] = [];
  for (let y = 0; y <= n; y++) for (let x = 0; x <= n; x++) positions.push(x, y, z(x));
  for (let y = 0; y < n; y++) {
    for (let x = 0; x < n; x++) {
      const a = y * (n + 1) + x;
      faces.push(a, a + 1, a + n + 2, a, a + n + 2, a + n + 1);
    }
  }
  return made(positions, faces);
}

/** An open tube of radius 10 mm and height 40 mm, normals outwards. */
export function tube(around: number, up: number): MeshArrays {
  const positions: number[] = [];
  const faces: number[] = [];
  for (let j = 0; j <= up; j++) {
    for (let i = 0; i < around; i++) {
      const angle = (2 * Math.PI * i) / around;
      positions.push(10 * Math.cos(angle), 10 * Math.sin(angle), (40 * j) / up);
    }
  }
  for (let j = 0; j < up; j++) {
    for (let i = 0; i < around; i++) {
      const a = j * around + i;
      const b = j * around + ((i + 1) % around);
      faces.push(a, b, b + around, a, b + around, a + around);
    }
  }
  return made(positions, faces);
}
