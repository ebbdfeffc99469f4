/** Calibration: pictures of a board, what they cover, why one cannot be used, and the rig that follows. */
import { signal } from "@preact/signals";
import { on } from "../bus";
import { kept } from "../kept";
import { cividis, css } from "../mesh/colours";
import type { Calibration, CalibrationView } from "../protocol";
import { ask, devices, isOperator, jobs } from "../state";
import { Button, NumberField, Section, SelectField, TextField } from "../ui/controls";
import { isScanning, orientation } from "./live";
import { RemarkLine, useLastJob } from "./remarks";

type Range = [number, number];

const board = kept<string>("board", "charuco:9x6:12:9:DICT_5X5_100");
const table = kept<string>("table-target", "charuco:9x6:12:9:DICT_5X5_100");
const rigName = kept<string>("rig-name", "rig");
/** mm from the table up to the lowest corner between squares of the board on it. */
const lowest = signal(0);
/** How the board gets from one picture to the next. */
const carrier = signal<"hand" | "table">("hand");
const count = signal(8);
/** s that a hand has to move the board. */
const every = signal(3);
const arc = signal<Range>([-40, 40]);
const stops = signal(11);
/** Degrees; null is what suits the target: markers are seen from everywhere, a board from its front. */
const turn = signal<Range | null>(null);
/** ms of room light; null is what the devices usually take. */
const exposure = signal<number | null>(null);
const seconds = () => (exposure.value === null ? null : exposure.value / 1000);
const state = signal<Calibration | null>(null);

/** Follow how far the calibration is: once. */
export function startCalibration(): void {
  on("calibration", (message) => {
    state.value = message;
  });
}

const markers = () => table.value.startsWith("markers:");
const turnRange = (): Range => turn.value ?? (markers() ? [0, 360] : [-50, 50]);

const STAGES: Record<CalibrationView["stage"], string> = {
  camera: "board",
  laser: "laser on the board",
  table: "on the table",
};
/** Corners in a cell from which it counts as full. */
const FULL = 12;

/** Where in the picture corners were seen: blue nothing yet, yellow enough. */
function Coverage({ of }: { of: Calibration }) {
  return (
    <figure class="coverage">
      <div
        role="img"
        aria-label={`${Math.round(100 * of.coverage)} % of the picture has seen the board`}
        style={{ gridTemplateColumns: `repeat(${of.columns}, 1fr)`, aspectRatio: `${of.columns} / ${of.rows}` }}
      >
        {of.cells.map((n, k) => (
          <span key={k} style={{ background: css(cividis(Math.min(n / FULL, 1))) }} />
        ))}
      </div>
      <figcaption class="quiet">{Math.round(100 * of.coverage)} % of the picture has seen the board</figcaption>
    </figure>
  );
}

