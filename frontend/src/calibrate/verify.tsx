/** Verification: a scan of an artefact whose dimensions are known, and the history of all of them. */
import { computed, signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { link } from "../bus";
import type { VerificationRuns, VerificationTrend } from "../protocol";
import { complain, go, isOperator, scans } from "../state";
import { Button, SelectField } from "../ui/controls";
import { Outcome } from "../verbs/outcome";
import { change, files, formOf, run, runOf, send, verbs } from "../verbs/state";
import { histories } from "./state";

const scan = signal("");
const artefact = signal("");
const verb = computed(() => verbs.value.find((one) => one.verb === "verify"));

async function readHistory(): Promise<void> {
  try {
    const { header } = await link.request({ kind: "list_verifications" });
    if (header.kind === "verifications") histories.value = header.histories;
  } catch (error) {
    complain(error);
  }
}

/** Send the file of an artefact, and choose it. */
async function add(list: Iterable<File>): Promise<void> {
  const [sent] = await send(list);
  if (sent) artefact.value = sent;
}

export function VerifyStep() {
  const input = useRef<HTMLInputElement>(null);
  const now = verb.value;
  const state = now && runOf(formOf(now))?.state;
  useEffect(() => {
    void readHistory();
  }, [state]);
  if (!now) return null;
  const artefacts = files.value.filter(({ kinds }) => kinds.includes("artefact"));
  const start = () => {
    const { values } = formOf(now);
    const chosen = { ...values, scans: [scan.value], artefact: artefact.value, report: [".html"] };
    change(now, { values: chosen, name: "" });
    void run(now);
  };
  return (
    <>
      <p>
        Scan a body whose dimensions are known, a sphere or a ball bar, and compare: what the scanner measures, against
        what it is.
      </p>
      <SelectField
        label="Scan"
        value={scan.value}
        options={[["", "choose"], ...scans.value.map((one) => [one.scan, one.name] as const)]}
        onChange={(value) => (scan.value = value)}
      />
      <SelectField
        label="Artefact"
        value={artefact.value}
        options={[["", artefacts.length ? "choose" : "none yet"], ...artefacts.map((f) => [f.file, f.name] as const)]}
        onChange={(value) => (artefact.value = value)}
      />
      <Button icon="folder" disabled={!isOperator.value} onClick={() => input.current?.click()}>
        Artefact’s file from this computer
      </Button>
      <input
        ref={input}
        type="file"
        accept=".toml,.json"
        hidden
        aria-label="Artefact’s file"
        onChange={(event) => void add(event.currentTarget.files ?? [])}
      />
      <div class="grid-2">
        <Button onClick={() => go("scan", null)}>Scan it</Button>
        <Button
          kind="primary"
          disabled={!isOperator.value || !scan.value || !artefact.value || state === "running"}
          onClick={start}
        >
          Verify
        </Button>
      </div>
      <Outcome verb={now} />
    </>
  );
}

export function HistoryPane() {
  const all = [...histories.value].reverse();
  return (
    <section class="pane history" aria-label="History of verifications">
      <header>
        <h2>History of verifications</h2>
      </header>
      <div class="stage scrolls">
        {all.length ? (
          all.map((runs) => <Runs key={`${runs.artefact} ${runs.rig}`} runs={runs} />)
        ) : (
          <div class="empty">No verification yet. Each one is kept here, and a drift is reported.</div>
        )}
      </div>
    </section>
  );
}

function Runs({ runs }: { runs: VerificationRuns }) {
  return (
    <section aria-label={`Verifications with ${runs.artefact}`}>
      <h3>
        {runs.artefact} <span class="quiet num">{runs.rig ? `rig ${runs.rig.slice(0, 8)}` : "rig unknown"}</span>
      </h3>
      <div class="trends">
        {runs.trends.map((trend) => (
          <Trend key={trend.name} trend={trend} />
        ))}
      </div>
    </section>
  );
}

const [WIDE, HIGH, EDGE] = [280, 110, 8];

/** One test value over time, in µm, each with its noise, and its limit. */
function Trend({ trend }: { trend: VerificationTrend }) {
  const { name, times, values, noise, limit, alarm } = trend;
  const last = values.length - 1;
  const edges = limit === null ? [0] : values.some((v) => v < 0) ? [0, limit, -limit] : [0, limit];
  const low = Math.min(...edges, ...values.map((v, k) => v - noise[k]));
  const high = Math.max(...edges, ...values.map((v, k) => v + noise[k]));
  const x = (k: number) => (last ? EDGE + (k * (WIDE - 2 * EDGE)) / last : WIDE / 2);
  const y = (v: number) => HIGH - EDGE - ((v - low) * (HIGH - 2 * EDGE)) / Math.max(high - low, 1e-9);
  const said = `${(1000 * values[last]).toFixed(0)} µm, noise ± ${(1000 * noise[last]).toFixed(0)} µm`;
  const exceeded = limit !== null && Math.abs(values[last]) > limit;
  return (
    <figure class={`trend ${alarm || exceeded ? "alarm" : ""}`}>
      <figcaption>
        <strong>{name}</strong> <span class="num">{said}</span>
        {alarm && " · drifts"}
        {exceeded && " · beyond its limit"}
      </figcaption>
      <svg viewBox={`0 0 ${WIDE} ${HIGH}`} role="img" aria-label={`${name}: ${values.length} runs, last ${said}`}>
        {edges.map((edge) => (
          <line key={edge} class={edge ? "limit" : "zero"} x1={0} x2={WIDE} y1={y(edge)} y2={y(edge)} />
        ))}
        <polyline points={values.map((v, k) => `${x(k)},${y(v)}`).join(" ")} />
        {values.map((v, k) => (
          <g key={times[k] + v}>
            <line x1={x(k)} x2={x(k)} y1={y(v - noise[k])} y2={y(v + noise[k])} />
            <circle cx={x(k)} cy={y(v)} r={3} />
          </g>
        ))}
      </svg>
      <span class="quiet num">
        {times[0].slice(0, 10)}
        {last > 0 && ` to ${times[last].slice(0, 10)}, ${values.length} runs`}
      </span>
    </figure>
  );
}
