/**
 * Mouse, pen and fingers on the surface, as MeshLab and CloudCompare have them: the left button is
 * the tool, the right one turns, the middle one shifts, the wheel comes nearer to the cursor.
 */
import { along, minus, type Vec, type ViewCamera, type ViewName } from "./camera";
import { type Cylinder, type CylinderPart, handleOf, resized } from "./cylinder";
import type { Overlay } from "./overlay";
import type { Hit } from "./pick";
import { type DepthPicture, fillOutline, type Point, type Projection } from "./region";
import { type Mode, modeOf } from "./selection";
import type { CutPlane } from "./surface";
import type { Tool } from "./tools";

/** What the hands see of the viewport, and move in it. */
export interface HandledView {
  readonly tool: Tool;
  readonly camera: ViewCamera;
  readonly overlay: Overlay;
  readonly cutPlane: CutPlane | null;
  readonly events: {
    pick: (hit: Hit) => void;
    smooth: (faces: Uint32Array<ArrayBuffer>) => void;
    plane: (plane: CutPlane) => void;
    cylinder?: (cylinder: Cylinder) => void;
  };
  brushRadius: number;
  pick(x: number, y: number): Hit | null;
  projection(): Projection | null;
  seen(): DepthPicture | null;
  select(faces: Iterable<number>, mode: Mode): void;
  clearSelection(): void;
  flood(face: number, mode: Mode): void;
  view(name: ViewName): void;
  moved(): void;
  repaint(): void;
  redraw(): void;
}

type Drag =
  | { kind: "orbit"; pivot: Vec }
  | { kind: "pan" }
  | { kind: "click" }
  | { kind: "box"; from: Point }
  | { kind: "lasso"; outline: Point[] }
  | { kind: "brush" }
  | { kind: "smooth"; faces: Set<number> }
  | { kind: "plane"; part: "shift" | "tilt" }
  | { kind: "cylinder"; part: CylinderPart; size: number }
  | { kind: "pinch" };

const CLICK_PX = 4;

export class Hands {
  private drag: Drag | null = null;
  private start: Point = [0, 0];
  private last: Point = [0, 0];
  private far = 0;
  private polygon: Point[] = [];
  private readonly pointers = new Map<number, Point>();
  private spaceHeld = false;
  private readonly off = new AbortController();

  constructor(
    private readonly glass: HTMLCanvasElement,
    private readonly view: HandledView,
  ) {
    const on = { signal: this.off.signal };
    glass.addEventListener("pointerdown", (event) => this.down(event), on);
    glass.addEventListener("pointermove", (event) => this.move(event), on);
    glass.addEventListener("pointerup", (event) => this.up(event), on);
    glass.addEventListener("pointercancel", (event) => this.up(event), on);
    glass.addEventListener("pointerleave", () => this.hover(null), on);
    glass.addEventListener("wheel", (event) => this.wheel(event), { ...on, passive: false });
    glass.addEventListener("contextmenu", (event) => event.preventDefault(), on);
    glass.addEventListener("dblclick", (event) => this.doubleClick(event), on);
    window.addEventListener("keydown", (event) => this.key(event, true), on);
    window.addEventListener("keyup", (event) => this.key(event, false), on);
  }

  dispose(): void {
    this.off.abort();
  }

  /** Another tool is in the hand: what the last one had begun is gone. */
  dropped(): void {
    this.polygon = [];
    this.view.overlay.stroke = this.view.overlay.brush = null;
    this.view.redraw();
  }

  private at(event: MouseEvent): Point {
    const box = this.glass.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  private down(event: PointerEvent): void {
    const at = this.at(event);
    this.glass.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, at);
    this.start = this.last = at;
    this.far = 0;
    if (this.pointers.size === 2) {
      this.drag = { kind: "pinch" };
      this.view.overlay.stroke = null;
      return;
    }
    this.drag = this.begin(event, at);
    if (this.drag.kind === "brush" || this.drag.kind === "smooth") this.paint(event, at);
  }

  private begin(event: PointerEvent, at: Point): Drag {
    if (event.button === 1 || (event.button === 2 && event.shiftKey)) return { kind: "pan" };
    if (event.button === 2 || this.spaceHeld) return this.orbit(at);
    const handle = this.view.overlay.handles().find((one) => Math.hypot(one.at[0] - at[0], one.at[1] - at[1]) < 12);
    if (handle?.part === "shift" || handle?.part === "tilt") return { kind: "plane", part: handle.part };
    if (handle && this.view.overlay.cylinder)
      return { kind: "cylinder", part: handle.part, size: this.view.overlay.cylinder[handle.part] };
    switch (this.view.tool) {
      case "box":
        return { kind: "box", from: at };
      case "lasso":
        return { kind: "lasso", outline: [at] };
      case "brush":
        if (!event.shiftKey && !event.ctrlKey && !event.altKey) this.view.clearSelection();
        return { kind: "brush" };
      case "smooth":
        return { kind: "smooth", faces: new Set() };
      case "navigate":
        return this.orbit(at);
      default:
        return { kind: "click" };
    }
  }

