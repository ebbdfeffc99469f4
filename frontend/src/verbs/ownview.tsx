/** A surface in a view of its own, beside the one of the open scan. */
import { useEffect, useRef } from "preact/hooks";
import type { Colouring } from "../mesh/colours";
import type { MeshModel } from "../mesh/model";
import { theme } from "../state";
import { NoWebGL } from "../ui/surface";
import type { Vec } from "../viewport/camera";
import type { Item } from "../viewport/overlay";
import { canDraw } from "../viewport/painter";
import { drawable } from "../viewport/place";
import { Viewport } from "../viewport/viewport";

/** The views on the page by their labels, for tests. */
export const ownViews = new Map<string, Viewport>();

interface OwnViewProps {
  label: string;
  mesh: MeshModel | null;
  by?: Colouring;
  items?: Item[];
  onPick?: (at: Vec) => void;
  /** Views of one name look the same way. */
  together?: string;
}

const groups = new Map<string, Set<Viewport>>();

function join(group: string, view: Viewport): void {
  const others = groups.get(group) ?? new Set();
  groups.set(group, others.add(view));
}

const NO_ITEMS: Item[] = [];

export function OwnView({ label, mesh, by = "plain", items = NO_ITEMS, onPick, together }: OwnViewProps) {
  const host = useRef<HTMLDivElement>(null);
  const view = useRef<Viewport | null>(null);
  const pick = useRef(onPick);
  pick.current = onPick;
  drawable.value ??= canDraw();
  useEffect(() => {
    if (!drawable.value) return;
    const none = () => {};
    const made = new Viewport(host.current!, {
      pick: ({ point }) => pick.current?.([...point] as Vec),
      selection: none,
      smooth: none,
      plane: none,
      legend: none,
      context: none,
      looked: () => {
        // It is drawn once before it is made, and has nobody to lead then.
        const own = view.current;
        for (const other of groups.get(together ?? "") ?? []) if (own && other !== own) other.lookLike(own.camera);
      },
    });
    if (together) join(together, made);
    made.showBorders(false);
    view.current = made;
    ownViews.set(label, made);
    const off = theme.subscribe(() => requestAnimationFrame(() => made.restyle()));
    return () => {
      off();
      if (together) groups.get(together)?.delete(made);
      view.current = null;
      ownViews.delete(label);
      made.dispose();
    };
  }, [label]);
  useEffect(() => view.current?.setMesh(mesh, together !== undefined && !!view.current.mesh), [mesh, label]);
  useEffect(() => view.current?.setColouring(by), [by, mesh, label]);
  useEffect(() => view.current?.setItems(items), [items, mesh, label]);
  return (
    <div class="stage" ref={host} role="img" aria-label={label}>
      {!drawable.value && <NoWebGL />}
    </div>
  );
}
