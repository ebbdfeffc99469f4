/** The whole scan as a picture: one column a step, one row a line. */
import { cividis } from "../mesh/colours";
import { CAUSES, type Rgb } from "../palette";
import { figure } from "../ui/controls";
import { type Box, MARK, PlaneView } from "../ui/plane";
import type { Grid } from "./data";

export const GRID_COLOURINGS = ["quality", "sigma", "amplitude", "cause", "edits"] as const;
export type GridColouring = (typeof GRID_COLOURINGS)[number];

/** Steps and lines, both ends included. */
export interface Range {
  steps: [number, number];
  lines: [number, number];
}

export interface GridEvents {
  mark: (step: number, line: number) => void;
  range: (range: Range | null) => void;
}

/** What a mark of the stripe makes doubtful, the worst first. */
const QUALITY: readonly (readonly [number, Rgb, string])[] = [
  [4, [204, 121, 167], "ambiguous"],
  [8, [240, 228, 66], "saturated"],
  [16, [213, 94, 0], "stray light"],
  [128, [230, 159, 0], "grazing"],
];
/** By how many times the usual uncertainty of its grid a point is worse, the worst first. */
const UNSURE: readonly (readonly [number, Rgb, string])[] = [
  [3, [196, 60, 60], "uncertainty over 3 × the usual"],
  [1.5, [222, 184, 135], "over 1.5 ×"],
];
/** Marks that a point may have and be good. */
const HARMLESS: readonly (readonly [number, Rgb, string])[] = [
  [32, [0, 114, 178], "edge"],
  [64, [150, 190, 170], "several candidates"],
];
const GOOD: Rgb = [120, 160, 190];
/** Of what is there, where the colours tell of something else. */
const MEASURED: Rgb = [88, 104, 122];
const EDITS: readonly Rgb[] = [MEASURED, [230, 159, 0], [213, 94, 0], [86, 180, 233]];
const EDIT_WORDS = ["as measured", "moved or picked", "deleted", "added"];

export interface Key {
  colour: Rgb;
  text: string;
}

export class GridView extends PlaneView {
  private grid: Grid | null = null;
  private by: GridColouring = "quality";
  private readonly image = document.createElement("canvas");
  private at: { row: number; line: number } | null = null;
  private range: Range | null = null;
  private drawing: Box | null = null;

  constructor(
    canvas: HTMLCanvasElement,
    private readonly events: GridEvents,
  ) {
    super(canvas, { equal: false, up: false });
  }

  show(grid: Grid | null, by: GridColouring, step: number, line: number, range: Range | null): void {
    const other = grid?.lines !== this.grid?.lines || grid?.steps.length !== this.grid?.steps.length;
    const again = grid !== this.grid || by !== this.by;
    this.grid = grid;
    this.by = by;
    this.range = range;
    const row = grid ? grid.row(step) : -1;
    this.at = row >= 0 && line >= 0 ? { row, line } : null;
    if (again) this.fill();
    if (other) this.refit();
    if (this.at && !other) this.reveal(this.at.row + 0.5, this.at.line + 0.5);
    this.redraw();
  }

  /** Where a step and a line are in the window, CSS pixels. */
  cell(step: number, line: number): { x: number; y: number } | null {
    const row = this.grid ? this.grid.row(step) : -1;
    return row < 0 ? null : this.windowPlace(row + 0.5, line + 0.5);
  }

  private fill(): void {
    const { grid } = this;
    if (!grid) return;
    const [s, n] = [grid.steps.length, grid.lines];
    this.image.width = s;
    this.image.height = n;
    const picture = new ImageData(s, n);
    const colour = this.rule(grid);
    for (let row = 0; row < s; row++) {
      const dim = grid.off[row] ? 0.35 : 1;
      for (let line = 0; line < n; line++) {
        const c = colour(row * n + line);
        if (!c) continue;
        const to = 4 * (line * s + row);
        picture.data[to] = c[0] * dim;
        picture.data[to + 1] = c[1] * dim;
        picture.data[to + 2] = c[2] * dim;
        picture.data[to + 3] = 255;
      }
    }
    this.image.getContext("2d")!.putImageData(picture, 0, 0);
  }

  /** A colour for every place of the grid; null where it stays empty. */
  private rule(grid: Grid): (i: number) => Rgb | null {
    const there = (i: number) => !Number.isNaN(grid.points[3 * i]);
    switch (this.by) {
      case "quality":
        return qualityOf(grid, there);
      case "sigma":
      case "amplitude": {
        const [low, high] = ends(grid[this.by]);
        return (i) => (there(i) ? cividis((grid[this.by as "sigma"][i] - low) / (high - low || 1)) : null);
      }
      case "cause":
        return (i) => (there(i) ? MEASURED : (CAUSES[grid.cause[i] - 1] ?? null));
      case "edits":
        return (i) => (grid.edited[i] || there(i) ? EDITS[grid.edited[i]] : null);
    }
  }