  /** Turning keeps the point under the cursor where it is; beside the part, its middle. */
  private orbit(at: Point): Drag {
    return { kind: "orbit", pivot: this.view.pick(at[0], at[1])?.point ?? this.view.camera.target };
  }

  private move(event: PointerEvent): void {
    const at = this.at(event);
    const before = this.pointers.get(event.pointerId);
    if (before) this.pointers.set(event.pointerId, at);
    const [dx, dy] = [at[0] - this.last[0], at[1] - this.last[1]];
    const { camera, overlay } = this.view;
    const still = this.isClick(at);
    switch (this.drag?.kind) {
      case "orbit":
        if (!still) {
          camera.orbit(dx, dy, this.drag.pivot);
          this.view.moved();
        }
        break;
      case "pan":
        camera.pan(dx, dy);
        this.view.moved();
        break;
      case "box":
        overlay.stroke = { outline: rectangle(this.drag.from, at), closed: true };
        this.view.redraw();
        break;
      case "lasso":
        this.drag.outline.push(at);
        overlay.stroke = { outline: this.drag.outline, closed: false };
        this.view.redraw();
        break;
      case "brush":
      case "smooth":
        this.paint(event, at);
        break;
      case "plane":
        this.movePlane(this.drag.part, dx, dy);
        break;
      case "cylinder":
        this.moveCylinder(this.drag, at);
        break;
      case "pinch":
        if (before) this.pinch(event.pointerId, before, at);
        break;
      default:
        if (this.polygon.length) {
          overlay.stroke = { outline: [...this.polygon, at], closed: false };
          this.view.redraw();
        }
    }
    this.last = at;
    this.hover(at);
  }

  private up(event: PointerEvent): void {
    const at = this.at(event);
    this.pointers.delete(event.pointerId);
    const { drag } = this;
    this.drag = null;
    if (!drag || event.type === "pointercancel") return;
    const click = this.isClick(at);
    if (drag.kind === "orbit" || drag.kind === "click" || (click && (drag.kind === "box" || drag.kind === "lasso"))) {
      if (click && event.button === 0) this.click(event, at);
      else if (click && event.button === 2 && this.polygon.length) this.closePolygon(event);
    } else if (drag.kind === "box") {
      this.outline(rectangle(drag.from, at), event);
    } else if (drag.kind === "lasso") {
      this.outline(drag.outline, event);
    } else if (drag.kind === "smooth" && drag.faces.size) {
      this.view.events.smooth(Uint32Array.from(drag.faces));
      this.view.clearSelection();
    }
    if (!this.polygon.length) this.view.overlay.stroke = null;
    this.view.redraw();
  }

  /** The hand has not moved since the button went down: a lasso may well end where it began. */
  private isClick(at: Point): boolean {
    this.far = Math.max(this.far, Math.hypot(at[0] - this.start[0], at[1] - this.start[1]));
    return this.far < CLICK_PX;
  }

  private click(event: PointerEvent, at: Point): void {
    const gizmo = this.view.overlay.gizmoAt(at[0], at[1]);
    if (gizmo) {
      this.view.view(gizmo);
      return;
    }
    if (this.view.tool === "polygon") {
      this.polygon.push(at);
      return;
    }
    const hit = this.view.pick(at[0], at[1]);
    if (!hit) return;
    if (this.view.tool === "connected" || this.view.tool === "angle") this.view.flood(hit.face, modeOf(event));
    this.view.events.pick(hit);
  }

  private doubleClick(event: MouseEvent): void {
    if (this.polygon.length) {
      this.closePolygon(event);
      return;
    }
    const hit = this.view.pick(...this.at(event));
    if (!hit || this.view.tool !== "navigate") return;
    this.view.camera.target = hit.point;
    this.view.camera.version += 1;
    this.view.repaint();
  }

  private closePolygon(event: MouseEvent): void {
    const outline = this.polygon;
    this.polygon = [];
    this.view.overlay.stroke = null;
    this.outline(outline, event);
  }

  /** Select what lies in an outline. */
  private outline(outline: readonly Point[], event: MouseEvent): void {
    const projection = this.view.projection();
    if (!projection || outline.length < 3) return;
    this.view.select(projection.inside(fillOutline(outline), this.view.seen()), modeOf(event));
  }

