/** Deviation from a reference: a map on the surface, its figures, and probes where one clicks. */
import { computed, signal } from "@preact/signals";
import { link } from "../bus";
import { RefusedError } from "../link";
import { mesh, onMesh, opened, shownRevision } from "../part";
import type { DeviationShown, ShowDeviation, SizeCheck } from "../protocol";
import { complain, notify, place, scans } from "../state";
import { Button, bound, Check, mm, NumberField, Section, SelectField, TextField } from "../ui/controls";
import { files, send, sendTable } from "../verbs/state";
import type { Vec } from "../viewport/camera";
import type { Item } from "../viewport/overlay";
import type { Hit } from "../viewport/pick";
import { colourAnew, colouring } from "../viewport/place";
import { REPORTS, ReportButtons } from "./report";
import { VerdictDot } from "./verdict";

const UNITS = [
  ["mm", "mm"],
  ["cm", "cm"],
  ["m", "m"],
  ["inch", "inch"],
] as const;

type Unit = NonNullable<ShowDeviation["unit"]>;
type Way = NonNullable<ShowDeviation["align"]>;
const WAYS: readonly (readonly [Way, string])[] = [
  ["shape", "by shape"],
  ["datums", "by datums"],
  ["none", "not at all"],
];

const reference = signal("");
const way = signal<Way>("shape");
/** Numbers of features of the reference, as they are typed. */
const datums = signal("");
const byFeature = signal(false);
/** A table of the list; empty for what is typed in. */
const table = signal("");
/** Tolerance of every size, and width of the profile's zone, mm. */
const tolerance = signal("");
const profile = signal<number | null>(null);
const unit = signal<Unit>("mm");
/** In which the reference may be drawn, by its size: a person is asked. */
const asksUnit = signal<Unit | null>(null);
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

/** A table of tolerances from what is typed in; empty where nothing is. */
export function toleranceTable(ofSizes: string, ofProfiles: number | null): string {
  const rows: string[] = [];
  if (ofSizes) rows.push(`*,*,"${ofSizes.replaceAll('"', '""')}"`);
  if (ofProfiles !== null) rows.push(`*,profile,${ofProfiles}`);
  return rows.length ? ["feature,quantity,tolerance", ...rows, ""].join("\n") : "";
}

/** The file of the tolerances; null for none, undefined where it could not be sent. */
async function tableFile(): Promise<string | null | undefined> {
  if (table.value) return table.value;
  const csv = toleranceTable(tolerance.value, profile.value);
  if (!csv) return null;
  return (await sendTable("tolerances.csv", csv)) ?? undefined;
}

/** Numbers of features as they are typed; null for anything else. */
export function readDatums(text: string): number[] | null {
  const words = text.split(/[\s,;]+/).filter(Boolean);
  return words.every((word) => /^[1-9]\d*$/.test(word)) ? words.map(Number) : null;
}

/** What the map was made with, for a report of the same. */
let asked: ShowDeviation | null = null;

async function show(): Promise<void> {
  const scan = opened.value?.scan;
  if (!scan || !reference.value || busy.value) return;
  const numbers = way.value === "datums" ? readDatums(datums.value) : [];
  if (!numbers) {
    notify("warning", `Datums “${datums.value}” are no numbers of features.`, "Type them as 1, 2, 3.");
    return;
  }
  busy.value = true;
  asksUnit.value = null;
  try {
    const tolerance_table = await tableFile();
    if (tolerance_table === undefined) return;
    const request = {
      kind: "show_deviation",
      scan,
      reference: reference.value,
      unit: unit.value,
      align: way.value,
      datums: numbers,
      features: byFeature.value,
      tolerance_table,
    } as const;
    const { header, arrays } = await link.request(request);
    asked = { ...request, datums: [...request.datums], id: 0 };
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
    const other = error instanceof RefusedError ? error.options.find(({ name }) => name === "reference_unit") : null;
    if (other) asksUnit.value = other.value as Unit;
    else complain(error);
  } finally {
    busy.value = false;
  }
}

/** Draw the map anew. */
function drawMap(): void {
  if (mesh.value) mesh.value.deviationEnd = end.value;
  colourAnew("deviation");
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
      <SelectField label="Reference" options={options()} {...bound(reference)} />
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
      <SelectField label="In" options={UNITS} {...bound(unit)} />
      <SelectField label="Align" options={WAYS} {...bound(way)} />
      {way.value === "datums" && <TextField label="Datums" placeholder="1, 2, 3" {...bound(datums)} />}
      <Check label="Features and their sizes" checked={byFeature.value} onChange={(on) => (byFeature.value = on)} />
      <SelectField
        label="Tolerances"
        {...bound(table)}
        options={[
          ["", "as below"] as const,
          ...files.value.filter(({ kinds }) => kinds.includes("table")).map(({ file, name }) => [file, name] as const),
        ]}
      />
      {!table.value && (
        <>
          <TextField label="Of every size" placeholder="ISO 2768-m, ±0.1" {...bound(tolerance)} />
          <NumberField label="Of profiles" unit="mm" min={0.001} placeholder="none" {...bound(profile)} />
        </>
      )}
      <Button kind="primary" disabled={!reference.value || busy.value} onClick={() => void show()}>
        {busy.value ? "Comparing …" : "Compare"}
      </Button>
      {asksUnit.value && <AskUnit than={asksUnit.value} />}
      {way.value === "none" && <p class="quiet">The reference is taken to be where the scan is.</p>}
      {now && <Figures of={now} />}
    </Section>
  );
}

