/** The calibration wizard: from a printed target to a rig that is judged and verified. */
import type { ComponentChildren } from "preact";
import { useEffect } from "preact/hooks";
import type { CalibrationVerdict, CalibrationView } from "../protocol";
import type { Room } from "../rooms/room";
import { RemarkLine } from "../scanner/remarks";
import { ask, devices, go, isOperator } from "../state";
import { Button, NumberField, Section, SelectField, TextField } from "../ui/controls";
import { hint } from "../ui/frame";
import { Icon } from "../ui/icons";
import { Watching } from "../ui/watching";
import { BoardPane } from "./picture";
import {
  again,
  arc,
  begin,
  board,
  type Carrier,
  capture,
  captureTable,
  carrier,
  connected,
  count,
  every,
  exposure,
  finish,
  histories,
  lowest,
  markers,
  onTable,
  paper,
  progress,
  type Range,
  ready,
  rigName,
  rulers,
  STEPS,
  type Step,
  showAgain,
  step,
  stops,
  turn,
  turnRange,
  wantedPlace,
  watch,
  working,
} from "./state";
import { HistoryPane, VerifyStep } from "./verify";

const TITLES: Record<Step, string> = {
  target: "Print the target",
  camera: "Camera",
  laser: "Lasers",
  table: "Turntable",
  result: "Calibrate",
  verify: "Verify",
};

const usable = (stage: CalibrationView["stage"]) =>
  progress.value?.header.views.filter((view) => view.stage === stage && !view.failure).length ?? 0;

/** How far a step is, in a word or two. */
function stateOf(one: Step): { dot: string; words: string } {
  const now = progress.value?.header;
  const verdict = now?.verdict;
  switch (one) {
    case "target":
      return now ? { dot: "good", words: now.board.split(":")[0] } : { dot: "", words: "which board" };
    case "result":
      return verdict ? { dot: VERDICTS[verdict.verdict].dot, words: VERDICTS[verdict.verdict].short } : NOT_YET;
    case "verify": {
      const runs = histories.value.at(-1)?.trends[0]?.times.length;
      return runs ? { dot: "good", words: `${runs} run${runs > 1 ? "s" : ""}` } : NOT_YET;
    }
    default: {
      const n = usable(one);
      return n ? { dot: wants(one) ? "busy" : "good", words: `${n} picture${n > 1 ? "s" : ""}` } : NOT_YET;
    }
  }
}

const NOT_YET = { dot: "", words: "not yet" };
const MISSING = { camera: "poses", laser: "stripe", table: "table" } as const;
const wants = (stage: CalibrationView["stage"]) =>
  progress.value?.header.missing.find((words) => words.includes(MISSING[stage]));

const VERDICTS: Record<CalibrationVerdict["verdict"], { dot: string; short: string; title: string }> = {
  good: { dot: "green", short: "good", title: "Good: this rig is ready for scans." },
  usable: { dot: "amber", short: "with warnings", title: "Usable, with warnings." },
  refused: { dot: "red", short: "not usable", title: "Not usable: this rig is not worth a scan." },
};

function Steps() {
  return (
    <nav class="wizard-steps" aria-label="Steps of the calibration">
      <ol>
        {STEPS.map((one, k) => {
          const { dot, words } = stateOf(one);
          return (
            <li key={one}>
              <button
                type="button"
                aria-current={step.value === one ? "step" : undefined}
                onClick={() => (step.value = one)}
              >
                <span class="num">{k + 1}</span>
                <span>
                  <strong>{TITLES[one]}</strong>
                  <span class="quiet row">
                    <span class={`dot ${dot}`} />
                    {words}
                  </span>
                </span>
              </button>
            </li>
          );
        })}
      </ol>
      <Button onClick={() => go("rig", null)}>Leave the wizard</Button>
    </nav>
  );
}

