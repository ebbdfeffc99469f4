/** The camera's picture of the wizard: the board found in it, what was covered before, and where it is wanted next. */
import { effect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { isScanning, picture } from "../scanner/live";
import { LiveView, type ShownPicture } from "../scanner/picture";
import { devices, theme } from "../state";
import { Button } from "../ui/controls";
import type { Box } from "../ui/plane";
import { SpacePane } from "./space";
import { again, type Progress, poorest, progress, step } from "./state";

/** Corners in a cell from which it counts as full. */
const FULL = 12;
const SEEN = "#5db0ff";

class CoverageView extends LiveView {
  private covered: Progress | null = null;
  private wanted = false;

  cover(covered: Progress | null, wanted: boolean): void {
    this.covered = covered;
    this.wanted = wanted;
    this.redraw();
  }

  protected content(): Box | null {
    const box = super.content();
    const size = this.covered?.header;
    return box ?? (size && size.width > 1 ? { x0: 0, y0: 0, x1: size.width, y1: size.height } : null);
  }

  protected paint(): void {
    super.paint();
    if (this.covered && this.covered.header.width > 1) this.paintCoverage(this.covered);
    this.paintCorners();
  }

  private paintCoverage({ header, marked }: Progress): void {
    const { pen } = this;
    const { columns, rows, width, height, cells } = header;
    const w = width / columns;
    const h = height / rows;
    for (let k = 0; k < cells.length; k++) {
      const [x, y] = this.toScreen((k % columns) * w - 0.5, Math.floor(k / columns) * h - 0.5);
      const share = Math.min(cells[k] / FULL, 1);
      pen.fillStyle = share ? `rgb(93 176 255 / ${0.06 + 0.2 * share})` : "rgb(240 105 30 / 0.14)";
      pen.fillRect(x + 1, y + 1, w * this.kx - 2, h * this.ky - 2);
    }
    pen.fillStyle = SEEN;
    for (let k = 0; k < marked.length; k += 3) {
      const [x, y] = this.toScreen(marked[k], marked[k + 1]);
      pen.fillRect(x - 1, y - 1, 2, 2);
    }
    if (!this.wanted) return;
    const { row, column } = poorest(header);
    const [x, y] = this.toScreen((column * width) / 3, (row * height) / 3);
    pen.strokeStyle = "#f0b429";
    pen.lineWidth = 2;
    pen.setLineDash([8, 5]);
    pen.strokeRect(x + 3, y + 3, (width / 3) * this.kx - 6, (height / 3) * this.ky - 6);
    pen.setLineDash([]);
  }
}

export function BoardPane() {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const view = new CoverageView(canvas.current!);
    const off = effect(() => {
      void theme.value;
      view.show(again.value?.shown ?? picture.value);
      view.cover(progress.value, step.value === "camera");
    });
    return () => {
      off();
      view.dispose();
    };
  }, []);
  const shown: ShownPicture | null = again.value?.shown ?? picture.value;
  const live = devices.value?.looking || isScanning();
  const found = (shown?.corners?.length ?? 0) / 2;
  return (
    <section class="pane live" aria-label="Camera">
      <header>
        <h2>{again.value ? `Picture ${again.value.view}` : "Camera"}</h2>
        {shown && (
          <span class="about" role="status">
            {!again.value && !live && "last picture · "}
            {found ? `${found} corners of the board` : (!again.value && picture.value?.header.failure) || "no board"}
          </span>
        )}
        {again.value && (
          <Button icon="close" small label="Back to the live picture" onClick={() => (again.value = null)} />
        )}
      </header>
      <div class="stage">
        <canvas ref={canvas} aria-label="Picture with the corners of the board, and what was covered" role="img" />
        {!shown && !progress.value && <div class="empty">Pictures of the board appear here.</div>}
      </div>
      <SpacePane />
      {progress.value && progress.value.header.width > 1 && (
        <div class="key">
          <span>
            <span class="swatch" style={{ background: SEEN }} />
            corners seen: {Math.round(100 * progress.value.header.coverage)} % of the picture
          </span>
          <span>
            <span class="swatch" style={{ background: "#f0691e" }} />
            nothing seen yet
          </span>
          {step.value === "camera" && (
            <span>
              <span class="swatch" style={{ background: "#f0b429" }} />
              wanted next
            </span>
          )}
        </div>
      )}
    </section>
  );
}
