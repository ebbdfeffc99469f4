/** Points as they come, on a plain canvas: it turns, and needs no graphics card. */

import type { Bounds } from "../mesh/model";
import { DISTINCT } from "../palette";
import { ViewCamera } from "../viewport/camera";
import type { Cloud } from "./live";

/** mm: what is turning lies in an upright cylinder about the axis. */
interface Cylinder {
  radius: number;
  low: number;
  high: number;
}

const START: Cylinder = { radius: 40, low: 0, high: 80 };
/** Of the cylinder, by which it may grow before the view follows: not for every profile. */
const SLACK = 0.03;

export class CloudView {
  private readonly camera = new ViewCamera();
  private readonly pen: CanvasRenderingContext2D;
  private cloud: Cloud | null = null;
  private asked = false;
  private drag: { x: number; y: number; pan: boolean } | null = null;
  private readonly watch: ResizeObserver;
  private readonly off = new AbortController();
  private fitted: Cylinder | null = null;
  /** Whether a person has chosen the view: then it stays. */
  private chosen = false;

  constructor(private readonly canvas: HTMLCanvasElement) {
    this.pen = canvas.getContext("2d")!;
    const on = { signal: this.off.signal };
    canvas.addEventListener("pointerdown", (event) => this.down(event), on);
    canvas.addEventListener("pointermove", (event) => this.move(event), on);
    canvas.addEventListener("pointerup", () => (this.drag = null), on);
    canvas.addEventListener("wheel", (event) => this.wheel(event), { ...on, passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault(), on);
    canvas.addEventListener("keydown", (event) => this.key(event), on);
    this.watch = new ResizeObserver(() => this.resize());
    this.watch.observe(canvas);
  }

  dispose(): void {
    this.off.abort();
    this.watch.disconnect();
  }

  show(cloud: Cloud): void {
    if (cloud !== this.cloud) this.chosen = false;
    this.cloud = cloud;
    if (!this.chosen) this.follow();
    this.redraw();
  }

  /** The cylinder that holds the points: the next profiles are likely to lie in it, too. */
  private around(): Cylinder {
    let [square, low, high] = [0, Infinity, -Infinity];
    for (const laser of this.cloud?.lasers ?? []) {
      for (const part of this.cloud!.of(laser)) {
        for (let i = 0; i < part.length; i += 3) {
          square = Math.max(square, part[i] ** 2 + part[i + 1] ** 2);
          low = Math.min(low, part[i + 2]);
          high = Math.max(high, part[i + 2]);
        }
      }
    }
    return low <= high ? { radius: Math.sqrt(square), low, high } : START;
  }

  private follow(anew = false): void {
    const { radius, low, high } = this.around();
    const now = this.fitted;
    const slack = SLACK * (radius + high - low);
    const off =
      !now ||
      Math.abs(radius - now.radius) > slack ||
      Math.abs(low - now.low) > slack ||
      Math.abs(high - now.high) > slack;
    if (!off && !anew) return;
    this.fitted = { radius, low, high };
    const box: Bounds = { low: [-radius, -radius, low], high: [radius, radius, high] };
    this.camera.contain(box);
    this.camera.fit(box);
  }

  redraw(): void {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.paint();
    });
  }

  private paint(): void {
    const { width, height } = this.canvas;
    if (!width || !height) return;
    const image = this.pen.createImageData(width, height);
    const depths = new Float32Array(width * height).fill(Infinity);
    const pixels = new Uint32Array(image.data.buffer);
    const ratio = width / this.camera.width;
    const project = this.camera.projector();
    const out = new Float64Array(3);
    this.cloud?.lasers.forEach((laser, k) => {
      const [r, g, b] = DISTINCT[k % DISTINCT.length];
      const colour = 0xff000000 | (b << 16) | (g << 8) | r;
      for (const part of this.cloud!.of(laser)) {
        for (let i = 0; i < part.length; i += 3) {
          project(part[i], part[i + 1], part[i + 2], out);
          const x = Math.round(out[0] * ratio);
          const y = Math.round(out[1] * ratio);
          const at = y * width + x;
          if (x < 0 || y < 0 || x >= width || y >= height || out[2] >= depths[at]) continue;
          depths[at] = out[2];
          pixels[at] = colour;
        }
      }
    });
    this.pen.putImageData(image, 0, 0);
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth || !clientHeight) return;
    this.canvas.width = Math.round(clientWidth * window.devicePixelRatio);
    this.canvas.height = Math.round(clientHeight * window.devicePixelRatio);
    this.camera.resize(clientWidth, clientHeight);
    if (!this.chosen) this.follow(true);
    this.redraw();
  }

  private down(event: PointerEvent): void {
    this.canvas.setPointerCapture(event.pointerId);
    this.drag = { x: event.clientX, y: event.clientY, pan: event.button === 1 || event.shiftKey };
  }

  private move(event: PointerEvent): void {
    if (!this.drag) return;
    const dx = event.clientX - this.drag.x;
    const dy = event.clientY - this.drag.y;
    this.drag = { ...this.drag, x: event.clientX, y: event.clientY };
    this.chosen = true;
    if (this.drag.pan) this.camera.pan(dx, dy);
    else this.camera.orbit(dx, dy);
    this.redraw();
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    this.chosen = true;
    const box = this.canvas.getBoundingClientRect();
    this.camera.zoom(Math.exp(-0.0016 * event.deltaY), event.clientX - box.left, event.clientY - box.top);
    this.redraw();
  }

  private key(event: KeyboardEvent): void {
    const turns: Record<string, [number, number]> = {
      ArrowLeft: [-30, 0],
      ArrowRight: [30, 0],
      ArrowUp: [0, -30],
      ArrowDown: [0, 30],
    };
    const by = turns[event.key];
    if (!by) return;
    event.preventDefault();
    this.chosen = true;
    this.camera.orbit(...by);
    this.redraw();
  }
}
