/** Scan: a plan, the camera and the points while it runs, and the way to the Edit room. */
import { type Signal, signal } from "@preact/signals";
import { kept } from "../kept";
import type { ScanPlan } from "../protocol";
import { isScanning, orientation, scanning } from "../scanner/live";
import { InterruptedPanel } from "../scanner/resume";
import { StripeField } from "../scanner/stripe";
import { CloudPane, LivePane } from "../scanner/views";
import { ask, devices, go, isOperator, jobs } from "../state";
import { Button, Check, NumberField, Section, SelectField, TextField } from "../ui/controls";
import { left } from "../ui/frame";
import { Watching } from "../ui/watching";
import type { Room } from "./room";

const name = kept<string>("scan-name", "part");
const steps = signal<number | null>(null);
const from = signal(0);
const to = signal(360);
const exposures = signal("");
const keep = signal<"sparse" | "full">("sparse");
const threshold = signal<number | null>(null);
/** ms of a picture without laser; null takes none. */
const texture = signal<number | null>(null);
const textureEvery = signal(1);
const unused = signal<ReadonlySet<string>>(new Set());
/** Outputs of the laser board that are lamps, for plain pictures. */
const lamps = signal<ReadonlySet<string>>(new Set());

const outputs = () => devices.value?.lasers.map((output) => output.name) ?? [];
const lasers = () => outputs().filter((name) => !lamps.value.has(name));

/** Milliseconds, one or several: "5" or "5, 40". */
function seconds(): number[] {
  return exposures.value
    .split(/[\s,;]+/)
    .filter(Boolean)
    .map((text) => Number(text) / 1000);
}

function plan(): ScanPlan {
  const used = lasers().filter((laser) => !unused.value.has(laser));
  return {
    name: name.value,
    steps: steps.value,
    from_deg: from.value,
    to_deg: to.value,
    lasers: used.length === lasers().length ? null : used,
    seconds: seconds(),
    keep: keep.value,
    threshold: threshold.value,
    orientation: orientation.value,
    texture: texture.value === null ? null : texture.value / 1000,
    texture_every: textureEvery.value,
    lamps: outputs().filter((name) => lamps.value.has(name)),
  };
}

/** What is missing from the plan, in words. */
function missing(): string | null {
  if (name.value === "") return "Give the scan a name.";
  if (!lasers().some((laser) => !unused.value.has(laser))) return "Choose a laser.";
  if (!seconds().every((s) => s > 0)) return "Exposures are milliseconds, like 5 or 5, 40.";
  return null;
}

const mayStart = () =>
  isOperator.value && !isScanning() && (devices.value?.addresses.length ?? 0) > 0 && missing() === null;

const start = () => void ask({ kind: "scan", plan: plan() });

/** Pause or resume, whichever there is. */
function toggle(): void {
  if (scanning.value?.state === "running") void ask({ kind: "pause" });
  else if (scanning.value?.state === "paused") void ask({ kind: "go_on" });
}

function put(set: Signal<ReadonlySet<string>>, name: string, on: boolean): void {
  const next = new Set(set.value);
  if (on) next.add(name);
  else next.delete(name);
  set.value = next;
}

