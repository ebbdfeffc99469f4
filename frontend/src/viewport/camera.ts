/** Where the eye is: turns about the vertical z axis, never rolls. Millimetres and CSS pixels. */
import type { Bounds } from "../mesh/model";

export type Vec = [number, number, number];

export interface Ray {
  origin: Vec;
  direction: Vec;
}

export const VIEWS = {
  front: [-90, 0],
  back: [90, 0],
  left: [180, 0],
  right: [0, 0],
  top: [-90, 90],
  bottom: [-90, -90],
  corner: [-60, 25],
} as const satisfies Record<string, readonly [number, number]>;
export type ViewName = keyof typeof VIEWS;

const FIELD = (30 * Math.PI) / 180;
const DEGREE = Math.PI / 180;

export class ViewCamera {
  target: Vec = [0, 0, 40];
  distance = 300;
  azimuth = VIEWS.corner[0] * DEGREE;
  elevation = VIEWS.corner[1] * DEGREE;
  orthographic = false;
  width = 1;
  height = 1;
  /** Counts every change, so that projections know when they are old. */
  version = 0;
  private centre: Vec = [0, 0, 40];
  private radius = 100;

  /** Right, up and forward, unit vectors in the object's frame. */
  axes(): [Vec, Vec, Vec] {
    const sa = Math.sin(this.azimuth);
    const ca = Math.cos(this.azimuth);
    const se = Math.sin(this.elevation);
    const ce = Math.cos(this.elevation);
    return [
      [-sa, ca, 0],
      [-se * ca, -se * sa, ce],
      [-ce * ca, -ce * sa, -se],
    ];
  }

  eye(): Vec {
    const forward = this.axes()[2];
    return along(this.target, forward, -this.distance);
  }

  /** mm on the target's plane that one CSS pixel covers. */
  scale(): number {
    return (2 * this.distance * Math.tan(FIELD / 2)) / this.height;
  }

  private depthRange(): [number, number] {
    const [, , forward] = this.axes();
    const middle = dot(minus(this.centre, this.eye()), forward);
    const far = Math.max(middle + this.radius, this.distance * 0.1);
    const near = middle - this.radius;
    return [this.orthographic ? near : Math.max(near, far * 2e-3), far];
  }

  /** View and projection, column-major, as WebGL takes them. */
  matrices(): { world: number[]; projection: number[]; near: number; far: number } {
    const [r, u, f] = this.axes();
    const e = this.eye();
    const world = [r[0], r[1], r[2], 0, u[0], u[1], u[2], 0, -f[0], -f[1], -f[2], 0, e[0], e[1], e[2], 1];
    const [near, far] = this.depthRange();
    const aspect = this.width / this.height;
    const half = Math.tan(FIELD / 2);
    if (this.orthographic) {
      const h = half * this.distance;
      const depth = far - near;
      const projection = [
        1 / (h * aspect),
        0,
        0,
        0,
        0,
        1 / h,
        0,
        0,
        0,
        0,
        -2 / depth,
        0,
        0,
        0,
        -(far + near) / depth,
        1,
      ];
      return { world, projection, near, far };
    }
    const a = -(far + near) / (far - near);
    const b = (-2 * far * near) / (far - near);
    const projection = [1 / (half * aspect), 0, 0, 0, 0, 1 / half, 0, 0, 0, 0, a, -1, 0, 0, b, 0];
    return { world, projection, near, far };
  }

  /** A function that projects points: x, y in CSS pixels, and the depth along the view in mm. */
  projector(): (x: number, y: number, z: number, out: Float64Array) => void {
    const [r, u, f] = this.axes();
    const e = this.eye();
    const half = this.height / 2 / Math.tan(FIELD / 2);
    const flat = half / this.distance;
    const { orthographic, width, height } = this;
    return (x, y, z, out) => {
      const dx = x - e[0];
      const dy = y - e[1];
      const dz = z - e[2];
      const depth = dx * f[0] + dy * f[1] + dz * f[2];
      const k = orthographic ? flat : half / depth;
      out[0] = width / 2 + k * (dx * r[0] + dy * r[1] + dz * r[2]);
      out[1] = height / 2 - k * (dx * u[0] + dy * u[1] + dz * u[2]);
      out[2] = depth;
    };
  }

