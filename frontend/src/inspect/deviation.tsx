/** Deviation from a reference: a map on the surface, its figures, and probes where one clicks. */
import { computed, signal } from "@preact/signals";
import { link } from "../bus";
import { mesh, onMesh, opened, shownRevision } from "../part";
import type { DeviationShown, ShowDeviation } from "../protocol";
import { complain, notify, place, scans } from "../state";
import { Button, mm, NumberField, Section, SelectField } from "../ui/controls";
import { files, send } from "../verbs/state";
import type { Vec } from "../viewport/camera";
import type { Item } from "../viewport/overlay";
import type { Hit } from "../viewport/pick";
import { colouring } from "../viewport/place";

const UNITS = [
  ["mm", "mm"],
  ["cm", "cm"],
  ["m", "m"],
  ["inch", "inch"],
] as const;

const reference = signal("");
const unit = signal<NonNullable<ShowDeviation["unit"]>>("mm");
const shown = signal<DeviationShown | null>(null);
/** The surface was changed since. */
const old = signal(false);
const busy = signal(false);
/** mm at the ends of the map; null: the 2nd and the 98th hundredth. */
const end = signal<number | null>(null);
/** Whether a click reads the deviation, and measures nothing. */
export const probing = signal(false);
const probes = signal<readonly { at: Vec; value: number }[]>([]);

const here = computed(() => (shown.value?.scan === opened.value?.scan ? shown.value : null));

/** Follow the surface: once. */
export function startDeviation(): void {
  onMesh(() => {
    old.value = true;
    probes.value = [];
  });
}

async function show(): Promise<void> {
  const scan = opened.value?.scan;
  if (!scan || !reference.value || busy.value) return;
  busy.value = true;
  try {
    const wish = { kind: "show_deviation", scan, reference: reference.value, unit: unit.value } as const;
    const { header, arrays } = await link.request(wish);
    const model = mesh.value;
    if (header.kind !== "deviation" || !model || opened.value?.scan !== scan) return;
    if (header.revision !== shownRevision()) {
      notify("warning", "The surface was changed meanwhile.", "compare again");
      return;
    }
    model.deviation = arrays.f32("distance");
    shown.value = header;
    old.value = false;
    probes.value = [];
    probing.value = true;
    drawMap();
  } catch (error) {
    complain(error);
  } finally {
    busy.value = false;
  }
}

/** Draw the map anew. */
function drawMap(): void {
  if (mesh.value) mesh.value.deviationEnd = end.value;
  colouring.value = "plain"; // the same name twice draws nothing anew
  colouring.value = "deviation";
}

/** Read the deviation where the surface was clicked; false where clicks are for something else. */
export function probe({ point, vertex }: Hit): boolean {
  if (!probing.value) return false;
  const value = mesh.value?.deviation?.[vertex];
  if (value !== undefined && !Number.isNaN(value))
    probes.value = [...probes.value.slice(-19), { at: [...point] as Vec, value }];
  return true;
}

export function written(x: number): string {
  const text = Math.abs(x).toFixed(3);
  return `${Number(text) === 0 ? "" : x > 0 ? "+" : "−"}${text} mm`;
}

export function probeItems(): Item[] {
  return probes.value.map(({ at, value }) => ({ kind: "point", at, colour: "#ffffff", label: written(value) }));
}

export function forgetProbes(): void {
  probing.value = false;
  probes.value = [];
}

function options(): (readonly [string, string])[] {
  const meshes = files.value.filter(({ kinds }) => kinds.includes("mesh"));
  const others = scans.value.filter(({ scan }) => scan !== place.value.scan);
  return [
    ["", "choose …"],
    ...meshes.map(({ file, name }) => [file, name] as const),
    ...others.map(({ scan, name }) => [scan, `${name} (scan)`] as const),
  ];
}

export function DeviationPanel() {
  const now = here.value;
  return (
    <Section title="Deviation from a reference" open={false} count={now ? mm(now.rms) : undefined}>
      <SelectField
        label="Reference"
        value={reference.value}
        options={options()}
        onChange={(file) => (reference.value = file)}
      />
      <label class="button">
        From this computer
        <input
          type="file"
          class="sr-only"
          accept=".stl,.ply,.obj,.3mf,.glb,.dxf,.step,.stp"
          onChange={async (event) => {
            const [sent] = await send(event.currentTarget.files ?? []);
            if (sent) reference.value = sent;
          }}
        />
      </label>
      <SelectField label="In" value={unit.value} options={UNITS} onChange={(value) => (unit.value = value)} />
      <Button kind="primary" disabled={!reference.value || busy.value} onClick={() => void show()}>
        {busy.value ? "Comparing …" : "Compare"}
      </Button>
      <p class="quiet">
        The reference is taken to be where the scan is: align it first, by “Compare” on the start page.
      </p>
      {now && <Figures of={now} />}
    </Section>
  );
}

function Figures({ of }: { of: DeviationShown }) {
  return (
    <>
      <dl class="figures" aria-label="Deviation">
        <dt>Reference</dt>
        <dd>{of.reference}</dd>
        <dt>Mean</dt>
        <dd class="num">{written(of.mean)}</dd>
        <dt>Root mean square</dt>
        <dd class="num">{of.rms.toFixed(3)} mm</dd>
        <dt>95 % within</dt>
        <dd class="num">{of.p95.toFixed(3)} mm</dd>
        <dt>Worst</dt>
        <dd class="num">{of.worst.toFixed(3)} mm</dd>
      </dl>
      {old.value && <p class="remark warning">The surface was changed since. Compare again.</p>}
      <NumberField
        label="Map to ±"
        value={end.value}
        unit="mm"
        min={0.001}
        placeholder="all"
        onChange={(value) => {
          end.value = value;
          drawMap();
        }}
      />
      <div class="grid-2">
        <Button pressed={probing.value} onClick={() => (probing.value = !probing.value)}>
          Probe
        </Button>
        <Button
          pressed={colouring.value === "deviation"}
          onClick={() => (colouring.value = colouring.value === "deviation" ? "plain" : "deviation")}
        >
          Map
        </Button>
      </div>
      {probes.value.length > 0 && (
        <ul class="list" aria-label="Probes">
          {probes.value.map(({ at, value }, k) => (
            <li key={k}>
              <span class="num grow">{written(value)}</span>
              <span class="quiet num">{at.map((x) => x.toFixed(1)).join(", ")}</span>
            </li>
          ))}
        </ul>
      )}
    </>
  );
}
