/** Sections: a plane in the 3-D view with its outline on the surface, and drawings of many. */
import { computed, signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { lengthOf, outline } from "../mesh/section";
import { mesh, opened, shape } from "../part";
import { Button, bound, figure, mm, Section, TextField } from "../ui/controls";
import { across, PlaneFields, reach } from "../ui/planefields";
import type { Vec } from "../viewport/camera";
import type { Item } from "../viewport/overlay";
import { currentViewport, plane } from "../viewport/place";
import type { CutPlane } from "../viewport/surface";
import { ReportButtons } from "./report";

const planes = signal("z=20");

/** The outline in the plane on the screen, as the surface is now. */
const shown = computed(() => {
  void shape.value;
  return plane.value && mesh.value ? outline(mesh.value, plane.value.normal, plane.value.offset) : null;
});

/** What the surface shows of the section. */
export function sectionItems(): Item[] {
  return shown.value ? [{ kind: "pieces", ends: shown.value, colour: "#ffc24a" }] : [];
}

/** A plane as the verb writes it: z=20, or its normal and its distance. */
export function written({ normal, offset }: CutPlane): string {
  const axis = normal.findIndex((n) => Math.abs(n - 1) < 1e-9);
  if (axis >= 0) return `${"xyz"[axis]}=${figure(offset, 6)}`;
  return [...normal, offset].map((value) => figure(value, 6)).join(",");
}

function ShownPlane({ at }: { at: CutPlane }) {
  const [low, high] = reach(at.normal);
  const text = written(at);
  return (
    <>
      <label class="field">
        Position in the part
        <input
          type="range"
          min={low}
          max={high}
          step={(high - low) / 200 || 1}
          value={at.offset}
          onInput={(event) => (plane.value = { ...at, offset: event.currentTarget.valueAsNumber })}
        />
      </label>
      <PlaneFields at={at} onChange={(next) => (plane.value = next)} />
      <p class="num" role="status">
        {shown.value?.length ? `Outline of ${mm(lengthOf(shown.value))}` : "The plane misses the surface."}
      </p>
      <div class="grid-2">
        <Button
          label="Add this plane to those that are drawn"
          disabled={planes.value.split(/[;\s]+/).includes(text)}
          onClick={() => (planes.value = [planes.value, text].filter(Boolean).join("; "))}
        >
          Add to drawing
        </Button>
        <Button label="Draw this plane alone" onClick={() => (planes.value = text)}>
          Draw only this
        </Button>
      </div>
      <Button kind="plain" onClick={() => (plane.value = null)}>
        Hide the plane
      </Button>
    </>
  );
}

/** Sections through the part: seen on the surface, and written into the folder as drawings. */
export function SectionsPanel() {
  useEffect(
    () => () => {
      plane.value = null;
    },
    [],
  );
  const scan = opened.value?.scan ?? "";
  const wanted = planes.value.split(/[;\s]+/).filter(Boolean);
  const show = (normal: Vec) => (plane.value = across(normal, 0.5));
  const facing = () => currentViewport()?.camera.axes()[2];
  return (
    <Section title="Sections" open={false}>
      <p class="quiet">Drag the disc to move the plane, the ball to tilt it; or use the fields.</p>
      <div class="grid-3" role="group" aria-label="Show a plane">
        <Button small label="Show a plane across z" onClick={() => show([0, 0, 1])}>
          Across z
        </Button>
        <Button small label="Show a plane across x" onClick={() => show([1, 0, 0])}>
          Across x
        </Button>
        <Button small label="Show a plane across y" onClick={() => show([0, 1, 0])}>
          Across y
        </Button>
        <Button
          small
          label="Show a plane that faces you"
          onClick={() => {
            const normal = facing();
            if (normal) show(normal);
          }}
        >
          As seen
        </Button>
      </div>
      {plane.value && <ShownPlane at={plane.value} />}
      <TextField label="Planes" unit="mm" {...bound(planes)} />
      <p class="quiet">z=20, x=0, or z=10:100:10 (from, to, step); several with ;</p>
      <ReportButtons
        of="section"
        what="Section"
        suffixes={[".dxf", ".svg", ".pdf"]}
        disabled={!wanted.length}
        request={(name, suffix) => ({
          kind: "run_verb",
          verb: "section",
          name,
          values: { part: scan, plane: wanted, outputs: [suffix] },
        })}
      />
    </Section>
  );
}
