/** The panel of repairs. */
import { useSignal } from "@preact/signals";
import { doEdit, type EditValue, figures, opened, type Preview } from "../part";
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

/** Preview and apply of one edit, and what the preview says that it would do. */
function PreviewAndApply(given: {
  edit: () => EditValue;
  label: string;
  disabled?: boolean;
  /** Where the edit goes; all faces where left out. */
  where?: () => ReturnType<typeof selectionArrays>;
  words?: (shown: Preview) => string;
}) {
  const would = useSignal<string | null>(null);
  const preview = async () => {
    const shown = await show(given.edit(), given.where?.());
    would.value = shown && given.words ? given.words(shown) : null;
  };
  const change = async () => {
    await apply(given.edit(), given.where?.());
    would.value = null;
  };
  return (
    <>
      {would.value !== null && (
        <p class="quiet num" role="status">
          {would.value}
        </p>
      )}
      <div class="grid-2">
        <Button disabled={given.disabled} onClick={() => void preview()}>
          Preview
        </Button>
        <Button disabled={given.disabled} onClick={() => void change()}>
          {given.label}
        </Button>
      </div>
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
      <PreviewAndApply
        label="Remove"
        edit={() => ({ kind: "despike", beyond: beyond.value })}
        where={selectionArrays}
        words={({ dead }) => `${count(dead.length)} triangles would go and be filled.`}
      />
    </Section>
  );
}

function PiecesPanel() {
  const fewer = useSignal(100);
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
      <PreviewAndApply
        label="Remove"
        edit={() => ({ kind: "remove_pieces", fewer: fewer.value })}
        words={({ dead }) => `${count(dead.length)} triangles would go.`}
      />
    </Section>
  );
}

function ClosePanel() {
  const floor = useSignal<number | null>(0);
  const top = useSignal<"plane" | "smooth" | "open">("plane");
  const bottom = useSignal<"floor" | "open">("floor");
  const holes = useSignal<FillHow>("auto");
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
      <PreviewAndApply
        label="Close"
        edit={() => ({
          kind: "close",
          floor: floor.value,
          bottom: bottom.value,
          top: top.value,
          holes: holes.value,
        })}
      />
    </Section>
  );
}

function DecimatePanel() {
  const tolerance = useSignal<number | null>(0.05);
  const faces = useSignal<number | null>(null);
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
      <PreviewAndApply
        label="Decimate"
        disabled={none}
        edit={() => ({ kind: "decimate", tolerance: tolerance.value, faces: faces.value })}
        words={({ figures: left }) =>
          `${count(left.faces)} of ${count(figures.value?.faces ?? 0)} triangles would be left.`
        }
      />
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
