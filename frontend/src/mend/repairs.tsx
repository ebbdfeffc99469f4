/** The panel of repairs. */
import { useSignal } from "@preact/signals";
import { doEdit, figures, opened } from "../part";
import { level } from "../state";
import { Button, count, NumberField, Section, SelectField } from "../ui/controls";
import { apply, type FillHow, show } from "./edits";

export function RepairPanels() {
  return (
    <>
      <ClosePanel />
      {level.value === "expert" && <SeamPanel />}
      <FiguresPanel />
    </>
  );
}

function ClosePanel() {
  const floor = useSignal<number | null>(0);
  const holes = useSignal<FillHow>("tangent");
  const value = () => ({ kind: "close", floor: floor.value, holes: holes.value });
  return (
    <Section title="Close everything" open={false}>
      <NumberField label="Floor at" value={floor.value} unit="mm" placeholder="open" onChange={(z) => (floor.value = z)} />
      <SelectField
        label="Holes"
        value={holes.value}
        options={[["flat", "flat"], ["tangent", "tangent"], ["curvature", "with curvature"]]}
        onChange={(how) => (holes.value = how)}
      />
      <div class="grid-2">
        <Button onClick={() => void show(value())}>Preview</Button>
        <Button onClick={() => void apply(value())}>Close</Button>
      </div>
    </Section>
  );
}

function SeamPanel() {
  const lasers = [...new Set(opened.value?.grids.map(({ laser }) => laser))];
  return (
    <Section title="Seam" open={false}>
      <p class="quiet">Let the last profile of the turn neighbour the first.</p>
      {lasers.map((laser) => (
        <Button key={laser} onClick={() => void doEdit({ kind: "close_seam", laser })}>
          Close the seam of {laser}
        </Button>
      ))}
    </Section>
  );
}

function FiguresPanel() {
  const now = figures.value;
  if (!now) return null;
  const [low, high] = now.bounds ?? [null, null];
  return (
    <Section title="Surface">
      <dl class="facts">
        <dt>Triangles</dt>
        <dd>{count(now.faces)}</dd>
        <dt>Vertices</dt>
        <dd>{count(now.vertices)}</dd>
        {low && high && (
          <>
            <dt>Size</dt>
            <dd>{[0, 1, 2].map((i) => (high[i] - low[i]).toFixed(1)).join(" × ")} mm</dd>
          </>
        )}
        <dt>Closed</dt>
        <dd>{now.closed ? "yes" : "no"}</dd>
        <dt>Area</dt>
        <dd>{(now.area / 100).toFixed(2)} cm²</dd>
        {now.volume !== null && (
          <>
            <dt>Volume</dt>
            <dd>{(now.volume / 1000).toFixed(2)} cm³</dd>
          </>
        )}
      </dl>
    </Section>
  );
}

