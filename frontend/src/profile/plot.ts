/** The profile as a section: radius against height, with its neighbours and the candidates. */
import type { Grid } from "../grid/data";
import { type Box, MARK, niceStep, PlaneView } from "../ui/plane";
import type { Profile } from "./data";

export interface PlotEvents {
  mark: (line: number) => void;
  /** Lines in a box drawn with the left button. */
  range: (lines: number[]) => void;
}

export class ProfilePlot extends PlaneView {
  private grid: Grid | null = null;
  private profile: Profile | null = null;
  private row = -1;
  private line = -1;
  private direction: [number, number] = [1, 0];
  private chosen = new Set<number>();
  private box: Box | null = null;

  constructor(
    canvas: HTMLCanvasElement,
    private readonly events: PlotEvents,
  ) {
    super(canvas, { equal: true, up: true });
  }

  show(grid: Grid | null, step: number, profile: Profile | null, line: number, chosen: readonly number[]): void {
    const row = grid ? grid.row(step) : -1;
    const other = grid?.header.grid !== this.grid?.header.grid || (this.row < 0 && row >= 0);
    this.grid = grid;
    this.row = row;
    this.profile = profile?.step === step ? profile : null;
    this.line = line;
    this.chosen = new Set(chosen);
    this.direction = this.facing();
    if (other) this.refit();
    const at = this.grid && this.row >= 0 && line >= 0 ? this.grid.point(this.row, line) : null;
    if (at && !other) this.reveal(...this.flat(at));
    this.redraw();
  }

  /** Which way the profile looks from the axis: beyond the axis the radius is negative. */
  private facing(): [number, number] {
    let x = 0;
    let y = 0;
    for (let line = 0; this.grid && this.row >= 0 && line < this.grid.lines; line++) {
      const p = this.grid.point(this.row, line);
      if (!p) continue;
      x += p[0];
      y += p[1];
    }
    const length = Math.hypot(x, y);
    return length ? [x / length, y / length] : [1, 0];
  }

  private flat(p: readonly number[]): [number, number] {
    const side = p[0] * this.direction[0] + p[1] * this.direction[1] < 0 ? -1 : 1;
    return [side * Math.hypot(p[0], p[1]), p[2]];
  }

  protected content(): Box | null {
    const box: Box = { x0: 0, y0: Infinity, x1: -Infinity, y1: -Infinity };
    for (let line = 0; this.grid && this.row >= 0 && line < this.grid.lines; line++) {
      const p = this.grid.point(this.row, line);
      if (!p) continue;
      const [r, z] = this.flat(p);
      box.x0 = Math.min(box.x0, r);
      box.x1 = Math.max(box.x1, r);
      box.y0 = Math.min(box.y0, z);
      box.y1 = Math.max(box.y1, z);
    }
    return box.x1 > box.x0 ? box : null;
  }

  protected paint(): void {
    const { grid } = this;
    if (!grid || this.row < 0) return;
    this.scales();
    const { faint, ink } = this.colours();
    const s = grid.steps.length;
    for (const [away, alpha] of [
      [2, 0.25],
      [1, 0.5],
    ] as const) {
      for (const sign of [-1, 1]) {
        const row = this.row + sign * away;
        const wrapped = grid.header.closed ? (row + s) % s : row;
        if (wrapped >= 0 && wrapped < s) this.curve(wrapped, faint, alpha);
      }
    }
    this.candidates();
    this.curve(this.row, ink, 1);
    this.dots();
    if (this.box) this.band(this.box);
  }

  private curve(row: number, colour: string, alpha: number): void {
    const { grid, pen } = this;
    pen.beginPath();
    let pending = false;
    for (let line = 0; line < grid!.lines; line++) {
      const p = grid!.point(row, line);
      if (!p) {
        pending = false;
        continue;
      }
      const [x, y] = this.toScreen(...this.flat(p));
      if (pending) pen.lineTo(x, y);
      else pen.moveTo(x, y);
      pending = true;
    }
    pen.globalAlpha = alpha;
    pen.strokeStyle = colour;
    pen.lineWidth = 1;
    pen.stroke();
    pen.globalAlpha = 1;
  }

  private candidates(): void {
    const { profile, pen } = this;
    if (!profile) return;
    pen.strokeStyle = this.colours().accent;
    for (let line = 0; line < profile.lines; line++) {
      for (const candidate of profile.of(line)) {
        if (candidate.chosen || !candidate.point) continue;
        const [x, y] = this.toScreen(...this.flat(candidate.point));
        pen.beginPath();
        pen.arc(x, y, line === this.line ? 4 : 2, 0, 2 * Math.PI);
        pen.stroke();
      }
    }
  }