  /** The ray through a CSS pixel. */
  ray(x: number, y: number): Ray {
    const [r, u, f] = this.axes();
    const sx = (x - this.width / 2) * this.scale();
    const sy = (this.height / 2 - y) * this.scale();
    const offset: Vec = [r[0] * sx + u[0] * sy, r[1] * sx + u[1] * sy, r[2] * sx + u[2] * sy];
    const eye = this.eye();
    if (this.orthographic) return { origin: along(eye, offset, 1), direction: f };
    const d = along(offset, f, this.distance);
    const length = Math.hypot(...d);
    return { origin: eye, direction: [d[0] / length, d[1] / length, d[2] / length] };
  }

  resize(width: number, height: number): void {
    this.width = Math.max(width, 1);
    this.height = Math.max(height, 1);
    this.version += 1;
  }

  /** Turn by pixels about a point that stays where it is on the screen. */
  orbit(dx: number, dy: number, pivot: Vec = this.target): void {
    const before = this.axes();
    const offset = minus(this.target, pivot);
    const local = before.map((axis) => dot(axis, offset));
    this.azimuth -= (dx * Math.PI) / Math.max(this.height, 300);
    const tilt = this.elevation + (dy * Math.PI) / Math.max(this.height, 300);
    this.elevation = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, tilt));
    const after = this.axes();
    this.target = [0, 1, 2].map(
      (i) => pivot[i] + local[0] * after[0][i] + local[1] * after[1][i] + local[2] * after[2][i],
    ) as Vec;
    this.version += 1;
  }

  pan(dx: number, dy: number): void {
    const [r, u] = this.axes();
    const k = this.scale();
    this.target = along(along(this.target, r, -dx * k), u, dy * k);
    this.version += 1;
  }

  /** Come nearer by a factor; the point under the cursor stays under the cursor. */
  zoom(factor: number, x = this.width / 2, y = this.height / 2): void {
    const [r, u] = this.axes();
    const before = this.scale();
    this.distance = Math.max(this.radius * 1e-3, Math.min(this.radius * 50, this.distance / factor));
    const shift = before - this.scale();
    this.target = along(along(this.target, r, (x - this.width / 2) * shift), u, (this.height / 2 - y) * shift);
    this.version += 1;
  }

  view(name: ViewName): void {
    [this.azimuth, this.elevation] = VIEWS[name].map((angle) => angle * DEGREE);
    this.version += 1;
  }

  /** What there is to see: near and far plane, and how far one may zoom, follow from it. */
  contain(box: Bounds): void {
    this.centre = middle(box);
    this.radius = Math.max(Math.hypot(...minus(box.high, box.low)) / 2, 1) * 1.3;
    this.version += 1;
  }

  fit(box: Bounds, room = 0.92): void {
    this.target = middle(box);
    const radius = Math.max(Math.hypot(...minus(box.high, box.low)) / 2, 0.5);
    const narrow = Math.min(1, this.width / this.height);
    this.distance = (room * radius) / Math.sin(FIELD / 2) / narrow;
    this.version += 1;
  }

  /** Look at a point along a direction, from a distance at which `size` mm fill a third. */
  lookAt(point: Vec, normal: Vec | null, size: number): void {
    this.target = [...point];
    if (normal) {
      this.azimuth = Math.atan2(normal[1], normal[0]);
      this.elevation = Math.atan2(normal[2], Math.hypot(normal[0], normal[1]));
    }
    this.distance = (1.5 * Math.max(size, 1)) / Math.tan(FIELD / 2);
    this.version += 1;
  }
}

export function minus(a: Readonly<Vec>, b: Readonly<Vec>): Vec {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

export function dot(a: Readonly<Vec>, b: Readonly<Vec>): number {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

export function along(a: Readonly<Vec>, direction: Readonly<Vec>, by: number): Vec {
  return [a[0] + direction[0] * by, a[1] + direction[1] * by, a[2] + direction[2] * by];
}

function middle(box: Bounds): Vec {
  return [0, 1, 2].map((i) => (box.low[i] + box.high[i]) / 2) as Vec;
}
