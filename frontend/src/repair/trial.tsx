/** What settings would make, beside what is: profiles over each other, and a patch of surface. */
import { useSignalEffect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { colourVertices } from "../mesh/colours";
import { theme } from "../state";
import { count } from "../ui/controls";
import { type Box, PlaneView } from "../ui/plane";
import { OwnView } from "../verbs/ownview";
import { refusal, type Tried, type Trouble, trial, trouble, trying } from "./choices";
import { MapKey } from "./mapkey";

const OLD = "#3fb8f2";
const NEW = "#f0691e";

class TrialPlot extends PlaneView {
  private shown: Tried | null = null;

  constructor(canvas: HTMLCanvasElement) {
    super(canvas, { equal: true, up: true });
  }

  show(tried: Tried | null): void {
    const same = JSON.stringify(tried?.header.steps) === JSON.stringify(this.shown?.header.steps);
    this.shown = tried;
    if (!same) this.refit();
    this.redraw();
  }

  /** Profiles stand beside each other: each so far to the right, mm. */
  private get pitch(): number {
    let reach = 1;
    for (const pair of this.shown?.profiles ?? [])
      for (const points of pair)
        for (let i = 0; i < points.length; i += 3)
          if (!Number.isNaN(points[i])) reach = Math.max(reach, Math.hypot(points[i], points[i + 1]));
    return 1.25 * reach;
  }

  protected content(): Box | null {
    const box: Box = { x0: 0, y0: Infinity, x1: this.pitch * (this.shown?.profiles.length ?? 1), y1: -Infinity };
    for (const pair of this.shown?.profiles ?? [])
      for (const points of pair)
        for (let i = 0; i < points.length; i += 3) {
          if (Number.isNaN(points[i])) continue;
          box.y0 = Math.min(box.y0, points[i + 2]);
          box.y1 = Math.max(box.y1, points[i + 2]);
        }
    return box.y1 > box.y0 ? box : null;
  }

  protected paint(): void {
    const { pen, pitch } = this;
    const { faint } = this.colours();
    for (const [k, [before, after]] of (this.shown?.profiles ?? []).entries()) {
      this.curve(before, k * pitch, OLD, 4);
      this.curve(after, k * pitch, NEW, 1.5);
      const [x] = this.toScreen(k * pitch, 0);
      pen.fillStyle = faint;
      pen.fillText(`step ${this.shown?.header.steps[k]}`, x + 4, this.height - 6);
    }
  }

  private curve(points: Float32Array, right: number, colour: string, width: number): void {
    const { pen } = this;
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.beginPath();
    let pending = false;
    for (let i = 0; i < points.length; i += 3) {
      if (Number.isNaN(points[i])) {
        pending = false;
        continue;
      }
      const [x, y] = this.toScreen(right + Math.hypot(points[i], points[i + 1]), points[i + 2]);
      if (pending) pen.lineTo(x, y);
      else pen.moveTo(x, y);
      pending = true;
    }
    pen.stroke();
  }
}

const points = (of: Float32Array) => of.reduce((n, x, i) => n + Number(i % 3 === 0 && !Number.isNaN(x)), 0);

function Why({ of: { text, hint } }: { of: Trouble }) {
  return (
    <div class="empty" role={refusal.value ? "alert" : undefined}>
      <strong>{text}</strong>
      <span>{hint}</span>
    </div>
  );
}

function Words() {
  const now = trial.value;
  if (refusal.value) return <Why of={refusal.value} />;
  return now ? null : <div class="empty">Trying …</div>;
}

export function TrialProfiles() {
  const canvas = useRef<HTMLCanvasElement>(null);
  const plot = useRef<TrialPlot | null>(null);
  useEffect(() => {
    plot.current = new TrialPlot(canvas.current!);
    plot.current.show(trial.peek());
    return () => plot.current?.dispose();
  }, []);
  useSignalEffect(() => {
    void theme.value;
    plot.current?.show(trial.value);
  });
  const now = trial.value;
  const first = now?.profiles[0];
  return (
    <section class="pane" aria-label="Profiles with both settings">
      <header>
        <h2>Profiles</h2>
        <span class="about" role="status">
          {first && `${points(first[0])} → ${points(first[1])} points${trying.value ? " · trying …" : ""}`}
        </span>
      </header>
      <div class="stage">
        <canvas ref={canvas} tabIndex={0} role="img" aria-label="Profiles: radius against height, before and after" />
        <Words />
      </div>
      <div class="key">
        <span>
          <span class="swatch" style={{ background: OLD }} />
          in use
        </span>
        <span>
          <span class="swatch" style={{ background: NEW }} />
          as typed
        </span>
        {now?.header.findings
          .filter(({ severity }) => severity !== "error")
          .map(({ text }) => (
            <span key={text}>{text}</span>
          ))}
      </div>
    </section>
  );
}

/** The same patch of surface with the settings in use and with those that are typed. */
export function TrialPatch() {
  const now = trial.value;
  const end = now?.new && now.old ? colourVertices(now.new, "deviation").legend?.high : undefined;
  return (
    <div class="pair">
      {(
        [
          ["old", "Patch, in use"],
          ["new", "Patch, as typed"],
        ] as const
      ).map(([side, title]) => (
        <section class="pane" key={side} aria-label={title}>
          <header>
            <h2>{title}</h2>
          </header>
          <OwnView
            label={title}
            mesh={now?.[side] ?? null}
            by={side === "new" ? "deviation" : "plain"}
            together="trial"
          />
          {side === "new" && now && !now.new && trouble.value && <Why of={trouble.value} />}
          <div class="key">
            <span>{now && `${count(now[side]?.aliveCount ?? 0)} triangles`}</span>
            {side === "new" && end !== undefined && <MapKey end={end} from="the patch in use" />}
          </div>
        </section>
      ))}
    </div>
  );
}