  private paint(event: PointerEvent, at: Point): void {
    const projection = this.view.projection();
    if (!projection) return;
    const under = projection.within(at[0], at[1], this.view.brushRadius, this.view.seen());
    if (this.drag?.kind === "smooth") for (const face of under) this.drag.faces.add(face);
    const remove = this.drag?.kind === "brush" && (event.ctrlKey || event.altKey);
    if (under.length) this.view.select(under, remove ? "remove" : "add");
  }

  private movePlane(part: "shift" | "tilt", dx: number, dy: number): void {
    const { camera, cutPlane, overlay } = this.view;
    if (!cutPlane || !overlay.plane) return;
    const [right, up] = camera.axes();
    const k = camera.scale();
    const by = [0, 1, 2].map((i) => (dx * right[i] - dy * up[i]) * k) as Vec;
    let { normal, offset } = cutPlane;
    if (part === "shift") {
      offset += by[0] * normal[0] + by[1] * normal[1] + by[2] * normal[2];
    } else {
      const { centre, size } = overlay.plane;
      const tip = minus(along(along(centre, normal, size * 0.5), by, 1), centre);
      const length = Math.hypot(...tip) || 1;
      normal = [tip[0] / length, tip[1] / length, tip[2] / length];
      offset = normal[0] * centre[0] + normal[1] * centre[1] + normal[2] * centre[2];
    }
    this.view.events.plane({ normal, offset });
  }

  /** The handle stays under the cursor, along the way it can go. */
  private moveCylinder(drag: { part: CylinderPart; size: number }, at: Point): void {
    const { camera, overlay } = this.view;
    if (!overlay.cylinder) return;
    const begun = { ...overlay.cylinder, [drag.part]: drag.size };
    const { at: from, way } = handleOf(begun, drag.part, camera.azimuth);
    const [x, y] = overlay.place(from);
    const [u, v] = overlay.place(along(from, way, 1));
    const [du, dv] = [u - x, v - y];
    const length = du * du + dv * dv;
    // Seen from its end a handle does not move: it would fly away.
    if (length < 0.04 / camera.scale() ** 2) return;
    const by = ((at[0] - this.start[0]) * du + (at[1] - this.start[1]) * dv) / length;
    overlay.cylinder = resized(overlay.cylinder, drag.part, drag.size + by);
    this.view.redraw();
    this.view.events.cylinder?.(overlay.cylinder);
  }

  /** Two fingers: their middle shifts, their distance comes nearer. */
  private pinch(id: number, before: Point, at: Point): void {
    const other = [...this.pointers].find(([key]) => key !== id)?.[1];
    if (!other) return;
    const { camera } = this.view;
    const factor =
      Math.hypot(at[0] - other[0], at[1] - other[1]) / (Math.hypot(before[0] - other[0], before[1] - other[1]) || 1);
    camera.pan((at[0] - before[0]) / 2, (at[1] - before[1]) / 2);
    camera.zoom(factor, (at[0] + other[0]) / 2, (at[1] + other[1]) / 2);
    this.view.moved();
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    const brushes = this.view.tool === "brush" || this.view.tool === "smooth";
    if (event.ctrlKey && brushes) {
      this.view.brushRadius = Math.min(300, Math.max(3, this.view.brushRadius * (event.deltaY < 0 ? 1.15 : 1 / 1.15)));
      this.hover(this.at(event));
      return;
    }
    const [x, y] = this.at(event);
    const lines = event.deltaMode === 0 ? event.deltaY / 100 : event.deltaY / 3;
    this.view.camera.zoom(Math.exp(-0.16 * Math.max(-4, Math.min(4, lines))), x, y);
    this.view.moved();
  }

  private hover(at: Point | null): void {
    const brushes = this.view.tool === "brush" || this.view.tool === "smooth";
    const before = this.view.overlay.brush;
    this.view.overlay.brush = at && brushes ? { at, radius: this.view.brushRadius } : null;
    if (before || this.view.overlay.brush) this.view.redraw();
  }

  private key(event: KeyboardEvent, down: boolean): void {
    if (event.code === "Space" && event.target === document.body) {
      this.spaceHeld = down;
      event.preventDefault();
    }
    if (!down || !this.polygon.length) return;
    if (event.key === "Escape") {
      this.polygon = [];
      this.view.overlay.stroke = null;
      this.view.redraw();
    } else if (event.key === "Enter") {
      const outline = this.polygon;
      this.polygon = [];
      this.view.overlay.stroke = null;
      const projection = this.view.projection();
      if (projection && outline.length > 2)
        this.view.select(projection.inside(fillOutline(outline), this.view.seen()), modeOf(event));
    }
  }
}

function rectangle(a: Point, b: Point): Point[] {
  return [a, [b[0], a[1]], b, [a[0], b[1]]];
}
