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
      <DecimatePanel />
      {level.value === "expert" && <SeamPanel />}
      <FiguresPanel />
    </>
  );
}

function ClosePanel() {
  const floor = useSignal<number | null>(0);
  const top = useSignal<"plane" | "open">("plane");
  const holes = useSignal<FillHow>("tangent");
  const value = () => ({ kind: "close", floor: floor.value, top: top.value === "open" ? null : top.value, holes: holes.value });
  return (
    <Section title="Close everything" open={false}>
      <NumberField label="Floor at" value={floor.value} unit="mm" placeholder="open" onChange={(z) => (floor.value = z)} />
      <SelectField label="Top" value={top.value} options={[["plane", "flat lid"], ["open", "open"]]} onChange={(how) => (top.value = how)} />
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

function DecimatePanel() {
  const tolerance = useSignal<number | null>(0.05);
  const faces = useSignal<number | null>(null);
  const would = useSignal<number | null>(null);
  const value = () => ({ kind: "decimate", tolerance: tolerance.value, faces: faces.value });
  const none = tolerance.value === null && faces.value === null;
  return (
    <Section title="Fewer triangles" open={false}>
      <NumberField label="Tolerance" value={tolerance.value} unit="mm" min={1e-6} placeholder="any" onChange={(mm) => (tolerance.value = mm)} />
      <NumberField label="Down to" value={faces.value} min={4} step={1} placeholder="any number" onChange={(n) => (faces.value = n)} />
      {would.value !== null && (
        <p class="quiet num" role="status">
          {count(would.value)} of {count(figures.value?.faces ?? 0)} triangles would be left.
        </p>
      )}
      <div class="grid-2">
        <Button disabled={none} onClick={() => void show(value()).then((shown) => (would.value = shown?.figures.faces ?? null))}>
          Preview
        </Button>
        <Button disabled={none} onClick={() => void apply(value()).then(() => (would.value = null))}>
          Decimate
        </Button>
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

