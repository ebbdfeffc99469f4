/** What is drawn over the surface with a pen: outlines, marks, labels, axes, a scale. */
import { along, type Vec, type ViewCamera, type ViewName } from "./camera";
import { CYLINDER_PARTS, type Cylinder, type CylinderPart, circle, handleOf, rim } from "./cylinder";
import type { Point } from "./region";

export type Item =
  | { kind: "point"; at: Vec; colour: string; label?: string }
  | { kind: "line"; points: Vec[]; colour: string; closed?: boolean; label?: string }
  /** Many short lines: (6n) mm, two ends each. */
  | { kind: "pieces"; ends: Float32Array; colour: string };

export interface Stroke {
  outline: readonly Point[];
  closed: boolean;
}

export interface Handle {
  at: Point;
  part: "shift" | "tilt" | CylinderPart;
}

const GIZMO = { size: 34, margin: 52 };
const AXES: readonly { axis: Vec; name: string; colour: string; view: ViewName; back: ViewName }[] = [
  { axis: [1, 0, 0], name: "X", colour: "#e06c5a", view: "right", back: "left" },
  { axis: [0, 1, 0], name: "Y", colour: "#d9b342", view: "back", back: "front" },
  { axis: [0, 0, 1], name: "Z", colour: "#5aa9e6", view: "top", back: "bottom" },
];

/** A label that stands on the screen, from the start of its baseline. */
interface Label {
  x: number;
  y: number;
  width: number;
}
const LABEL_HEIGHT = 20;

