/** A canvas onto a plane: wheel comes nearer to the cursor, right or middle button shifts. */

export interface Box {
  x0: number;
  y0: number;
  x1: number;
  y1: number;
}

export interface Colours {
  ink: string;
  faint: string;
  line: string;
  view: string;
  accent: string;
}

export const MARK = "#f0691e";
/** CSS pixels about what is fitted. */
const MARGIN = 26;

export abstract class PlaneView {
  protected readonly pen: CanvasRenderingContext2D;
  protected width = 1;
  protected height = 1;
  /** CSS pixels per unit; the sign says which way the axis runs on the screen. */
  protected kx = 1;
  protected ky = 1;
  private ox = 0;
  private oy = 0;
  private asked = false;
  private panning: { x: number; y: number } | null = null;
  private pressed: { x: number; y: number; moved: boolean } | null = null;
  private readonly watch: ResizeObserver;
  private readonly off = new AbortController();
  private fitted = false;

  protected constructor(
    protected readonly canvas: HTMLCanvasElement,
    /** Whether both axes have one scale, and the y axis points up. */
    private readonly shape: { equal: boolean; up: boolean },
  ) {
    this.pen = canvas.getContext("2d")!;
    const on = { signal: this.off.signal };
    canvas.addEventListener("wheel", (event) => this.wheel(event), { ...on, passive: false });
    canvas.addEventListener("pointerdown", (event) => this.down(event), on);
    canvas.addEventListener("pointermove", (event) => this.move(event), on);
    canvas.addEventListener("pointerup", (event) => this.up(event), on);
    canvas.addEventListener("dblclick", () => this.fit(), on);
    canvas.addEventListener("contextmenu", (event) => event.preventDefault(), on);
    this.watch = new ResizeObserver(() => this.resize());
    this.watch.observe(canvas);
  }

  dispose(): void {
    this.off.abort();
    this.watch.disconnect();
  }

  /** What there is to see; null when there is nothing. */
  protected abstract content(): Box | null;
  protected abstract paint(): void;
  /** A click without a drag, in units of the plane. */
  protected click(_x: number, _y: number, _event: PointerEvent): void {}
  /** A drag with the left button, each time it gets on; `done` when the button is let go. */
  protected dragged(
    _from: { x: number; y: number },
    _to: { x: number; y: number },
    _done: boolean,
    _event: PointerEvent,
  ): void {}

  protected toScreen(x: number, y: number): [number, number] {
    return [this.ox + this.kx * x, this.oy + this.ky * y];
  }

  /** Where a place of the plane is in the window, CSS pixels. */
  windowPlace(x: number, y: number): { x: number; y: number } {
    const box = this.canvas.getBoundingClientRect();
    const [sx, sy] = this.toScreen(x, y);
    return { x: box.left + sx, y: box.top + sy };
  }

  protected toPlane(x: number, y: number): { x: number; y: number } {
    return { x: (x - this.ox) / this.kx, y: (y - this.oy) / this.ky };
  }

  protected visible(): Box {
    const a = this.toPlane(0, 0);
    const b = this.toPlane(this.width, this.height);
    return { x0: Math.min(a.x, b.x), y0: Math.min(a.y, b.y), x1: Math.max(a.x, b.x), y1: Math.max(a.y, b.y) };
  }

  fit(box = this.content()): void {
    if (!box || this.width < 2) return;
    const margin = this.shape.equal ? MARGIN : 0;
    const w = Math.max(box.x1 - box.x0, 1e-6);
    const h = Math.max(box.y1 - box.y0, 1e-6);
    let kx = (this.width - 2 * margin) / w;
    let ky = (this.height - 2 * margin) / h;
    if (this.shape.equal) kx = ky = Math.max(1e-6, Math.min(kx, ky));
    this.kx = kx;
    this.ky = this.shape.up ? -ky : ky;
    this.ox = this.width / 2 - (this.kx * (box.x0 + box.x1)) / 2;
    this.oy = this.height / 2 - (this.ky * (box.y0 + box.y1)) / 2;
    this.fitted = true;
    this.redraw();
  }

  /** Shift no further than it takes to show a place; what has just been fitted stays as it is. */
  reveal(x: number, y: number): void {
    const [sx, sy] = this.toScreen(x, y);
    const into = (at: number, size: number) => Math.min(Math.max(at, MARGIN), Math.max(size - MARGIN, MARGIN));
    this.ox += into(sx, this.width) - sx;
    this.oy += into(sy, this.height) - sy;
    this.redraw();
  }

  redraw(): void {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      if (!this.fitted) this.fit();
      const ratio = window.devicePixelRatio;
      this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      this.pen.clearRect(0, 0, this.width, this.height);
      this.pen.font = "11px system-ui, sans-serif";
      this.paint();
    });
  }

  protected colours(): Colours {
    const style = getComputedStyle(this.canvas);
    const of = (name: string) => style.getPropertyValue(name).trim();
    return { ink: of("--ink-2"), faint: of("--ink-3"), line: of("--line"), view: of("--view"), accent: of("--accent") };
  }

  /** Another thing altogether is shown: it is fitted when it is first drawn. */
  protected refit(): void {
    this.fitted = false;
    this.redraw();
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (!clientWidth || !clientHeight) return;
    const other = (now: number, before: number) => Math.abs(now - before) > 0.25 * before;
    const grown = other(clientWidth, this.width) || other(clientHeight, this.height);
    this.width = clientWidth;
    this.height = clientHeight;
    this.canvas.width = Math.round(clientWidth * window.devicePixelRatio);
    this.canvas.height = Math.round(clientHeight * window.devicePixelRatio);
    if (grown || !this.shape.equal) this.fitted = false;
    this.redraw();
  }

  private place(event: MouseEvent): { x: number; y: number } {
    const box = this.canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    const { x, y } = this.place(event);
    const factor = Math.exp(-0.0016 * Math.max(-400, Math.min(400, event.deltaY)));
    this.ox = x + (this.ox - x) * factor;
    this.oy = y + (this.oy - y) * factor;
    this.kx *= factor;
    this.ky *= factor;
    this.redraw();
  }

  private down(event: PointerEvent): void {
    const at = this.place(event);
    this.canvas.setPointerCapture(event.pointerId);
    if (event.button === 0) this.pressed = { ...at, moved: false };
    else this.panning = at;
  }

  private move(event: PointerEvent): void {
    const at = this.place(event);
    if (this.panning) {
      this.ox += at.x - this.panning.x;
      this.oy += at.y - this.panning.y;
      this.panning = at;
      this.redraw();
    } else if (this.pressed) {
      if (Math.hypot(at.x - this.pressed.x, at.y - this.pressed.y) > 3) this.pressed.moved = true;
      if (this.pressed.moved) this.drag(at, false, event);
    }
  }

  private up(event: PointerEvent): void {
    const at = this.place(event);
    this.panning = null;
    if (this.pressed?.moved) this.drag(at, true, event);
    else if (this.pressed) {
      const { x, y } = this.toPlane(at.x, at.y);
      this.click(x, y, event);
    }
    this.pressed = null;
  }

  private drag(at: { x: number; y: number }, done: boolean, event: PointerEvent): void {
    this.dragged(this.toPlane(this.pressed!.x, this.pressed!.y), this.toPlane(at.x, at.y), done, event);
  }
}

/** Round steps for the lines of a scale: 1, 2 or 5 times a power of ten, about `wanted` apart. */
export function niceStep(wanted: number): number {
  const power = 10 ** Math.floor(Math.log10(wanted));
  return [1, 2, 5, 10].map((n) => n * power).find((step) => step >= wanted) ?? 10 * power;
}
