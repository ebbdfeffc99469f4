/** The panel of repairs. */
import { useSignal } from "@preact/signals";
import { doEdit, figures, opened } from "../part";
import { level } from "../state";
import { Button, count, NumberField, Section, SelectField } from "../ui/controls";
import { selected, tool } from "../viewport/place";
import { apply, FILL_HOW, type FillHow, selectionArrays, show, smoothFaces } from "./edits";
import { smoothing } from "./state";

export function RepairPanels() {
  return (
    <>
      <SmoothPanel />
      <SpikesPanel />
      <PiecesPanel />
      <ClosePanel />
      <DecimatePanel />
      {level.value === "expert" && <SeamPanel />}
      <FiguresPanel />
    </>
  );
}

function SmoothPanel() {
  return (
    <Section title="Smooth" open={tool.value === "smooth"}>
      <NumberField
        label="Strength"
        value={smoothing.value.strength}
        min={0.01}
        max={1}
        step={0.01}
        onChange={(strength) => (smoothing.value = { ...smoothing.value, strength: strength ?? 1 })}
      />
      <NumberField
        label="Rounds"
        value={smoothing.value.rounds}
        min={1}
        max={1000}
        step={1}
        onChange={(rounds) => (smoothing.value = { ...smoothing.value, rounds: rounds ?? 5 })}
      />
      <div class="grid-2">
        <Button
          pressed={tool.value === "smooth"}
          keys="G"
          label="Paint where the surface is to be smoothed"
          onClick={() => (tool.value = "smooth")}
        >
          Brush
        </Button>
        <Button disabled={selected.value === 0} onClick={() => void smoothFaces()}>
          Selection
        </Button>
      </div>
    </Section>
  );
}

function SpikesPanel() {
  const beyond = useSignal(6);
  const would = useSignal<number | null>(null);
  const value = () => ({ kind: "despike", beyond: beyond.value });
  return (
    <Section title="Spikes" open={false}>
      <NumberField
        label="Higher than"
        value={beyond.value}
        unit="×"
        min={0.1}
        max={1000}
        onChange={(times) => (beyond.value = times ?? 6)}
      />
      <p class="quiet">times the usual roughness, {selected.value ? "in the selection" : "everywhere"}.</p>
      {would.value !== null && (
        <p class="quiet num" role="status">
          {count(would.value)} triangles would go and be filled.
        </p>
      )}
      <div class="grid-2">
        <Button
          onClick={() =>
            void show(value(), selectionArrays()).then((shown) => (would.value = shown?.dead.length ?? null))
          }
        >
          Preview
        </Button>
        <Button onClick={() => void apply(value(), selectionArrays()).then(() => (would.value = null))}>Remove</Button>
      </div>
    </Section>
  );
}

function PiecesPanel() {
  const fewer = useSignal(100);
  const would = useSignal<number | null>(null);
  const value = () => ({ kind: "remove_pieces", fewer: fewer.value });
  return (
    <Section title="Small pieces" open={false}>
      <NumberField
        label="Loose pieces of fewer than"
        value={fewer.value}
        unit="triangles"
        min={2}
        step={1}
        onChange={(n) => (fewer.value = n ?? 100)}
      />
      {would.value !== null && (
        <p class="quiet num" role="status">
          {count(would.value)} triangles would go.
        </p>
      )}
      <div class="grid-2">
        <Button onClick={() => void show(value()).then((shown) => (would.value = shown?.dead.length ?? null))}>
          Preview
        </Button>
        <Button onClick={() => void apply(value()).then(() => (would.value = null))}>Remove</Button>
      </div>
    </Section>
  );
}

function ClosePanel() {
  const floor = useSignal<number | null>(0);
  const top = useSignal<"plane" | "smooth" | "open">("plane");
  const bottom = useSignal<"floor" | "open">("floor");
  const holes = useSignal<FillHow>("auto");
  const value = () => ({ kind: "close", floor: floor.value, bottom: bottom.value, top: top.value, holes: holes.value });
  return (
    <Section title="Make watertight" open={false}>
      <NumberField
        label="Floor at"
        value={floor.value}
        unit="mm"
        placeholder="none"
        onChange={(z) => (floor.value = z)}
      />
      <SelectField
        label="Bottom"
        value={bottom.value}
        options={[
          ["floor", "to the floor"],
          ["open", "open"],
        ]}
        onChange={(how) => (bottom.value = how)}
      />
      <SelectField
        label="Top"
        value={top.value}
        options={[
          ["plane", "flat lid"],
          ["smooth", "curvature"],
          ["open", "open"],
        ]}
        onChange={(how) => (top.value = how)}
      />
      <SelectField label="Holes" value={holes.value} options={FILL_HOW} onChange={(how) => (holes.value = how)} />
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
    <Section title="Decimate" open={false}>
      <NumberField
        label="Tolerance"
        value={tolerance.value}
        unit="mm"
        min={1e-6}
        placeholder="any"
        onChange={(mm) => (tolerance.value = mm)}
      />
      <NumberField
        label="Down to"
        value={faces.value}
        min={4}
        step={1}
        placeholder="any number"
        onChange={(n) => (faces.value = n)}
      />
      {would.value !== null && (
        <p class="quiet num" role="status">
          {count(would.value)} of {count(figures.value?.faces ?? 0)} triangles would be left.
        </p>
      )}
      <div class="grid-2">
        <Button
          disabled={none}
          onClick={() => void show(value()).then((shown) => (would.value = shown?.figures.faces ?? null))}
        >
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
      <p class="quiet">Join the last profile of the turn to the first.</p>
      {lasers.map((laser) => (
        <Button key={laser} onClick={() => void doEdit({ kind: "close_seam", laser })}>
          Join first and last profile (laser {laser})
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
