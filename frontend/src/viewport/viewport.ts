/** The surface on the screen, what is selected of it, and the hand on the mouse. No UI framework. */
import { type Colouring, colourVertices, type Legend } from "../mesh/colours";
import type { Bounds, MeshModel, Part } from "../mesh/model";
import { Topology } from "../mesh/topology";
import { along, type Vec, ViewCamera, type ViewName } from "./camera";
import type { Cylinder } from "./cylinder";
import { type HandledView, Hands } from "./hands";
import { type Item, Overlay } from "./overlay";
import { Painter } from "./painter";
import { type Hit, pick } from "./pick";
import { type DepthPicture, Projection } from "./region";
import { type Mode, marked, Selection } from "./selection";
import { type CutPlane, Surface } from "./surface";
import type { Tool } from "./tools";

export interface ViewportEvents {
  /** A click that met the surface. */
  pick: (hit: Hit) => void;
  selection: (count: number) => void;
  /** A stroke of the smoothing brush has ended over these faces. */
  smooth: (faces: Uint32Array<ArrayBuffer>) => void;
  plane: (plane: CutPlane) => void;
  cylinder?: (cylinder: Cylinder) => void;
  /** The view was turned, shifted or resized. */
  looked?: () => void;
  legend: (legend: Legend | null) => void;
  context: (state: "lost" | "restored") => void;
}

export class Viewport implements HandledView {
  readonly camera = new ViewCamera();
  readonly selection = new Selection();
  readonly overlay: Overlay;
  mesh: MeshModel | null = null;
  /** What is only looked at: there is no mesh yet, so nothing of it is picked, selected or edited. */
  private first: MeshModel | null = null;
  private inHand: Tool = "navigate";
  visibleOnly = true;
  /** CSS pixels */
  brushRadius = 24;
  /** Radians: how sharp an edge may be inside a region. */
  angleLimit = (20 * Math.PI) / 180;
  private readonly painter: Painter;
  private readonly surface = new Surface();
  private readonly hands: Hands;
  private readonly watch: ResizeObserver;
  private colouring: Colouring = "plain";
  private plane: CutPlane | null = null;
  private topologyKept: Topology | null = null;
  private projectionKept: { camera: number; mesh: number; of: Projection } | null = null;
  private drawn = 0;
  private facesDrawn = 0;
  private looked = -1;
  private restTimer: ReturnType<typeof setTimeout> | undefined;
  private asked = false;
  private moving = false;