  /** What the colours mean. */
  static key(grid: Grid, by: GridColouring): Key[] {
    switch (by) {
      case "quality":
        return [
          { colour: GOOD, text: "good" },
          ...[...HARMLESS, ...UNSURE.toReversed(), ...QUALITY].map(([, colour, text]) => ({ colour, text })),
        ];
      case "cause": {
        const used = new Set(grid.cause);
        return grid.header.causes
          .map((text, i) => ({
            colour: i ? CAUSES[i - 1] : MEASURED,
            text: text || "measured",
            i,
          }))
          .filter(({ i }) => used.has(i));
      }
      case "edits":
        return EDITS.map((colour, i) => ({ colour, text: EDIT_WORDS[i] }));
      default: {
        const [low, high] = ends(grid[by]);
        const unit = by === "sigma" ? " mm" : "";
        return [
          { colour: cividis(0), text: `${figure(low, 2)}${unit}` },
          { colour: cividis(0.5), text: "" },
          { colour: cividis(1), text: `${figure(high, 2)}${unit}` },
        ];
      }
    }
  }

  protected content(): Box | null {
    const { grid } = this;
    if (!grid) return null;
    // Lines that no step of the scan sees are beside the part.
    let [first, last] = [grid.lines, -1];
    for (let i = 0; i < grid.flags.length; i++) {
      if (Number.isNaN(grid.points[3 * i])) continue;
      const line = i % grid.lines;
      first = Math.min(first, line);
      last = Math.max(last, line);
    }
    if (last < 0) [first, last] = [0, grid.lines - 1];
    return { x0: 0, y0: Math.max(0, first - 6), x1: grid.steps.length, y1: Math.min(grid.lines, last + 7) };
  }

  protected paint(): void {
    const { pen, grid } = this;
    if (!grid) return;
    const [x, y] = this.toScreen(0, 0);
    pen.imageSmoothingEnabled = this.kx < 1;
    pen.drawImage(this.image, x, y, this.kx * grid.steps.length, this.ky * grid.lines);
    const range = this.drawing ?? (this.range && this.rows(this.range));
    if (range) {
      const [ax, ay] = this.toScreen(range.x0, range.y0);
      const [bx, by] = this.toScreen(range.x1, range.y1);
      pen.strokeStyle = MARK;
      pen.fillStyle = `${MARK}33`;
      pen.lineWidth = 1.5;
      pen.fillRect(ax, ay, bx - ax, by - ay);
      pen.strokeRect(ax, ay, bx - ax, by - ay);
    }
    if (this.at) this.cross(this.at.row + 0.5, this.at.line + 0.5);
  }

  private rows(range: Range): Box {
    const { grid } = this;
    return {
      x0: grid!.row(range.steps[0]),
      y0: range.lines[0],
      x1: grid!.row(range.steps[1]) + 1,
      y1: range.lines[1] + 1,
    };
  }

  private cross(x: number, y: number): void {
    const { pen } = this;
    const [sx, sy] = this.toScreen(x, y);
    pen.strokeStyle = MARK;
    pen.lineWidth = 1;
    pen.globalAlpha = 0.8;
    pen.beginPath();
    pen.moveTo(sx, 0);
    pen.lineTo(sx, this.height);
    pen.moveTo(0, sy);
    pen.lineTo(this.width, sy);
    pen.stroke();
    pen.globalAlpha = 1;
    pen.lineWidth = 2;
    pen.beginPath();
    pen.arc(sx, sy, 5, 0, 2 * Math.PI);
    pen.stroke();
  }

  private inside(x: number, y: number): { row: number; line: number } {
    const { grid } = this;
    return {
      row: Math.max(0, Math.min(grid!.steps.length - 1, Math.floor(x))),
      line: Math.max(0, Math.min(grid!.lines - 1, Math.floor(y))),
    };
  }

  protected override click(x: number, y: number): void {
    if (!this.grid) return;
    const { row, line } = this.inside(x, y);
    this.events.range(null);
    this.events.mark(this.grid.steps[row], line);
  }

  protected override dragged(from: { x: number; y: number }, to: { x: number; y: number }, done: boolean): void {
    const { grid } = this;
    if (!grid) return;
    const a = this.inside(Math.min(from.x, to.x), Math.min(from.y, to.y));
    const b = this.inside(Math.max(from.x, to.x), Math.max(from.y, to.y));
    this.drawing = done ? null : { x0: a.row, y0: a.line, x1: b.row + 1, y1: b.line + 1 };
    if (done) this.events.range({ steps: [grid.steps[a.row], grid.steps[b.row]], lines: [a.line, b.line] });
    this.redraw();
  }
}

/** The worst thing that is known of each point. */
function qualityOf(grid: Grid, there: (i: number) => boolean): (i: number) => Rgb | null {
  const usual = quantile(sampled(grid.sigma), 0.5);
  const marked = (marks: typeof QUALITY, i: number) => marks.find(([bit]) => grid.flags[i] & bit)?.[1];
  return (i) => {
    if (!there(i)) return null;
    const times = grid.sigma[i] / usual;
    return marked(QUALITY, i) ?? UNSURE.find(([limit]) => times > limit)?.[1] ?? marked(HARMLESS, i) ?? GOOD;
  };
}

function sampled(values: Float32Array): Float32Array {
  const every = Math.max(1, Math.floor(values.length / 20000));
  return values.filter((value, i) => i % every === 0 && !Number.isNaN(value)).sort();
}

function quantile(sorted: Float32Array, share: number): number {
  return sorted[Math.round(share * (sorted.length - 1))] ?? Number.NaN;
}

function ends(values: Float32Array): [number, number] {
  const some = sampled(values);
  return some.length ? [quantile(some, 0.02), quantile(some, 0.98)] : [0, 1];
}