export class Overlay {
  items: Item[] = [];
  stroke: Stroke | null = null;
  brush: { at: Point; radius: number } | null = null;
  plane: { centre: Vec; normal: Vec; size: number } | null = null;
  cylinder: Cylinder | null = null;
  ink = "#d7dee8";
  private readonly pen: CanvasRenderingContext2D;
  private ratio = 1;
  private labelled: Label[] = [];

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly camera: ViewCamera,
  ) {
    this.pen = canvas.getContext("2d")!;
  }

  resize(width: number, height: number): void {
    this.ratio = window.devicePixelRatio;
    this.canvas.width = Math.round(width * this.ratio);
    this.canvas.height = Math.round(height * this.ratio);
  }

  draw(): void {
    const { pen, camera } = this;
    pen.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    pen.clearRect(0, 0, camera.width, camera.height);
    pen.font = "12px system-ui, sans-serif";
    pen.lineWidth = 1.5;
    this.labelled = [];
    for (const item of this.items) this.drawItem(item);
    if (this.plane) this.drawPlane();
    if (this.cylinder) this.drawCylinder(this.cylinder);
    if (this.stroke) this.drawStroke(this.stroke);
    if (this.brush) this.circle(this.brush.at, this.brush.radius, "#f0691e");
    this.drawGizmo();
    this.drawScale();
  }

  /** Where a point of the object is on the screen. */
  place(point: Vec): Point {
    const out = new Float64Array(3);
    this.camera.projector()(point[0], point[1], point[2], out);
    return [out[0], out[1]];
  }

  private drawItem(item: Item): void {
    if (item.kind === "point") {
      const at = this.place(item.at);
      this.circle(at, 7, "#000a", 4);
      this.circle(at, 7, item.colour, 2);
      this.circle(at, 1.5, item.colour, 2);
      if (item.label) this.label(item.label, [at[0] + 12, at[1] - 8]);
      return;
    }
    if (item.kind === "pieces") {
      this.drawPieces(item.ends, item.colour);
      return;
    }
    const places = item.points.map((point) => this.place(point));
    this.path(places, item.closed ?? false);
    this.pen.strokeStyle = "#000a";
    this.pen.lineWidth = 4;
    this.pen.stroke();
    this.pen.strokeStyle = item.colour;
    this.pen.lineWidth = 2;
    this.pen.stroke();
    if (item.label && places.length) {
      const middle = places[Math.floor(places.length / 2)];
      const first = places[Math.max(0, Math.floor(places.length / 2) - 1)];
      this.label(item.label, [(middle[0] + first[0]) / 2 + 8, (middle[1] + first[1]) / 2 - 8]);
    }
  }

  private drawPieces(ends: Float32Array, colour: string): void {
    const { pen } = this;
    const project = this.camera.projector();
    const at = new Float64Array(3);
    pen.beginPath();
    for (let i = 0; i < ends.length; i += 3) {
      project(ends[i], ends[i + 1], ends[i + 2], at);
      if (i % 6) pen.lineTo(at[0], at[1]);
      else pen.moveTo(at[0], at[1]);
    }
    for (const [style, width] of [
      ["#000a", 4],
      [colour, 2],
    ] as const) {
      pen.strokeStyle = style;
      pen.lineWidth = width;
      pen.stroke();
    }
  }

  private drawStroke(stroke: Stroke): void {
    const { pen } = this;
    this.path(stroke.outline, stroke.closed);
    pen.fillStyle = "#f0691e22";
    pen.fill();
    pen.strokeStyle = "#f0691e";
    pen.setLineDash([5, 4]);
    // The line that closes the outline is shown, for it decides what is inside.
    if (!stroke.closed) this.path([stroke.outline[0], stroke.outline[stroke.outline.length - 1]], false);
    pen.stroke();
    pen.setLineDash([]);
    this.path(stroke.outline, stroke.closed);
    pen.stroke();
  }

  /** What can be dragged: of the cut plane and of the working volume. */
  handles(): Handle[] {
    return [...this.planeHandles(), ...this.cylinderHandles()];
  }

  /** A disc to shift the cut plane, a ball to tilt it. */
  private planeHandles(): Handle[] {
    if (!this.plane) return [];
    const { centre, normal, size } = this.plane;
    return [
      { at: this.place(along(centre, normal, size * 0.5)), part: "tilt" },
      { at: this.place(centre), part: "shift" },
    ];
  }

  private cylinderHandles(): Handle[] {
    const { cylinder, camera } = this;
    if (!cylinder) return [];
    return CYLINDER_PARTS.map((part) => ({ at: this.place(handleOf(cylinder, part, camera.azimuth).at), part }));
  }

  private drawCylinder(of: Cylinder): void {
    const { pen } = this;
    pen.strokeStyle = "#3fb8f2";
    pen.lineWidth = 1.5;
    for (const height of [of.bottom, of.top]) {
      this.path(
        circle(of, height).map((point) => this.place(point)),
        true,
      );
      pen.stroke();
    }
    for (const side of [-1, 1]) {
      const angle = this.camera.azimuth + (side * Math.PI) / 2;
      this.path([this.place(rim(of, of.bottom, angle)), this.place(rim(of, of.top, angle))], false);
      pen.stroke();
    }
    for (const part of CYLINDER_PARTS) {
      const at = this.place(handleOf(of, part, this.camera.azimuth).at);
      this.disc(at, 8, "#11151a");
      this.disc(at, 6.5, "#3fb8f2");
      const mm = of[part].toFixed(1);
      this.label(`${part} ${mm} mm`, [at[0] + 13, at[1] + 4]);
    }
  }

  private drawPlane(): void {
    const { pen } = this;
    const { centre, normal, size } = this.plane!;
    const [a, b] = across(normal);
    const corners = [
      [1, 1],
      [-1, 1],
      [-1, -1],
      [1, -1],
    ].map(([s, t]) => this.place(along(along(centre, a, s * size), b, t * size)));
    this.path(corners, true);
    pen.fillStyle = "#3fb8f21c";
    pen.fill();
    pen.strokeStyle = "#3fb8f2";
    pen.stroke();
    const [tilt, shift] = this.planeHandles();
    this.path([shift.at, tilt.at], false);
    pen.stroke();
    this.disc(shift.at, 7, "#3fb8f2");
    this.disc(tilt.at, 6, "#ffffff");
  }

  private gizmoCentre(): Point {
    return [this.camera.width - GIZMO.margin, GIZMO.margin];
  }

  private gizmoTips(): { at: Point; depth: number; name: string; colour: string; view: ViewName }[] {
    const [r, u, f] = this.camera.axes();
    const [cx, cy] = this.gizmoCentre();
    return AXES.flatMap(({ axis, name, colour, view, back }) =>
      [1, -1].map((sign) => {
        const i = axis.indexOf(1);
        const at: Point = [cx + sign * r[i] * GIZMO.size, cy - sign * u[i] * GIZMO.size];
        return { at, depth: sign * f[i], name: sign > 0 ? name : "", colour, view: sign > 0 ? view : back };
      }),
    ).sort((a, b) => b.depth - a.depth);
  }

  private drawGizmo(): void {
    const { pen } = this;
    const centre = this.gizmoCentre();
    for (const tip of this.gizmoTips()) {
      pen.strokeStyle = tip.colour;
      if (tip.name) {
        this.path([centre, tip.at], false);
        pen.stroke();
        this.disc(tip.at, 9, tip.colour);
        pen.fillStyle = "#11151a";
        pen.textAlign = "center";
        pen.textBaseline = "middle";
        pen.font = "600 11px system-ui, sans-serif";
        pen.fillText(tip.name, tip.at[0], tip.at[1] + 0.5);
      } else {
        pen.globalAlpha = 0.55;
        this.disc(tip.at, 5, tip.colour);
        pen.globalAlpha = 1;
      }
    }
    pen.textAlign = "start";
    pen.textBaseline = "alphabetic";
    pen.font = "12px system-ui, sans-serif";
  }

  /** The view that a click on the axes asks for. */
  gizmoAt(x: number, y: number): ViewName | null {
    const near = this.gizmoTips().filter(({ at }) => Math.hypot(at[0] - x, at[1] - y) < 11);
    return near.length ? near[near.length - 1].view : null;
  }

  private drawScale(): void {
    const { pen, camera } = this;
    const perPixel = camera.scale();
    const power = 10 ** Math.floor(Math.log10(perPixel * 120));
    const length = [5, 2, 1].map((n) => n * power).find((mm) => mm / perPixel <= 120) ?? power;
    const width = length / perPixel;
    const y = camera.height - 16;
    pen.strokeStyle = pen.fillStyle = this.ink;
    this.path(
      [
        [16, y - 5],
        [16, y],
        [16 + width, y],
        [16 + width, y - 5],
      ],
      false,
    );
    pen.lineWidth = 1.5;
    pen.stroke();
    pen.fillText(`${length >= 1 ? length : Number(length.toPrecision(1))} mm`, 22 + width, y);
  }

  /** A label at a place, or below those that stand there already. */
  private label(text: string, [x, y]: Point): void {
    const { pen } = this;
    const width = pen.measureText(text).width;
    let base = y;
    const hides = (other: Label) =>
      Math.abs(other.y - base) < LABEL_HEIGHT && x < other.x + other.width + 12 && other.x < x + width + 12;
    while (this.labelled.some(hides)) base += LABEL_HEIGHT / 2;
    this.labelled.push({ x, y: base, width });
    pen.fillStyle = "#11151ae0";
    pen.beginPath();
    pen.roundRect(x - 5, base - 13, width + 10, 18, 4);
    pen.fill();
    pen.fillStyle = "#f2f5f8";
    pen.fillText(text, x, base);
  }

  private path(points: readonly Point[], closed: boolean): void {
    this.pen.beginPath();
    for (const [i, [x, y]] of points.entries()) {
      if (i) this.pen.lineTo(x, y);
      else this.pen.moveTo(x, y);
    }
    if (closed) this.pen.closePath();
  }

  private circle(at: Point, radius: number, colour: string, width = 1.5): void {
    this.pen.beginPath();
    this.pen.arc(at[0], at[1], radius, 0, 2 * Math.PI);
    this.pen.strokeStyle = colour;
    this.pen.lineWidth = width;
    this.pen.stroke();
  }

  private disc(at: Point, radius: number, colour: string): void {
    this.pen.beginPath();
    this.pen.arc(at[0], at[1], radius, 0, 2 * Math.PI);
    this.pen.fillStyle = colour;
    this.pen.fill();
  }
}

/** Two unit vectors across a normal. */
export function across(normal: Vec): [Vec, Vec] {
  const [x, y, z] = normal;
  const flat = Math.hypot(x, y);
  const a: Vec = flat > 1e-6 ? [-y / flat, x / flat, 0] : [1, 0, 0];
  const b: Vec = [y * a[2] - z * a[1], z * a[0] - x * a[2], x * a[1] - y * a[0]];
  return [a, b];
}