  private dots(): void {
    const { grid, pen } = this;
    const { ink } = this.colours();
    const big = Math.abs(this.ky) > 6;
    for (let line = 0; line < grid!.lines; line++) {
      const p = grid!.point(this.row, line);
      const special = line === this.line || this.chosen.has(line) || grid!.edited[this.row * grid!.lines + line] > 0;
      if (!p || !(big || special)) continue;
      const [x, y] = this.toScreen(...this.flat(p));
      pen.fillStyle = this.chosen.has(line) ? MARK : special ? "#e6b422" : ink;
      pen.beginPath();
      pen.arc(x, y, special ? 3 : 1.6, 0, 2 * Math.PI);
      pen.fill();
    }
    const at = this.line >= 0 ? grid!.point(this.row, this.line) : null;
    if (!at) return;
    const [x, y] = this.toScreen(...this.flat(at));
    pen.strokeStyle = MARK;
    pen.lineWidth = 2;
    pen.beginPath();
    pen.arc(x, y, 7, 0, 2 * Math.PI);
    pen.stroke();
  }

  private band(box: Box): void {
    const [x0, y0] = this.toScreen(box.x0, box.y0);
    const [x1, y1] = this.toScreen(box.x1, box.y1);
    this.pen.strokeStyle = MARK;
    this.pen.fillStyle = `${MARK}22`;
    this.pen.fillRect(x0, y0, x1 - x0, y1 - y0);
    this.pen.strokeRect(x0, y0, x1 - x0, y1 - y0);
  }

  private scales(): void {
    const { pen } = this;
    const { line, faint } = this.colours();
    const seen = this.visible();
    const step = niceStep(70 / Math.abs(this.kx));
    pen.lineWidth = 1;
    pen.fillStyle = faint;
    const words = (n: number) => String(Number(n.toPrecision(6)));
    for (let r = Math.ceil(seen.x0 / step) * step; r <= seen.x1; r += step) {
      const [x] = this.toScreen(r, 0);
      pen.strokeStyle = Math.abs(r) < step / 2 ? faint : line;
      pen.beginPath();
      pen.moveTo(x, 0);
      pen.lineTo(x, this.height);
      pen.stroke();
      if (x < this.width - 76) pen.fillText(words(r), x + 3, this.height - 5);
    }
    for (let z = Math.ceil(seen.y0 / step) * step; z <= seen.y1; z += step) {
      const [, y] = this.toScreen(0, z);
      pen.strokeStyle = Math.abs(z) < step / 2 ? faint : line;
      pen.beginPath();
      pen.moveTo(0, y);
      pen.lineTo(this.width, y);
      pen.stroke();
      pen.fillText(words(z), 4, y - 3);
    }
    pen.fillText("r mm →", this.width - 48, this.height - 5);
    pen.fillText("z mm ↑", 4, 12);
  }

  private nearest(x: number, y: number): number {
    const { grid } = this;
    let best = 14 / Math.abs(this.kx);
    let line = -1;
    for (let i = 0; grid && this.row >= 0 && i < grid.lines; i++) {
      const p = grid.point(this.row, i);
      if (!p) continue;
      const [r, z] = this.flat(p);
      const d = Math.hypot(r - x, z - y);
      if (d < best) {
        best = d;
        line = i;
      }
    }
    return line;
  }

  protected override click(x: number, y: number): void {
    this.events.range([]);
    const line = this.nearest(x, y);
    if (line >= 0) this.events.mark(line);
  }

  protected override dragged(from: { x: number; y: number }, to: { x: number; y: number }, done: boolean): void {
    const box = {
      x0: Math.min(from.x, to.x),
      y0: Math.min(from.y, to.y),
      x1: Math.max(from.x, to.x),
      y1: Math.max(from.y, to.y),
    };
    this.box = done ? null : box;
    if (done) {
      const lines: number[] = [];
      for (let line = 0; this.grid && this.row >= 0 && line < this.grid.lines; line++) {
        const p = this.grid.point(this.row, line);
        if (!p) continue;
        const [r, z] = this.flat(p);
        if (r >= box.x0 && r <= box.x1 && z >= box.y0 && z <= box.y1) lines.push(line);
      }
      this.events.range(lines);
    }
    this.redraw();
  }
}