  constructor(
    private readonly host: HTMLElement,
    readonly events: ViewportEvents,
  ) {
    const canvas = host.appendChild(document.createElement("canvas"));
    const glass = host.appendChild(document.createElement("canvas"));
    canvas.className = "surface-canvas";
    glass.className = "glass-canvas";
    this.painter = new Painter(canvas);
    // After the painter's own listeners, which forget the colours.
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      events.context("lost");
    });
    canvas.addEventListener("webglcontextrestored", () => {
      this.restyle();
      events.context("restored");
    });
    this.overlay = new Overlay(glass, this.camera);
    this.hands = new Hands(glass, this);
    this.watch = new ResizeObserver(() => this.resize());
    this.watch.observe(host);
    this.restyle();
    this.resize();
  }

  dispose(): void {
    this.watch.disconnect();
    this.hands.dispose();
    clearTimeout(this.restTimer);
    this.painter.dispose();
    this.host.replaceChildren();
  }

  get tool(): Tool {
    return this.inHand;
  }

  set tool(tool: Tool) {
    this.inHand = tool;
    this.hands.dropped();
  }

  /** Pictures drawn so far, for tests and benchmarks. */
  get pictures(): number {
    return this.drawn;
  }

  /** Faces of the surface in the picture on the screen. */
  get drawnFaces(): number {
    return this.facesDrawn;
  }

  get fullMs(): number {
    return this.painter.fullMs;
  }

  get gpu(): string {
    return this.painter.gpu();
  }

  /** How many selected faces look away from the eye: none, where visible faces only is selected. */
  selectedAway(): number {
    const projection = this.projection();
    return projection ? this.selection.numbers().filter((face) => !projection.looksAtEye(face)).length : 0;
  }

  /** Where a point of the part is in the window, CSS pixels. */
  windowPlace(point: Vec): { x: number; y: number } {
    const box = this.host.getBoundingClientRect();
    const [x, y] = this.overlay.place(point);
    return { x: box.left + x, y: box.top + y };
  }

  /** Where a handle is in the window, CSS pixels. */
  handlePlace(part: string): { x: number; y: number } | null {
    const box = this.host.getBoundingClientRect();
    const found = this.overlay.handles().find((one) => one.part === part);
    return found ? { x: box.left + found.at[0], y: box.top + found.at[1] } : null;
  }

  // The mesh and its changes

  /** Show another mesh; `keepView` where it is another epoch of the same part. */
  setMesh(mesh: MeshModel | null, keepView = false): void {
    this.mesh = mesh;
    this.first = null;
    this.topologyKept = this.projectionKept = null;
    this.selection.set(new Uint8Array(mesh?.faceCount ?? 0));
    this.surface.setMesh(mesh);
    this.recolour();
    this.refreshBorders();
    this.selectionChanged();
    const box = mesh?.bounds();
    if (box) {
      this.camera.contain(box);
      if (!keepView) this.camera.fit(box);
    }
    this.repaint();
  }

  /** Show a surface to look at until there is a mesh. */
  setFirst(model: MeshModel): void {
    this.setMesh(null);
    this.first = model;
    this.surface.setMesh(model);
    this.surface.tint(colourVertices(model, "plain").rgba);
    this.surface.showUnmeasured(false);
    const box = model.bounds();
    if (!box) return;
    this.camera.contain(box);
    this.camera.fit(box);
    this.repaint();
  }

  /** Show what the parts of a patch have done to the mesh. */
  patched(parts: readonly Part[]): void {
    const { mesh } = this;
    if (!mesh) return;
    if (parts.every((part) => part.kind === "alive")) this.surface.touched(parts.map(({ faces }) => faces));
    else {
      this.surface.vertices();
      this.recolour();
      const box = mesh.bounds();
      if (box) this.camera.contain(box);
    }
    this.surface.showPreview(null);
    this.selection.follow(mesh);
    this.refreshBorders();
    this.selectionChanged();
    this.repaint();
  }

  setColouring(by: Colouring): void {
    this.colouring = by;
    this.recolour();
    this.repaint();
  }

  private recolour(): void {
    if (!this.mesh) {
      this.events.legend(null);
      return;
    }
    const { rgba, legend } = colourVertices(this.mesh, this.colouring);
    this.surface.tint(rgba);
    this.surface.showUnmeasured(this.colouring !== "plain" && this.colouring !== "height");
    this.events.legend(legend);
  }

  private bordersShown = true;

  showBorders(on: boolean): void {
    this.bordersShown = on;
    this.refreshBorders();
    this.repaint();
  }

  private refreshBorders(): void {
    this.surface.showBorders(this.bordersShown);
  }

  showPreview(change: { positions: Float32Array; faces: Uint32Array; dead: Uint32Array } | null): void {
    this.surface.showPreview(change);
    this.redraw();
  }

  /** Show a plane with its handles; where it cuts, what goes is tinted. */
  setPlane(plane: CutPlane | null, cuts: boolean): void {
    this.plane = plane;
    const box = this.mesh?.bounds();
    this.overlay.plane = plane && box ? { ...placed(plane, box), normal: plane.normal } : null;
    this.surface.setPlane(cuts ? plane : null);
    this.repaint();
  }

  setCylinder(cylinder: Cylinder | null): void {
    this.overlay.cylinder = cylinder;
    this.redraw();
  }

  /** Look as another view does, without a word to those who follow this one. */
  lookLike(other: ViewCamera): void {
    const { target, distance, azimuth, elevation, orthographic } = other;
    Object.assign(this.camera, { target: [...target], distance, azimuth, elevation, orthographic });
    this.camera.version += 1;
    this.looked = this.camera.version;
    this.repaint();
  }

  get cutPlane(): CutPlane | null {
    return this.plane;
  }

  // Marks

  setItems(items: Item[]): void {
    this.overlay.items = items;
    this.redraw();
  }

  // Selecting

  topology(): Topology | null {
    if (this.mesh && this.topologyKept?.version !== this.mesh.topology) this.topologyKept = new Topology(this.mesh);
    return this.topologyKept;
  }

  projection(): Projection | null {
    const { mesh, camera, projectionKept: kept } = this;
    if (!mesh) return null;
    if (kept && kept.camera === camera.version && kept.mesh === mesh.version) return kept.of;
    const of = new Projection(mesh, camera);
    this.projectionKept = { camera: camera.version, mesh: mesh.version, of };
    return of;
  }

  /** The depth of what is seen, or null where selecting goes through. */
  seen(): DepthPicture | null {
    return this.visibleOnly ? this.painter.seen(this.camera, this.surface.base) : null;
  }

  pick(x: number, y: number): Hit | null {
    return this.mesh && pick(this.mesh, this.camera.ray(x, y));
  }

  select(faces: Iterable<number>, mode: Mode): void {
    this.selection.combine(faces, mode);
    this.selectionChanged();
  }

  selectAll(): void {
    if (this.mesh) this.select(marked(this.mesh.alive.subarray(0, this.mesh.faceCount)), "replace");
  }

  clearSelection(): void {
    this.selection.clear();
    this.selectionChanged();
  }

  invert(): void {
    if (!this.mesh) return;
    this.selection.invert(this.mesh);
    this.selectionChanged();
  }

  grow(): void {
    const grown = this.topology()?.grow(this.selection.faces);
    if (grown) this.select(marked(grown), "replace");
  }

  shrink(): void {
    const shrunk = this.topology()?.shrink(this.selection.faces);
    if (shrunk) this.select(marked(shrunk), "replace");
  }

  flood(face: number, mode: Mode): void {
    const topology = this.topology();
    if (!topology) return;
    const limited = this.tool === "angle";
    this.select(marked(limited ? topology.smooth([face], this.angleLimit) : topology.connected([face])), mode);
  }

  /** Select the living faces that a rule over their vertices takes: by laser, step, quality … */
  selectWhere(takes: (face: number, a: number, b: number, c: number) => boolean, mode: Mode): void {
    const { mesh } = this;
    if (!mesh) return;
    const out: number[] = [];
    for (let face = 0; face < mesh.faceCount; face++) {
      if (!mesh.alive[face]) continue;
      const at = 3 * face;
      if (takes(face, mesh.faces[at], mesh.faces[at + 1], mesh.faces[at + 2])) out.push(face);
    }
    this.select(out, mode);
  }

  private selectionChanged(): void {
    this.surface.select(this.selection.numbers());
    this.events.selection(this.selection.count);
    this.redraw();
  }

  // Looking

  view(name: ViewName): void {
    this.camera.view(name);
    this.repaint();
  }

  toggleOrthographic(): void {
    this.camera.orthographic = !this.camera.orthographic;
    this.camera.version += 1;
    this.repaint();
  }

  /** All of it, or what is selected. */
  fit(selected = false): void {
    const only = selected && this.selection.count ? this.selection.faces : undefined;
    const box = (this.mesh ?? this.first)?.bounds(only);
    if (!box) return;
    this.camera.fit(box);
    this.repaint();
  }

  lookAt(point: Vec, size: number, fromOutside = true): void {
    const middle = this.mesh?.bounds();
    const outwards: Vec | null =
      fromOutside && middle
        ? [
            point[0] - (middle.low[0] + middle.high[0]) / 2,
            point[1] - (middle.low[1] + middle.high[1]) / 2,
            0.25 * size,
          ]
        : null;
    this.camera.lookAt(point, outwards, size);
    this.repaint();
  }

  /** The view moves: coarse while it does where a full picture is slow, full when it rests. */
  moved(): void {
    this.moving = this.painter.tooSlowToMove;
    clearTimeout(this.restTimer);
    if (this.moving) {
      this.surface.prepareCoarse(this.painter.coarseFaces);
      this.restTimer = setTimeout(() => {
        this.moving = false;
        this.repaint();
      }, 160);
    }
    this.repaint();
  }

  // Drawing

  /** Colours of the page, after the theme has changed. */
  restyle(): void {
    const style = getComputedStyle(this.host);
    this.painter.setBackground(style.getPropertyValue("--view").trim() || "#171b21");
    this.overlay.ink = style.getPropertyValue("--ink-2").trim() || "#d7dee8";
    this.redraw();
  }

  /** The surface itself looks different. */
  repaint(): void {
    this.painter.invalidate();
    this.redraw();
  }

  /** Only what lies over the surface looks different. */
  redraw(): void {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.draw();
    });
  }

  private draw(): void {
    if (this.host.clientWidth === 0) return;
    if (this.moving) this.painter.paintCoarse(this.camera, this.surface.coarse);
    else this.painter.paint(this.camera, this.surface.base, this.surface.overlay);
    this.overlay.draw();
    this.drawn += 1;
    this.facesDrawn = (this.mesh ?? this.first)?.aliveCount ?? 0;
    if (this.looked === this.camera.version) return;
    this.looked = this.camera.version;
    this.events.looked?.();
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.host;
    // A hidden view has no size: it keeps the one it had.
    if (width === 0 || height === 0) return;
    this.camera.resize(width, height);
    this.painter.resize(width, height);
    this.overlay.resize(width, height);
    this.draw();
  }
}

/** Where to draw the plane: in the middle of what it cuts. */
function placed(plane: CutPlane, box: Bounds): { centre: Vec; size: number } {
  const middle = [0, 1, 2].map((i) => (box.low[i] + box.high[i]) / 2) as Vec;
  const above = plane.offset - plane.normal.reduce((sum, n, i) => sum + n * middle[i], 0);
  const size = 0.6 * Math.hypot(...box.high.map((x, i) => x - box.low[i]));
  return { centre: along(middle, plane.normal, above), size };
}