function RangeFields({ value, onChange }: { value: Range; onChange: (range: Range) => void }) {
  return (
    <>
      <NumberField label="From" value={value[0]} unit="°" onChange={(from) => onChange([from ?? value[0], value[1]])} />
      <NumberField label="To" value={value[1]} unit="°" onChange={(to) => onChange([value[0], to ?? value[1]])} />
    </>
  );
}

function TargetStep() {
  const papers = [
    ["a4", "A4"],
    ["a3", "A3"],
    ["letter", "Letter"],
  ] as const;
  const ruler = (k: 0 | 1) => (value: number | null) => {
    const next: Range = [...rulers.value];
    next[k] = value ?? 100;
    rulers.value = next;
  };
  const address = `api/target.pdf?board=${encodeURIComponent(board.value)}&paper=${paper.value}`;
  const dial = `api/dial.pdf?markers=${encodeURIComponent(onTable.value.replace("markers:", ""))}&paper=${paper.value}`;
  const printable = board.value.startsWith("charuco:");
  return (
    <>
      <p>
        Print the target at 100 %, glue it onto something flat, and measure both of its rulers of 100 mm with a steel
        rule: the calibration takes its scale from them.
      </p>
      <TextField label="Board" value={board.value} onChange={(value) => (board.value = value)} />
      <SelectField label="Paper" value={paper.value} options={papers} onChange={(value) => (paper.value = value)} />
      {printable ? (
        <a class="button" href={address} download="target.pdf">
          <Icon name="download" />
          Target as PDF
        </a>
      ) : (
        <p class="quiet">Only ChArUco boards are drawn here: charuco:COLSxROWS:SQUARE_MM:MARKER_MM:DICT.</p>
      )}
      <NumberField label="Ruler across" value={rulers.value[0]} unit="mm" min={1} onChange={ruler(0)} />
      <NumberField label="Ruler down" value={rulers.value[1]} unit="mm" min={1} onChange={ruler(1)} />
      <TextField label="Target on turntable" value={onTable.value} onChange={(value) => (onTable.value = value)} />
      {markers() && (
        <a class="button" href={dial} download="dial.pdf">
          <Icon name="download" />
          Markers for the turntable as PDF
        </a>
      )}
      {!markers() && (
        <NumberField
          label="Height of lowest board corner"
          value={lowest.value}
          unit="mm"
          onChange={(value) => (lowest.value = value ?? 0)}
        />
      )}
      <Button
        kind={progress.value ? undefined : "primary"}
        disabled={!isOperator.value || working.value !== undefined}
        onClick={() => void begin()}
      >
        {progress.value ? "Start again with this board" : "Begin with this board"}
      </Button>
    </>
  );
}

/** How the pictures of the board are taken: one after the other while a hand moves it, or on the turning table. */
function CarrierFields() {
  const options: readonly (readonly [Carrier, string])[] = [
    ["hand", "in a hand"],
    ["table", "on the turntable"],
  ];
  return (
    <>
      <NumberField
        label="Exposure"
        value={exposure.value}
        unit="ms"
        min={0.01}
        placeholder="automatic"
        onChange={(value) => (exposure.value = value)}
      />
      <SelectField
        label="Board is"
        value={carrier.value}
        options={options}
        onChange={(value) => (carrier.value = value)}
      />
      <NumberField
        label="Pictures"
        value={count.value}
        min={1}
        max={400}
        step={1}
        onChange={(value) => (count.value = value ?? 8)}
      />
      {carrier.value === "hand" ? (
        <NumberField
          label="One every"
          value={every.value}
          unit="s"
          min={0}
          max={60}
          onChange={(value) => (every.value = value ?? 0)}
        />
      ) : (
        <RangeFields value={arc.value} onChange={(range) => (arc.value = range)} />
      )}
    </>
  );
}

