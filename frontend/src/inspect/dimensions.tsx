/** Dimensions: measurements with a name, a nominal value and limits, and whether they keep them. */
import { computed, effect, signal } from "@preact/signals";
import { link } from "../bus";
import { measures, opened } from "../part";
import type { Measure, TakeMeasure } from "../protocol";
import { complain, connection, isOperator } from "../state";
import { Button, NumberField, Section, TextField } from "../ui/controls";
import { currentViewport } from "../viewport/place";
import { replaying } from "./replay";
import { VerdictDot } from "./verdict";

export const WORDS: Record<TakeMeasure["what"], string> = {
  distance: "Distance",
  to_plane: "Point to plane",
  diameter: "Diameter",
  angle: "Angle",
  area: "Area",
  volume: "Volume",
};
const wordOf = ({ what, name }: Measure) => name || (WORDS[what as TakeMeasure["what"]] ?? what);

const chosenName = signal<string | null>(null);
const chosen = computed(() => measures.value.find(({ measure }) => measure === chosenName.value) ?? null);

/** As many digits as the uncertainty leaves. */
export function written({ value, unit, uncertainty }: Pick<Measure, "value" | "unit" | "uncertainty">): string {
  const of = unit === "°" ? unit : ` ${unit}`;
  if (uncertainty === null || !(uncertainty > 0)) return `${Number(value.toPrecision(5))}${of}`;
  const digits = Math.min(6, Math.max(0, 1 - Math.floor(Math.log10(uncertainty))));
  return `${value.toFixed(digits)} ± ${uncertainty.toFixed(digits)}${of}`;
}

const signed = (x: number) => (x > 0 ? `+${x}` : String(x).replace("-", "−"));

function limits({ nominal, lower, upper, unit }: Measure): string {
  if (nominal === null) return "";
  const wanted = `${nominal}${unit === "°" ? unit : ` ${unit}`}`;
  if (lower === null || upper === null) return wanted;
  return upper === -lower ? `${wanted} ± ${upper}` : `${wanted} ${signed(lower)} / ${signed(upper)}`;
}

async function request(what: Parameters<typeof link.request>[0]): Promise<void> {
  try {
    await link.request(what);
  } catch (error) {
    complain(error);
  }
}

const scan = () => opened.value?.scan ?? "";
const forget = (measure: string) => request({ kind: "forget_measure", scan: scan(), measure });
type Wanted = Partial<Pick<Measure, "name" | "nominal" | "lower" | "upper">>;

/** Those made before: each begins with what the one before it has left. */
let specified = Promise.resolve();

/** Name or limit a dimension; a nominal value begins with limits of ± 0. */
function specify({ measure }: Measure, change: Wanted): void {
  specified = specified
    .catch(() => {})
    .then(async () => {
      const found = measures.value.find((one) => one.measure === measure);
      if (!found) return;
      const { name, nominal, lower, upper } = { ...found, ...change };
      const limited = nominal !== null && (lower !== null || upper !== null);
      await request({
        kind: "specify",
        scan: scan(),
        measure,
        name,
        nominal,
        lower: limited ? (lower ?? Math.min(0, -(upper ?? 0))) : null,
        upper: limited ? (upper ?? Math.max(0, -(lower ?? 0))) : null,
      });
    });
}

/** Measure again whatever the surface was changed under, while the list is shown. */
export function keepCurrent(): () => void {
  let asked = "";
  return effect(() => {
    const old = measures.value.filter(({ outdated, complete }) => outdated || !complete);
    if (!old.length) asked = "";
    if (!old.length || connection.value !== "open") return;
    // What cannot be measured any more stays as it was: one try for each list.
    const list = old.map(({ measure, value }) => `${measure} ${value}`).join(" ");
    if (list === asked) return;
    asked = list;
    void request({ kind: "measure_again", scan: scan() });
  });
}

export function csv(of: readonly Measure[]): string {
  const quoted = (text: string) => `"${text.replaceAll('"', '""')}"`;
  const rows = of.map((m) =>
    [
      quoted(m.name),
      m.what,
      m.value,
      m.uncertainty ?? "",
      m.unit,
      m.nominal ?? "",
      m.lower ?? "",
      m.upper ?? "",
      m.verdict ?? "",
      m.outdated ? "yes" : "no",
      quoted(m.text),
    ].join(","),
  );
  const head = "name,what,value,uncertainty_k2,unit,nominal,lower,upper,verdict,outdated,text";
  return [head, ...rows].join("\r\n");
}

