/** Calibration: pictures of a board, what they cover, why one cannot be used, and the rig that follows. */
import { signal } from "@preact/signals";
import { css, cividis } from "../mesh/colours";
import { on } from "../bus";
import type { Calibration, CalibrationView } from "../protocol";
import { ask, devices, isOperator, jobs, kept } from "../state";
import { Button, NumberField, Section, SelectField, TextField } from "../ui/controls";
import { isScanning } from "./live";
import { RemarkLine, useLastJob } from "./remarks";

const board = kept<string>("board", "charuco:9x6:12:9:DICT_5X5_100");
const table = kept<string>("table-target", "charuco:9x6:12:9:DICT_5X5_100");
const rigName = kept<string>("rig-name", "rig");
const steps = signal(24);
/** ms of room light; null is what the devices usually take. */
const exposure = signal<number | null>(null);
const seconds = () => (exposure.value === null ? null : exposure.value / 1000);
const state = signal<Calibration | null>(null);
on("calibration", (message) => {
  state.value = message;
});

const STAGES: Record<CalibrationView["stage"], string> = { camera: "board", laser: "laser on the board", table: "on the table" };
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
  return (
    <ul class="list" aria-label="Pictures of the calibration">
      {of.views.map((view) => (
        <li key={view.view}>
          <span class={`dot ${view.failure ? "bad" : "good"}`} />
          <span class="grow">
            {STAGES[view.stage]}
            {view.laser && ` ${view.laser}`}{" "}
            <span class={view.failure ? "" : "quiet"}>{view.failure || `${view.corners} corners`}</span>
          </span>
          <Button kind="plain" small icon="trash" label="Take this picture away" disabled={!isOperator.value} onClick={() => void ask({ kind: "forget_view", view: view.view })} />
        </li>
      ))}
    </ul>
  );
}

function RigChoice() {
  const now = devices.value;
  if (!now) return null;
  const options = [["", now.rig ? now.rig_name || "the bench's own" : "none"] as const, ...now.rigs.filter((name) => name !== now.rig_name).map((name) => [name, name] as const)];
  return <SelectField label="In use" value="" options={options} onChange={(name) => name && void ask({ kind: "use_rig", name })} />;
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
      <Button disabled={!ready} onClick={() => void ask({ kind: "calibrate_begin", board: board.value, table: table.value })}>
        {now ? "Begin anew" : "Begin"}
      </Button>
      {now && (
        <>
          <NumberField label="Exposure" value={exposure.value} unit="ms" min={0.01} placeholder="usual" onChange={(value) => (exposure.value = value)} />
          <p class="quiet">1. Hold the board into every corner of the picture, near and far, tilted each way.</p>
          <Button icon="camera" disabled={!ready} onClick={() => void ask({ kind: "capture", stage: "camera", seconds: seconds() })}>
            Picture of the board
          </Button>
          <Coverage of={now} />
          <p class="quiet">2. Hold it into the laser's light, at several distances.</p>
          <Button icon="camera" disabled={!ready} onClick={() => void ask({ kind: "capture", stage: "laser", seconds: seconds() })}>
            Board with each laser
          </Button>
          <p class="quiet">3. Put the target on the table.</p>
          <NumberField label="Steps" value={steps.value} min={3} max={400} step={1} onChange={(value) => (steps.value = value ?? 24)} />
          <Button disabled={!ready} onClick={() => void ask({ kind: "capture_table", steps: steps.value, seconds: seconds() })}>
            Turn the table once
          </Button>
          <Views of={now} />
          {now.missing.map((words) => (
            <p key={words} class="remark warning">
              {words}
            </p>
          ))}
          <TextField label="Name" value={rigName.value} onChange={(value) => (rigName.value = value)} />
          <Button kind="primary" disabled={!ready || now.missing.length > 0 || !rigName.value} onClick={() => void ask({ kind: "calibrate_finish", name: rigName.value })}>
            Calibrate
          </Button>
        </>
      )}
      {report && report.state !== "running" && report.text && <p role="status">{report.text}</p>}
      {report?.findings.map((remark) => <RemarkLine key={remark.where + remark.text} remark={remark} />)}
    </Section>
  );
}