function CameraStep() {
  const now = progress.value?.header;
  const looking = devices.value?.looking ?? false;
  return (
    <>
      <p>
        Room light on. Hold the board near and far, tilted up to 45°, until its corners have been in every part of the
        picture.
      </p>
      {now && now.width > 1 && (
        <p class="wanted">
          Next: the board at the <strong>{wantedPlace(now)}</strong> of the picture, tilted another way.
        </p>
      )}
      <Button icon={looking ? "pause" : "play"} disabled={!ready.value} onClick={() => watch(!looking)}>
        {looking ? "Stop live view" : "Start live view"}
      </Button>
      <CarrierFields />
      <Button kind="primary" icon="camera" disabled={!ready.value} onClick={() => capture("camera")}>
        Take pictures of the board
      </Button>
    </>
  );
}

function LaserStep() {
  return (
    <>
      <p>The board in the lasers’ light, at several distances, near and far. Each laser is lit for one picture.</p>
      <CarrierFields />
      <Button kind="primary" icon="camera" disabled={!ready.value} onClick={() => capture("laser")}>
        Take pictures with each laser
      </Button>
    </>
  );
}

function TableStep() {
  return (
    <>
      <p>
        {markers()
          ? "The markers stand fixed on the table, which turns a picture at a time."
          : "Stand the board on the table, upright; at 0° it faces the camera. The table turns a picture at a time."}
      </p>
      <NumberField
        label="Stops"
        value={stops.value}
        min={5}
        max={400}
        step={1}
        onChange={(value) => (stops.value = value ?? 11)}
      />
      <RangeFields value={turnRange()} onChange={(range) => (turn.value = range)} />
      <Button kind="primary" icon="camera" disabled={!ready.value} onClick={captureTable}>
        Turn the table and take
      </Button>
    </>
  );
}

function ResultStep() {
  const now = progress.value?.header;
  const file = `${rigName.value}.json`;
  const taken = devices.value?.rigs.includes(file) && now?.verdict?.rig !== file;
  return (
    <>
      <p>All pictures are adjusted together: camera, lasers and table, with the uncertainty of each.</p>
      <TextField label="Name" value={rigName.value} onChange={(value) => (rigName.value = value)} />
      {taken && <p class="quiet">There is a rig of this name already: choose another name.</p>}
      <Button
        kind="primary"
        disabled={!ready.value || !now || now.missing.length > 0 || !rigName.value}
        onClick={finish}
      >
        Calibrate
      </Button>
      {now?.verdict && <Verdict of={now.verdict} />}
    </>
  );
}

function Verdict({ of }: { of: CalibrationVerdict }) {
  const { dot, title } = VERDICTS[of.verdict];
  return (
    <section class={`judgement ${dot}`} aria-label="Verdict" role="status">
      <h3>{title}</h3>
      <p>{of.text}</p>
      {of.hint && <p>{of.hint}</p>}
      {of.rig && <p class="quiet">Kept as {of.rig}.</p>}
      {of.report && (
        <a class="button" href={`api/files/${of.report}/page`} target="_blank" rel="noreferrer">
          <Icon name="export" />
          Open the report
        </a>
      )}
      {of.verdict !== "refused" && (
        <Button icon="right" onClick={() => (step.value = "verify")}>
          Verify it with an artefact
        </Button>
      )}
      {of.findings
        .filter(({ severity }) => severity !== "note")
        .map((remark) => (
          <RemarkLine key={remark.where + remark.text} remark={remark} />
        ))}
    </section>
  );
}

/** What is still open, and the pictures that would help most. */
function Open() {
  const now = progress.value?.header;
  if (!now) return null;
  return (
    <Section title="What is still open">
      {now.missing.map((words) => (
        <p key={words} class="remark warning">
          {words}
        </p>
      ))}
      {!now.missing.length && <p>Enough pictures of each kind are there.</p>}
      {now.undetermined.length > 0 && <p>Undetermined: {now.undetermined.join(", ")}.</p>}
      {now.advice && (
        <p class="wanted">
          <strong>Would help most: </strong>
          {now.advice}
        </p>
      )}
    </Section>
  );
}