function save(): void {
  const url = URL.createObjectURL(new Blob([csv(measures.value)], { type: "text/csv" }));
  const a = document.createElement("a");
  a.href = url;
  a.download = `${opened.value?.name ?? "part"}-measurements.csv`;
  a.click();
  URL.revokeObjectURL(url);
}

function Row({ of }: { of: Measure }) {
  return (
    <li>
      <button
        type="button"
        class="button plain grow"
        title={of.text}
        aria-pressed={chosenName.value === of.measure}
        onClick={() => {
          chosenName.value = of.measure;
          if (of.places.length) currentViewport()?.lookAt([...of.places[0]], 40);
        }}
      >
        <span>
          <strong class="num">{written(of)}</strong> {of.verdict && <VerdictDot of={of.verdict} />}
          <br />
          <span class="quiet">
            {wordOf(of)}
            {limits(of) && ` · ${limits(of)}`}
            {of.outdated && " · of an earlier surface"}
            {of.doubt && " · may be of another part"}
          </span>
        </span>
      </button>
      <Button
        kind="plain"
        small
        icon="trash"
        label="Delete it"
        disabled={!isOperator.value}
        onClick={() => void forget(of.measure)}
      />
    </li>
  );
}

export function DimensionsPanel() {
  const list = measures.value;
  return (
    <Section title="Measurements" count={list.length}>
      {list.length === 0 && <p class="quiet">None yet. They are kept in the scan file.</p>}
      <ul class="list whole" aria-label="Measurements">
        {list.map((measure) => (
          <Row key={measure.measure} of={measure} />
        ))}
      </ul>
      {chosen.value && <Dimension of={chosen.value} />}
      <Button disabled={!list.length} onClick={save}>
        Save as CSV
      </Button>
      <Button disabled={!list.length || !isOperator.value} onClick={() => (replaying.value = true)}>
        Measure the same on another scan …
      </Button>
    </Section>
  );
}

const LIMITS = [
  ["nominal", "Nominal"],
  ["lower", "Lower limit"],
  ["upper", "Upper limit"],
] as const;

/** What one of them is to be, and what its uncertainty is made of. */
function Dimension({ of }: { of: Measure }) {
  const unit = of.unit;
  return (
    <fieldset class="dimension" disabled={!isOperator.value}>
      <legend>{wordOf(of)}</legend>
      <TextField label="Name" value={of.name} onChange={(name) => specify(of, { name })} />
      {LIMITS.map(([key, label]) => (
        <NumberField
          key={key}
          label={label}
          value={of[key]}
          unit={unit}
          placeholder="none"
          onChange={(value) => specify(of, { [key]: value })}
        />
      ))}
      <p class="quiet">{of.text}.</p>
      {of.doubt && <p class="remark warning">{of.doubt}.</p>}
      <Budget of={of} />
    </fieldset>
  );
}

/** Why a part of the uncertainty has no figure. */
const NOT_KNOWN = "not known";

function Budget({ of }: { of: Measure }) {
  if (of.uncertainty === null || of.noise === null)
    return <p class="quiet">Its uncertainty is not known: a point has none, or the surface is no scan's.</p>;
  const digits =
    written(of)
      .match(/± ([\d.]+)/)?.[1]
      .split(".")[1]?.length ?? 0;
  const shown = (x: number) => `${x.toFixed(Math.min(7, digits + 1))} ${of.unit}`;
  const whole = of.what === "volume";
  const rows: (readonly [string, string])[] = whole
    ? [["Noise, calibration, table, filling", shown(of.noise)]]
    : [
        ["Noise of the points", shown(of.noise)],
        [
          "Calibration, table axis included",
          of.shared !== null ? shown(of.shared) : of.complete ? NOT_KNOWN : "being worked out …",
        ],
        ["Bias of the stripe", NOT_KNOWN],
      ];
  return (
    <>
      <table class="budget" aria-label="Uncertainty budget">
        <tbody>
          {rows.map(([name, text]) => (
            <tr key={name}>
              <th scope="row">{name}</th>
              <td class="num">{text}</td>
            </tr>
          ))}
          <tr>
            <th scope="row">U (k = 2)</th>
            <td class="num">{shown(of.uncertainty)}</td>
          </tr>
        </tbody>
      </table>
      {!whole && of.complete && of.shared === null && (
        <p class="quiet">
          This scan's rig was not calibrated with uncertainties, or the measurement cannot be taken any more: U is that
          of the noise alone.
        </p>
      )}
    </>
  );
}
