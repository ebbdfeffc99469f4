/** The one viewport of the page: rooms show it in turn, and it keeps its picture and its view. */
import { signal } from "@preact/signals";
import type { Colouring, Legend } from "../mesh/colours";
import { firstSurface, mesh, onMesh } from "../part";
import { notify } from "../state";
import type { Cylinder } from "./cylinder";
import { canDraw } from "./painter";
import type { Hit } from "./pick";
import type { CutPlane } from "./surface";
import type { Tool } from "./tools";
import { Viewport } from "./viewport";

export const selected = signal(0);
export const legend = signal<Legend | null>(null);
export const tool = signal<Tool>("navigate");
export const colouring = signal<Colouring>("plain");
/** Colour by something that has changed: the same name twice draws nothing anew. */
export function colourAnew(by: Colouring): void {
  colouring.value = "plain";
  colouring.value = by;
}
export const visibleOnly = signal(true);
export const brushRadius = signal(24);
export const angleLimit = signal(20);
export const bordersShown = signal(true);
export const plane = signal<CutPlane | null>(null);
/** The working volume that is drawn over the surface. */
export const cylinder = signal<Cylinder | null>(null);
/** null until it has been tried. */
export const drawable = signal<boolean | null>(null);

type PickListener = (hit: Hit) => void;
type SmoothListener = (faces: Uint32Array<ArrayBuffer>) => void;
export const hear: { pick: PickListener; smooth: SmoothListener } = { pick: () => {}, smooth: () => {} };

let host: HTMLElement | null = null;
let viewport: Viewport | null = null;

export function currentViewport(): Viewport | null {
  return viewport;
}

/** Put the viewport into an element of the page; false where the browser cannot draw it. */
export function showIn(parent: HTMLElement): boolean {
  drawable.value ??= canDraw();
  if (!drawable.value) return false;
  if (!host) {
    host = document.createElement("div");
    host.className = "surface-host";
    parent.append(host);
    viewport = create(host);
  } else parent.append(host);
  return true;
}

function create(element: HTMLElement): Viewport {
  const view = new Viewport(element, {
    pick: (hit) => hear.pick(hit),
    smooth: (faces) => hear.smooth(faces),
    selection: (n) => {
      selected.value = n;
    },
    plane: (moved) => {
      plane.value = moved;
    },
    cylinder: (moved) => {
      cylinder.value = moved;
    },
    legend: (shown) => {
      legend.value = shown;
    },
    context: (state) => {
      if (state === "lost")
        notify("warning", "The graphics card was unavailable for a moment.", "The surface comes back by itself.");
    },
  });
  tool.subscribe((value) => {
    view.tool = value;
  });
  visibleOnly.subscribe((value) => {
    view.visibleOnly = value;
  });
  brushRadius.subscribe((value) => {
    view.brushRadius = value;
  });
  angleLimit.subscribe((value) => {
    view.angleLimit = (value * Math.PI) / 180;
  });
  colouring.subscribe((value) => view.setColouring(value));
  bordersShown.subscribe((value) => view.showBorders(value));
  plane.subscribe((value) => view.setPlane(value, tool.peek() === "cut"));
  cylinder.subscribe((value) => view.setCylinder(value));
  let shown: string | null = null;
  const current = () => location.hash.split("/")[1] ?? null;
  const follow = () => {
    const part = current();
    const next = mesh.peek();
    view.setMesh(next, part === shown);
    // Between two scans there is no mesh: the second one is looked at anew.
    if (next) shown = part;
  };
  onMesh((parts) => (parts ? view.patched(parts) : follow()));
  mesh.subscribe((value) => {
    if (value !== view.mesh) follow();
  });
  firstSurface.subscribe((first) => {
    if (mesh.peek()) return;
    if (!first) {
      view.setMesh(null);
      return;
    }
    view.setFirst(first.model);
    // Whoever has turned it goes on with the same view.
    shown = current();
  });
  return view;
}
