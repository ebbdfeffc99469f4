/** Points as they come, on a plain canvas: it turns, and needs no graphics card. */
import { PALETTE } from "../mesh/colours";
import { ViewCamera } from "../viewport/camera";
import type { Cloud } from "./live";

const START = { low: [-40, -40, 0], high: [40, 40, 80] } as const;

export class CloudView {
  private readonly camera = new ViewCamera();
  private readonly pen: CanvasRenderingContext2D;
  private cloud: Cloud | null = null;
  private asked = false;
  private drag: { x: number; y: number; pan: boolean } | null = null;
  private readonly watch: ResizeObserver;
  private readonly off = new AbortController();
  private fitted = 0;

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
    if (cloud !== this.cloud) this.fitted = 0;
    this.cloud = cloud;
    // The view follows the part while it grows, but not for every profile.
    if (cloud.count > 2 * this.fitted) this.fit();
    this.redraw();
  }

  fit(): void {
    const low = [Infinity, Infinity, Infinity];
    const high = [-Infinity, -Infinity, -Infinity];
    for (const laser of this.cloud?.lasers ?? []) {
      for (const part of this.cloud!.of(laser)) {
        for (let i = 0; i < part.length; i++) {
          low[i % 3] = Math.min(low[i % 3], part[i]);
          high[i % 3] = Math.max(high[i % 3], part[i]);
        }
      }
    }
    const box = low[0] <= high[0] ? { low, high } : START;
    this.fitted = this.cloud?.count ?? 0;
    this.camera.contain({ low: [box.low[0], box.low[1], box.low[2]], high: [box.high[0], box.high[1], box.high[2]] });
    this.camera.fit({ low: [box.low[0], box.low[1], box.low[2]], high: [box.high[0], box.high[1], box.high[2]] });
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
      const [r, g, b] = PALETTE[k % PALETTE.length];
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
    this.fit();
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
    if (this.drag.pan) this.camera.pan(dx, dy);
    else this.camera.orbit(dx, dy);
    this.redraw();
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    const box = this.canvas.getBoundingClientRect();
    this.camera.zoom(Math.exp(-0.0016 * event.deltaY), event.clientX - box.left, event.clientY - box.top);
    this.redraw();
  }

  private key(event: KeyboardEvent): void {
    const turns: Record<string, [number, number]> = { ArrowLeft: [-30, 0], ArrowRight: [30, 0], ArrowUp: [0, -30], ArrowDown: [0, 30] };
    const by = turns[event.key];
    if (!by) return;
    event.preventDefault();
    this.camera.orbit(...by);
    this.redraw();
  }
}
