/** The camera's picture of a profile, with the stripe and the other candidates drawn over it. */
import { type Box, MARK, PlaneView } from "../ui/plane";
import type { Profile } from "./data";

export interface PictureEvents {
  mark: (line: number) => void;
  /** Take the candidate at this place. */
  candidate: (line: number, position: number) => void;
  /** Put the stripe of a line here. */
  place: (line: number, position: number) => void;
}

export type PictureTool = "mark" | "candidate" | "place";

export class PictureView extends PlaneView {
  tool: PictureTool = "mark";
  private profile: Profile | null = null;
  private line = -1;
  private image: HTMLImageElement | null = null;
  private address = "";

  constructor(
    canvas: HTMLCanvasElement,
    private readonly events: PictureEvents,
  ) {
    super(canvas, { equal: true, up: false });
  }

  show(profile: Profile | null, address: string, line: number): void {
    const first = !this.profile;
    this.profile = profile;
    const jumped = line !== this.line;
    this.line = line;
    if (address !== this.address) {
      this.address = address;
      const image = new Image();
      image.onload = () => {
        this.image = image;
        this.redraw();
      };
      if (address) image.src = address;
    }
    if (first) this.refit();
    const at = profile && line >= 0 ? this.spot(line) : null;
    if (at && jumped && !first) this.reveal(...at);
    this.redraw();
  }

  /** Come near to the line that is marked. */
  zoomToMark(): void {
    const at = this.line >= 0 ? this.spot(this.line) : null;
    if (at) this.fit({ x0: at[0] - 24, y0: at[1] - 16, x1: at[0] + 24, y1: at[1] + 16 });
  }

  private spot(line: number): [number, number] | null {
    const { profile } = this;
    if (!profile) return null;
    const position = profile.position[line];
    if (!Number.isNaN(position)) return profile.pixel(line, position);
    const [first] = profile.of(line);
    const { orientation, width, height } = profile.header;
    return profile.pixel(line, first ? first.position : (orientation === "vertical" ? width : height) / 2);
  }

  protected content(): Box | null {
    const { profile } = this;
    if (!profile) return null;
    const { width, height } = profile.header;
    const box: Box = { x0: Infinity, y0: Infinity, x1: -Infinity, y1: -Infinity };
    for (let line = 0; line < profile.lines; line++) {
      for (const { position } of profile.of(line)) {
        const [u, v] = profile.pixel(line, position);
        box.x0 = Math.min(box.x0, u);
        box.x1 = Math.max(box.x1, u);
        box.y0 = Math.min(box.y0, v);
        box.y1 = Math.max(box.y1, v);
      }
    }
    return box.x0 <= box.x1 ? box : { x0: 0, y0: 0, x1: width, y1: height };
  }

  protected paint(): void {
    const { pen, profile, image } = this;
    if (!profile) return;
    const { width, height } = profile.header;
    // (0, 0) is the middle of the first pixel, so the picture begins half a pixel before it.
    const [x0, y0] = this.toScreen(-0.5, -0.5);
    pen.fillStyle = "#000";
    pen.fillRect(x0, y0, this.kx * width, this.ky * height);
    pen.imageSmoothingEnabled = this.kx < 3;
    if (image) pen.drawImage(image, x0, y0, this.kx * width, this.ky * height);
    const seen = this.visible();
    const vertical = profile.header.orientation === "vertical";
    const from = Math.max(0, Math.floor(vertical ? seen.y0 : seen.x0));
    const to = Math.min(profile.lines - 1, Math.ceil(vertical ? seen.y1 : seen.x1));
    if (this.line >= 0) this.hairline(vertical);
    for (let line = from; line <= to; line++) this.marks(profile, line);
  }

  private hairline(vertical: boolean): void {
    const { pen } = this;
    const [x, y] = this.toScreen(this.line, this.line);
    pen.strokeStyle = MARK;
    pen.globalAlpha = 0.6;
    pen.lineWidth = 1;
    pen.beginPath();
    if (vertical) {
      pen.moveTo(0, y);
      pen.lineTo(this.width, y);
    } else {
      pen.moveTo(x, 0);
      pen.lineTo(x, this.height);
    }
    pen.stroke();
    pen.globalAlpha = 1;
  }

  private marks(profile: Profile, line: number): void {
    const { pen } = this;
    const near = this.kx > 3 || line === this.line;
    for (const candidate of profile.of(line)) {
      if (candidate.chosen) continue;
      const [x, y] = this.toScreen(...profile.pixel(line, candidate.position));
      pen.strokeStyle = "#4aa8ff";
      pen.lineWidth = near ? 1.5 : 1;
      pen.beginPath();
      pen.arc(x, y, near ? 4 : 2, 0, 2 * Math.PI);
      pen.stroke();
    }
    const position = profile.position[line];
    if (Number.isNaN(position)) return;
    const [x, y] = this.toScreen(...profile.pixel(line, position));
    pen.fillStyle = profile.chosen[line] === -2 ? "#e6b422" : MARK;
    pen.beginPath();
    pen.arc(x, y, line === this.line ? 4 : near ? 2.5 : 1, 0, 2 * Math.PI);
    pen.fill();
  }

  protected override click(x: number, y: number, event: PointerEvent): void {
    const { profile } = this;
    if (!profile) return;
    const vertical = profile.header.orientation === "vertical";
    const line = Math.round(vertical ? y : x);
    const across = vertical ? x : y;
    if (line < 0 || line >= profile.lines) return;
    if (this.tool === "place" || event.shiftKey) {
      this.events.place(line, across);
      return;
    }
    if (this.tool === "candidate") {
      const near = profile
        .of(line)
        .toSorted((a, b) => Math.abs(a.position - across) - Math.abs(b.position - across))[0];
      if (near && Math.abs(near.position - across) < 12 / Math.abs(this.kx) + 2) {
        this.events.candidate(line, near.position);
        return;
      }
    }
    this.events.mark(line);
  }

  protected override dragged(from: { x: number; y: number }, to: { x: number; y: number }, done: boolean): void {
    if (!done || this.tool !== "place" || !this.profile) return;
    const vertical = this.profile.header.orientation === "vertical";
    const line = Math.round(vertical ? from.y : from.x);
    if (line >= 0 && line < this.profile.lines) this.events.place(line, vertical ? to.x : to.y);
  }
}
