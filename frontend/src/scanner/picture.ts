/** The live picture of the camera, with the stripe that was found drawn over it. */

import type { Seen } from "../protocol";
import { type Box, MARK, PlaneView } from "../ui/plane";

/** A picture, and the stripe that was found in it. */
export interface ShownPicture {
  header: Pick<Seen, "width" | "height" | "orientation">;
  image: ImageBitmap;
  /** Pixels across each line of the stripe; NaN where there is none. */
  stripe: Float32Array;
  /** Corners of a calibration board, u and v px in turn. */
  corners?: Float32Array;
}

const CORNER = "#7dff9a";

export class LiveView extends PlaneView {
  protected shown: ShownPicture | null = null;

  constructor(canvas: HTMLCanvasElement) {
    super(canvas, { equal: true, up: false });
  }

  show(picture: ShownPicture | null): void {
    const { shown } = this;
    const other =
      !shown ||
      !picture ||
      shown.header.width !== picture.header.width ||
      shown.header.height !== picture.header.height;
    this.shown = picture;
    if (other) this.refit();
    else this.redraw();
  }

  protected content(): Box | null {
    const header = this.shown?.header;
    return header ? { x0: -0.5, y0: -0.5, x1: header.width - 0.5, y1: header.height - 0.5 } : null;
  }

  protected paint(): void {
    const { shown, pen } = this;
    if (!shown) return;
    const { width, height, orientation } = shown.header;
    const [x0, y0] = this.toScreen(-0.5, -0.5);
    const [x1, y1] = this.toScreen(width - 0.5, height - 0.5);
    pen.imageSmoothingEnabled = Math.abs(this.kx) < 3;
    pen.drawImage(shown.image, x0, y0, x1 - x0, y1 - y0);
    pen.fillStyle = MARK;
    for (let line = 0; line < shown.stripe.length; line++) {
      const across = shown.stripe[line];
      if (Number.isNaN(across)) continue;
      const [x, y] = orientation === "vertical" ? this.toScreen(across, line) : this.toScreen(line, across);
      pen.fillRect(x - 0.75, y - 0.75, 1.5, 1.5);
    }
  }

  /** A ring about each corner of a board. */
  protected paintCorners(): void {
    const { shown, pen } = this;
    const corners = shown?.corners;
    if (!corners) return;
    pen.strokeStyle = CORNER;
    pen.lineWidth = 1.5;
    for (let k = 0; k < corners.length; k += 2) {
      const [x, y] = this.toScreen(corners[k], corners[k + 1]);
      pen.beginPath();
      pen.arc(x, y, 4, 0, 2 * Math.PI);
      pen.stroke();
    }
  }
}