function PlanPanel() {
  const now = devices.value;
  if (!now?.addresses.length) {
    return (
      <Section title="Plan">
        <p>No devices are connected.</p>
        <Button kind="primary" onClick={() => go("rig")}>
          Connect them in Setup
        </Button>
      </Section>
    );
  }
  return (
    <>
      <Section title="Plan">
        <TextField label="Name" value={name.value} onChange={(value) => (name.value = value)} />
        <NumberField
          label="Steps per turn"
          value={steps.value}
          min={1}
          step={1}
          placeholder="automatic"
          onChange={(value) => (steps.value = value)}
        />
        {lasers().map((name) => (
          <Check
            key={name}
            label={`Laser ${name}`}
            checked={!unused.value.has(name)}
            onChange={(on) => put(unused, name, !on)}
          />
        ))}
        <TextField
          label="Exposures"
          unit="ms"
          value={exposures.value}
          placeholder="automatic"
          onChange={(value) => (exposures.value = value)}
        />
      </Section>
      <Section title="More" open={false}>
        <NumberField label="From" value={from.value} unit="°" onChange={(value) => (from.value = value ?? 0)} />
        <NumberField label="To" value={to.value} unit="°" onChange={(value) => (to.value = value ?? 360)} />
        <NumberField
          label="Threshold"
          value={threshold.value}
          min={0}
          placeholder="automatic"
          onChange={(value) => (threshold.value = value)}
        />
        <NumberField
          label="Texture image"
          value={texture.value}
          unit="ms"
          min={0.01}
          placeholder="none"
          onChange={(value) => (texture.value = value)}
        />
        {texture.value !== null && (
          <NumberField
            label="Every N steps"
            value={textureEvery.value}
            min={1}
            step={1}
            onChange={(value) => (textureEvery.value = value ?? 1)}
          />
        )}
        {outputs().length > 1 &&
          outputs().map((name) => (
            <Check
              key={name}
              label={`${name} is a lamp for texture images`}
              checked={lamps.value.has(name)}
              onChange={(on) => put(lamps, name, on)}
            />
          ))}
        <StripeField />
        <SelectField
          label="Store"
          value={keep.value}
          options={[
            ["sparse", "laser stripe only"],
            ["full", "whole pictures"],
          ]}
          onChange={(value) => (keep.value = value)}
        />
      </Section>
      <div class="action">
        <Button kind="primary" icon="play" keys="Ctrl+Enter" label="Start" disabled={!mayStart()} onClick={start}>
          Start
        </Button>
        <Watching />
        {missing() && <p class="remark warning">{missing()}</p>}
        {!now.rig && (
          <span class="quiet">No calibration is known for these devices: points appear when a rig is added.</span>
        )}
      </div>
    </>
  );
}

function CoursePanel() {
  const now = scanning.value;
  const preparing =
    [...jobs.value.values()].some((job) => job.what === "scan" && job.state === "running") && !isScanning();
  if (preparing) {
    return (
      <Section title="Scan">
        <p role="status">The first pictures are taken: they decide the threshold.</p>
      </Section>
    );
  }
  if (!now) return null;
  const words = {
    running: "Running",
    paused: "Paused: lasers dark",
    complete: "Complete",
    aborted: "Stopped by you",
    failed: "Failed",
  };
  return (
    <Section title="Scan">
      <div class="row apart" role="status">
        <strong>{words[now.state]}</strong>
        <span class="num">
          {now.done} of {now.total} steps
        </span>
      </div>
      <progress class="wide" aria-label="Steps" max={now.total} value={now.done} />
      {isScanning() && now.seconds_left !== null && <span class="quiet num">{left(now.seconds_left)}</span>}
      {now.missing > 0 && <p class="remark warning">{now.missing} pictures are missing.</p>}
      {now.text && now.text !== now.state && <p class="quiet">{now.text}</p>}
      {isScanning() ? (
        <div class="grid-2">
          <Button
            icon={now.state === "paused" ? "play" : "pause"}
            keys="Space"
            label="Pause or resume"
            disabled={!isOperator.value}
            onClick={toggle}
          >
            {now.state === "paused" ? "Resume" : "Pause"}
          </Button>
          <Button kind="danger" disabled={!isOperator.value} onClick={() => void ask({ kind: "abort" })}>
            Stop scan
          </Button>
        </div>
      ) : (
        now.done > 0 && (
          <Button kind="primary" onClick={() => go("repair", now.scan)}>
            Edit it
          </Button>
        )
      )}
    </Section>
  );
}

function Scan() {
  return (
    <div class="room no-rail">
      <div class="views pairwise">
        <LivePane empty="The pictures appear here while the scan runs." />
        <CloudPane />
      </div>
      <aside class="inspector" aria-label="Scan">
        <CoursePanel />
        {!isScanning() && <PlanPanel />}
        {!isScanning() && <InterruptedPanel />}
      </aside>
    </div>
  );
}

export const scan: Room = {
  id: "scan",
  title: "Scan",
  needsScan: false,
  View: Scan,
  commands: [
    { title: "Start the scan", group: "Scan", keys: "Ctrl+Enter", run: start, enabled: mayStart },
    { title: "Pause or resume", group: "Scan", keys: "Space", run: toggle, enabled: isScanning },
    { title: "Stop scan", group: "Scan", run: () => void ask({ kind: "abort" }), enabled: isScanning },
  ],
};