const STAGES: Record<CalibrationView["stage"], string> = {
  camera: "board",
  laser: "laser",
  table: "on the table",
};

function verdictOf(view: CalibrationView): string {
  if (view.failure) return view.failure;
  const off = view.rms_px === null ? "" : ` · ${view.rms_px.toFixed(2)} px rms`;
  return `${view.corners} corners${off}`;
}

function Views() {
  const now = progress.value?.header;
  if (!now?.views.length) return null;
  const newest = [...now.views].sort((a, b) => b.view - a.view);
  return (
    <Section title="Pictures" count={now.views.length}>
      <ul class="list" aria-label="Pictures of the calibration">
        {newest.map((view) => (
          <li key={view.view} class={again.value?.view === view.view ? "current" : ""}>
            <span class={`dot ${view.failure ? "bad" : "good"}`} />
            <button
              type="button"
              class="button plain grow"
              title="Show this picture"
              onClick={() => void showAgain(view)}
            >
              <span>
                {view.view} {STAGES[view.stage]}
                {view.laser && ` ${view.laser}`} <span class={view.failure ? "" : "quiet"}>{verdictOf(view)}</span>
              </span>
            </button>
            <Button
              kind="plain"
              small
              icon="trash"
              label="Remove this picture"
              disabled={!isOperator.value}
              onClick={() => void ask({ kind: "forget_view", view: view.view })}
            />
          </li>
        ))}
      </ul>
    </Section>
  );
}

function Working() {
  const job = working.value;
  if (!job) return null;
  return (
    <div class="working" role="status">
      <div class="row apart">
        <span>{job.title}</span>
        {job.total !== null && (
          <span class="num">
            {job.done} of {job.total}
          </span>
        )}
      </div>
      <progress class="wide" aria-label={job.title} {...(job.total ? { max: job.total, value: job.done } : {})} />
      <Button disabled={!isOperator.value} onClick={() => void ask({ kind: "cancel", job: job.job })}>
        Cancel
      </Button>
    </div>
  );
}

/** Why nothing can be taken at the moment. */
function Obstacle() {
  if (!isOperator.value) return <Watching />;
  if (!connected())
    return (
      <div class="remark warning">
        <p>No devices are connected.</p>
        <Button small onClick={() => go("rig", null)}>
          Connect them
        </Button>
      </div>
    );
  if (!progress.value) return <p class="remark warning">Say which board it is first: step 1.</p>;
  return null;
}

const PANELS: Record<Step, () => ComponentChildren> = {
  target: TargetStep,
  camera: CameraStep,
  laser: LaserStep,
  table: TableStep,
  result: ResultStep,
  verify: VerifyStep,
};

function Wizard() {
  useEffect(() => {
    hint.value = "";
    return () => (again.value = null);
  }, []);
  const now = step.value;
  const Panel = PANELS[now];
  const taking = now === "camera" || now === "laser" || now === "table" || now === "result";
  const next = STEPS[STEPS.indexOf(now) + 1];
  return (
    <div class="room wizard">
      <Steps />
      {now === "verify" ? <HistoryPane /> : <BoardPane />}
      <aside class="inspector" aria-label="Calibration">
        <section class="section">
          <h2>
            {STEPS.indexOf(now) + 1}. {TITLES[now]}
          </h2>
          <div class="body">
            {taking && <Obstacle />}
            <Panel />
            <Working />
            {taking && now !== "result" && (
              <Button icon="right" onClick={() => (step.value = next)}>
                Next: {TITLES[next]}
              </Button>
            )}
          </div>
        </section>
        {now !== "verify" && now !== "target" && <Open />}
        {now !== "verify" && <Views />}
      </aside>
    </div>
  );
}

export const wizard: Room = {
  id: "calibrate",
  title: "Calibrate",
  needsScan: false,
  View: Wizard,
  commands: STEPS.map((one) => ({
    title: `Calibration: ${TITLES[one]}`,
    group: "Calibrate",
    run: () => (step.value = one),
  })),
};
