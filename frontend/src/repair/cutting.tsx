/** Cut by a plane: with the handles on the surface, or by numbers. */
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { Button, Check, Section } from "../ui/controls";
import { across, PlaneFields } from "../ui/planefields";
import type { Vec } from "../viewport/camera";
import { currentViewport, plane, tool } from "../viewport/place";
import type { CutPlane } from "../viewport/surface";
import { apply, show } from "./edits";
import { preview } from "./state";

const starting = (normal: Vec) => across(normal, 0.1);

export function CutPanel() {
  const cap = useSignal(true);
  useEffect(() => {
    plane.value = starting([0, 0, 1]);
    return () => {
      plane.value = preview.value = null;
    };
  }, []);
  const at = plane.value;
  if (!at) return null;
  const set = (next: CutPlane) => {
    preview.value = null;
    plane.value = next;
  };
  const value = () => ({ kind: "cut", normal: at.normal, distance: at.offset, cap: cap.value });
  const facing = currentViewport()?.camera.axes()[2];
  return (
    <Section title="Cut by a plane">
      <p class="quiet">Faces tinted red are removed.</p>
      <div class="grid-3">
        <Button small onClick={() => set(starting([0, 0, 1]))}>
          Across z
        </Button>
        <Button small onClick={() => set(starting([1, 0, 0]))}>
          Across x
        </Button>
        <Button small onClick={() => set(starting([0, 1, 0]))}>
          Across y
        </Button>
        <Button small label="A plane that faces you" onClick={() => facing && set(starting(facing))}>
          As seen
        </Button>
        <Button
          small
          label="Keep the other side"
          onClick={() => set({ normal: at.normal.map((n) => -n) as Vec, offset: -at.offset })}
        >
          Other side
        </Button>
      </div>
      <PlaneFields at={at} onChange={set} />
      <Check label="Cap the cut" checked={cap.value} onChange={(on) => (cap.value = on)} />
      <div class="grid-2">
        <Button onClick={() => void show(value())}>Preview</Button>
        <Button
          kind="primary"
          onClick={() =>
            void apply(value()).then((done) => {
              if (done) tool.value = "navigate";
            })
          }
        >
          Cut
        </Button>
      </div>
    </Section>
  );
}
