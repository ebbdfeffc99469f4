/** Cut by a plane: with the handles on the surface, or by numbers. */
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { mesh } from "../part";
import { Button, Check, NumberField, Section } from "../ui/controls";
import { currentViewport, plane, tool } from "../viewport/place";
import type { CutPlane } from "../viewport/surface";
import { apply, show } from "./edits";
import { preview } from "./state";

type Vec = [number, number, number];
const DEGREE = Math.PI / 180;

/** The direction of the normal: azimuth about z from x, and height above the horizontal. */
export function angles(n: Vec): [number, number] {
  return [Math.atan2(n[1], n[0]) / DEGREE, Math.atan2(n[2], Math.hypot(n[0], n[1])) / DEGREE];
}

export function normalOf(azimuth: number, height: number): Vec {
  const c = Math.cos(height * DEGREE);
  return [c * Math.cos(azimuth * DEGREE), c * Math.sin(azimuth * DEGREE), Math.sin(height * DEGREE)];
}

/** How far the part reaches along a direction, mm from the origin. */
export function reach(normal: Vec): [number, number] {
  const box = mesh.value?.bounds();
  if (!box) return [0, 0];
  const ends = normal.map((n, i) => [n * box.low[i], n * box.high[i]]);
  const low = ends.reduce((sum, [a, b]) => sum + Math.min(a, b), 0);
  const high = ends.reduce((sum, [a, b]) => sum + Math.max(a, b), 0);
  return [low, high];
}

/** A plane across a direction, at a share of the part above its lowest place in it. */
export function across(normal: Vec, share: number): CutPlane {
  const [low, high] = reach(normal);
  return { normal, offset: low + share * (high - low) };
}

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
  const [azimuth, height] = angles(at.normal);
  const set = (next: CutPlane) => {
    preview.value = null;
    plane.value = next;
  };
  const turned = (a: number, h: number) => set({ ...at, normal: normalOf(a, h) });
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
      <NumberField
        label="Distance from the origin"
        value={at.offset}
        unit="mm"
        onChange={(mm) => set({ ...at, offset: mm ?? 0 })}
      />
      <NumberField
        label="Azimuth of its normal"
        value={azimuth}
        unit="°"
        min={-180}
        max={360}
        onChange={(a) => turned(a ?? 0, height)}
      />
      <NumberField
        label="Height of its normal"
        value={height}
        unit="°"
        min={-90}
        max={90}
        onChange={(h) => turned(azimuth, h ?? 0)}
      />
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