/** Whether the reference is drawn in another unit than was said. */
function AskUnit({ than }: { than: Unit }) {
  const name = options().find(([file]) => file === reference.value)?.[1] ?? "The reference";
  return (
    <div class="notice warning" role="alert">
      <span>
        In {unit.value}, {name} is too small for this part; its size fits in {than}. In which unit is it drawn?
      </span>
      <span class="row">
        <Button
          small
          onClick={() => {
            unit.value = than;
            void show();
          }}
        >
          Drawn in {than}
        </Button>
        <Button small onClick={() => (asksUnit.value = null)}>
          Another reference
        </Button>
      </span>
    </div>
  );
}

function Figures({ of }: { of: DeviationShown }) {
  return (
    <>
      <dl class="figures" aria-label="Deviation">
        <dt>Reference</dt>
        <dd>{of.reference}</dd>
        {of.verdict && (
          <>
            <dt>Tolerances</dt>
            <dd>
              <VerdictDot of={of.verdict} />
            </dd>
          </>
        )}
        <dt>Mean</dt>
        <dd class="num">{written(of.mean)}</dd>
        <dt>Root mean square</dt>
        <dd class="num">{of.rms.toFixed(3)} mm</dd>
        <dt>95 % within</dt>
        <dd class="num">{of.p95.toFixed(3)} mm</dd>
        <dt>Worst</dt>
        <dd class="num">{of.worst.toFixed(3)} mm</dd>
      </dl>
      <p class="quiet">{of.alignment}.</p>
      {of.findings.map(({ severity, text }) => (
        <p key={text} class={`remark ${severity}`}>
          {text}
        </p>
      ))}
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
      <Checked of={of} />
      <ReportButtons
        suffixes={REPORTS}
        of="comparison"
        disabled={!asked}
        request={(name, suffix) => ({ kind: "run_verb", verb: "compare", name, values: reportValues(suffix) })}
      />
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

/** The values of the verb that compares the same, for its report. */
function reportValues(suffix: string): Record<string, unknown> {
  if (!asked) return {};
  const { scan, reference: file, unit: of, align, datums: numbers, features, tolerance_table } = asked;
  return {
    measured: scan,
    reference: file,
    reference_unit: of,
    align,
    features,
    ...(numbers?.length ? { datums: numbers } : {}),
    ...(tolerance_table ? { tolerance_table } : {}),
    picture: [],
    report: [suffix],
  };
}

/** A size with what it is to be, in words. */
export function checkWords(of: SizeCheck): string {
  const unit = of.unit === "°" ? of.unit : ` ${of.unit}`;
  const value = of.uncertainty === null ? of.measured.toFixed(3) : withUncertainty(of.measured, of.uncertainty);
  if (of.quantity === "profile") {
    const most = of.limits ? `, at most ${of.limits[1]}` : "";
    return `${value}${unit}${most}`;
  }
  const off = of.measured - of.nominal;
  return `${value}${unit}, nominal ${Number(of.nominal.toFixed(4))}, ${off < 0 ? "−" : "+"}${Math.abs(off).toFixed(3)}`;
}

function withUncertainty(value: number, u: number): string {
  const digits = u > 0 ? Math.min(6, Math.max(0, 1 - Math.floor(Math.log10(u)))) : 3;
  return `${value.toFixed(digits)} ± ${u.toFixed(digits)}`;
}

function Checked({ of }: { of: DeviationShown }) {
  return (
    <>
      {of.checks.length > 0 && (
        <ul class="list whole" aria-label="Sizes of the reference">
          {of.checks.map((check) => (
            <li key={`${check.features} ${check.quantity}`}>
              <span class="grow">
                <strong>
                  {check.features.join("–")} {check.quantity}
                </strong>{" "}
                {check.verdict && <VerdictDot of={check.verdict} />}
                <br />
                <span class="quiet num">
                  {checkWords(check)}
                  {check.tolerance && check.quantity !== "profile" && ` (${check.tolerance})`}
                </span>
              </span>
            </li>
          ))}
        </ul>
      )}
      {of.features.length > 0 && (
        <ul class="list whole" aria-label="Features of the reference">
          {of.features.map(({ number, nominal, mean, rms, points }) => (
            <li key={number}>
              <span class="grow">
                <strong>
                  {number}: {nominal}
                </strong>
                <br />
                <span class="quiet num">
                  mean {written(mean)}, rms {rms.toFixed(3)} mm over {points} points
                </span>
              </span>
            </li>
          ))}
        </ul>
      )}
    </>
  );
}