function Views({ of }: { of: Calibration }) {
  if (!of.views.length) return null;
  const newest = [...of.views].sort((a, b) => b.view - a.view);
  return (
    <ul class="list" aria-label="Pictures of the calibration">
      {newest.map((view) => (
        <li key={view.view}>
          <span class={`dot ${view.failure ? "bad" : "good"}`} />
          <span class="grow">
            {STAGES[view.stage]}
            {view.laser && ` ${view.laser}`}{" "}
            <span class={view.failure ? "" : "quiet"}>{view.failure || `${view.corners} corners`}</span>
          </span>
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
  );
}

function RigChoice() {
  const now = devices.value;
  if (!now) return null;
  const options = [
    ["", now.rig ? now.rig_name || "the simulated rig's" : "none"] as const,
    ...now.rigs.filter((name) => name !== now.rig_name).map((name) => [name, name] as const),
  ];
  return (
    <SelectField
      label="In use"
      value=""
      options={options}
      onChange={(name) => name && void ask({ kind: "use_rig", name })}
    />
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

/** How the pictures of the board are taken: one after the other while a hand moves it, or on the turning table. */
function CarrierFields() {
  const options = [
    ["hand", "in a hand"],
    ["table", "on the turntable"],
  ] as const;
  return (
    <>
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

function capture(stage: "camera" | "laser"): void {
  const how = carrier.value === "hand" ? { every: every.value } : { range_deg: arc.value };
  void ask({ kind: "capture", stage, count: count.value, seconds: seconds(), ...how });
}

function Working() {
  const job = [...jobs.value.values()].find((one) => one.what === "calibrate" && one.state === "running");
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
      <progress
        class="wide"
        aria-label={job.title}
        max={job.total ?? undefined}
        value={job.total === null ? undefined : job.done}
      />
      <Button disabled={!isOperator.value} onClick={() => void ask({ kind: "cancel", job: job.job })}>
        Cancel
      </Button>
    </div>
  );
}

export function CalibratePanel() {
  const now = state.value;
  const report = useLastJob("calibrate");
  const working = [...jobs.value.values()].some((job) => job.what === "calibrate" && job.state === "running");
  if (!devices.value?.addresses.length) return null;
  const ready = isOperator.value && !isScanning() && !working;
  return (
    <Section title="Calibration" open={false} count={devices.value.rig ? "known" : "none"}>
      <RigChoice />
      <TextField label="Board" value={board.value} onChange={(value) => (board.value = value)} />
      <TextField label="On table" value={table.value} onChange={(value) => (table.value = value)} />
      {!markers() && (
        <NumberField
          label="Lowest corner"
          value={lowest.value}
          unit="mm"
          onChange={(value) => (lowest.value = value ?? 0)}
        />
      )}
      <Button
        disabled={!ready}
        onClick={() =>
          void ask({
            kind: "calibrate_begin",
            board: board.value,
            table: table.value,
            lowest_mm: lowest.value,
            orientation: orientation.value,
          })
        }
      >
        {now ? "Start again" : "Begin"}
      </Button>
      {now && (
        <>
          <NumberField
            label="Exposure"
            value={exposure.value}
            unit="ms"
            min={0.01}
            placeholder="usual"
            onChange={(value) => (exposure.value = value)}
          />
          <CarrierFields />
          <p class="quiet">
            1. Room light on, the board in every corner of the picture, near and far, tilted each way.
          </p>
          <Button icon="camera" disabled={!ready} onClick={() => capture("camera")}>
            Take pictures of the board
          </Button>
          <Coverage of={now} />
          <p class="quiet">2. The board in the lasers’ light, at several distances.</p>
          <Button icon="camera" disabled={!ready} onClick={() => capture("laser")}>
            Take pictures with each laser
          </Button>
          <p class="quiet">3. The target on the table{!markers() && "; at 0° it faces the camera"}.</p>
          <NumberField
            label="Stops"
            value={stops.value}
            min={5}
            max={400}
            step={1}
            onChange={(value) => (stops.value = value ?? 11)}
          />
          <RangeFields value={turnRange()} onChange={(range) => (turn.value = range)} />
          <Button
            icon="camera"
            disabled={!ready}
            onClick={() =>
              void ask({
                kind: "capture",
                stage: "table",
                count: stops.value,
                range_deg: turnRange(),
                seconds: seconds(),
              })
            }
          >
            Turn the table and take
          </Button>
          <Working />
          <Views of={now} />
          {now.missing.map((words) => (
            <p key={words} class="remark warning">
              {words}
            </p>
          ))}
          <TextField label="Name" value={rigName.value} onChange={(value) => (rigName.value = value)} />
          <Button
            kind="primary"
            disabled={!ready || now.missing.length > 0 || !rigName.value}
            onClick={() => void ask({ kind: "calibrate_finish", name: rigName.value })}
          >
            Calibrate
          </Button>
        </>
      )}
      {report && report.state !== "running" && report.text && <p role="status">{report.text}</p>}
      {report?.findings.map((remark) => (
        <RemarkLine key={remark.where + remark.text} remark={remark} />
      ))}
    </Section>
  );
}
