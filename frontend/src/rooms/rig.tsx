/** Rig: what is connected, what the camera sees, and whether all of it is fit for a scan. */
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { kept } from "../kept";
import type { FoundDevice } from "../protocol";
import { findDevices, finding, found, isScanning, orientation } from "../scanner/live";
import { forgetSharpest, Meters } from "../scanner/meters";
import { RemarkLine, useLastJob } from "../scanner/remarks";
import { StripeField } from "../scanner/stripe";
import { LivePane } from "../scanner/views";
import { ask, devices, go, isOperator } from "../state";
import { Button, Check, NumberField, Section, SelectField, TextField } from "../ui/controls";
import { pressNamed } from "../ui/onpage";
import { Watching } from "../ui/watching";
import type { Room } from "./room";

const SIMULATED = "sim:cup?seed=7";
const camera = kept<string>("camera", SIMULATED);
const turntable = kept<string>("turntable", SIMULATED);
const lasers = kept<string>("lasers", SIMULATED);

const connected = () => (devices.value?.addresses.length ?? 0) > 0;

function choose({ address, role }: FoundDevice): void {
  if (role === "camera") camera.value = address;
  else {
    turntable.value = lasers.value = address;
    if (address.startsWith("sim:")) camera.value = address;
  }
}

/** Said at an address that is empty. */
function Needed({ like }: { like: string }) {
  return (
    <p class="remark error" role="alert">
      An address is needed here, like {like}, or {SIMULATED} for the simulated rig.
    </p>
  );
}

function DevicesPanel() {
  const busy = useSignal(false);
  // Until Connect is pressed again: a line that went with a field's change would move the button away.
  const empty = useSignal<readonly string[]>([]);
  const connect = async () => {
    const needed = { camera: camera.value, turntable: turntable.value };
    empty.value = Object.entries(needed).flatMap(([name, value]) => (value.trim() ? [] : [name]));
    if (empty.value.length) return;
    busy.value = true;
    await ask({
      kind: "connect",
      camera: camera.value,
      turntable: turntable.value,
      lasers: lasers.value || turntable.value,
    });
    busy.value = false;
  };
  return (
    <Section title="Devices">
      <TextField label="Camera" value={camera.value} onChange={(value) => (camera.value = value)} />
      {empty.value.includes("camera") && <Needed like="uvc:0" />}
      <TextField label="Turntable" value={turntable.value} onChange={(value) => (turntable.value = value)} />
      {empty.value.includes("turntable") && <Needed like="grbl:/dev/ttyUSB0" />}
      <TextField label="Lasers" value={lasers.value} onChange={(value) => (lasers.value = value)} />
      <div class="grid-2">
        <Button
          kind={connected() ? undefined : "primary"}
          disabled={busy.value || !isOperator.value || isScanning()}
          onClick={() => void connect()}
        >
          {busy.value ? "Connecting …" : connected() ? "Connect again" : "Connect"}
        </Button>
        <Button
          disabled={!connected() || !isOperator.value || isScanning()}
          onClick={() => void ask({ kind: "disconnect" })}
        >
          Disconnect
        </Button>
      </div>
      <Watching />
    </Section>
  );
}

function FoundPanel() {
  useEffect(() => {
    if (!found.value) void findDevices(false);
  }, []);
  const list = found.value;
  return (
    <Section title="Found on this computer" open={!connected()} count={list?.devices.length ?? "…"}>
      <ul class="list" aria-label="Devices that were found">
        {list?.devices.map((device) => (
          <li key={device.address}>
            <button type="button" class="button plain grow" title="Use this address" onClick={() => choose(device)}>
              <span>
                <span class="num">{device.address}</span> <span class="quiet">{device.text}</span>
              </span>
            </button>
          </li>
        ))}
      </ul>
      {list?.notes.map((note) => (
        <RemarkLine key={note.text} remark={note} />
      ))}
      <div class="row">
        <Button disabled={finding.value} onClick={() => void findDevices(false)}>
          Search again
        </Button>
        <Button
          disabled={finding.value || connected()}
          label="Identifies the controller at every serial port; nothing moves or is lit"
          onClick={() => void findDevices(true)}
        >
          Identify serial devices
        </Button>
      </div>
    </Section>
  );
}

function LookPanel() {
  const lit = useSignal<readonly string[]>([]);
  const ms = useSignal(20);
  const gain = useSignal(1);
  const now = devices.value;
  if (!now || !connected()) return null;
  const look = (on: boolean) =>
    void ask({
      kind: "look",
      on,
      lit: [...lit.value],
      seconds: ms.value / 1000,
      gain: gain.value,
      orientation: orientation.value,
    });
  const changed = () => {
    if (now.looking) look(true);
  };
  const light = (name: string, on: boolean) => {
    lit.value = on ? [...lit.value, name] : lit.value.filter((other) => other !== name);
    changed();
  };
  const ready = isOperator.value && !isScanning();
  return (
    <Section title="Live picture">
      {now.lasers.map(({ name }) => (
        <Check
          key={name}
          label={`Laser ${name}`}
          checked={lit.value.includes(name)}
          onChange={(on) => light(name, on)}
        />
      ))}
      <NumberField
        label="Exposure"
        value={ms.value}
        unit="ms"
        min={0.01}
        onChange={(value) => {
          ms.value = value ?? 20;
          changed();
        }}
      />
      <NumberField
        label="Gain"
        value={gain.value}
        min={0.1}
        onChange={(value) => {
          gain.value = value ?? 1;
          changed();
        }}
      />
      <StripeField />
      <div class="row fill">
        <Button
          kind={now.looking ? undefined : "primary"}
          icon="camera"
          disabled={!ready || now.looking}
          onClick={() => {
            forgetSharpest();
            look(true);
          }}
        >
          Start live view
        </Button>
        <Button disabled={!now.looking} onClick={() => look(false)}>
          Stop live view
        </Button>
      </div>
      <Meters />
      <p class="quiet">Lasers are switched off automatically when this page is closed.</p>
    </Section>
  );
}

function TablePanel() {
  const to = useSignal(0);
  if (!connected()) return null;
  const ready = isOperator.value && !isScanning();
  const turn = (degrees: number) => {
    to.value = degrees;
    void ask({ kind: "turn", angle_deg: degrees });
  };
  return (
    <Section title="Turntable">
      <NumberField label="Turn to" value={to.value} unit="°" onChange={(value) => (to.value = value ?? 0)} />
      <div class="grid-3">
        <Button disabled={!ready} onClick={() => turn(to.value - 10)}>
          −10°
        </Button>
        <Button disabled={!ready} onClick={() => turn(to.value)}>
          Turn
        </Button>
        <Button disabled={!ready} onClick={() => turn(to.value + 10)}>
          +10°
        </Button>
      </div>
    </Section>
  );
}

function DoctorPanel() {
  const report = useLastJob("doctor");
  if (!connected()) return null;
  return (
    <Section title="Doctor">
      <Button
        disabled={!isOperator.value || isScanning() || report?.state === "running"}
        onClick={() => void ask({ kind: "doctor" })}
      >
        Is everything ready for a scan?
      </Button>
      {report?.state === "running" && (
        <p class="quiet">Looking; the table turns a little, each laser is lit for a moment.</p>
      )}
      {report?.state === "done" && (
        <>
          <div role="status" aria-label="Verdict of the doctor">
            {report.text.split("\n").map((line) => (
              <p key={line}>{line.startsWith("verdict") ? <strong>{line}</strong> : line}</p>
            ))}
          </div>
          {report.findings.map((remark) => (
            <RemarkLine key={remark.text} remark={remark} />
          ))}
        </>
      )}
    </Section>
  );
}

function RigPanel() {
  const now = devices.value;
  if (!now) return null;
  const options = [
    ["", now.rig ? now.rig_name || "the simulated rig's" : "none"] as const,
    ...now.rigs.filter((name) => name !== now.rig_name).map((name) => [name, name] as const),
  ];
  return (
    <Section title="Calibration" count={now.rig ? "known" : "none"}>
      <SelectField
        label="Rig in use"
        value=""
        options={options}
        onChange={(name) => name && void ask({ kind: "use_rig", name })}
      />
      <Button icon="point" onClick={() => go("calibrate", null)}>
        Calibrate …
      </Button>
    </Section>
  );
}

function Rig() {
  return (
    <div class="room no-rail">
      <LivePane
        empty={
          connected()
            ? "Start live view for pictures of the camera."
            : "Connect devices, or the simulated rig already filled in."
        }
      />
      <aside class="inspector" aria-label="Setup">
        <DevicesPanel />
        <FoundPanel />
        <LookPanel />
        <TablePanel />
        <DoctorPanel />
        <RigPanel />
      </aside>
    </div>
  );
}

const PRESSED = [
  "Connect",
  "Connect again",
  "Disconnect",
  "Search again",
  "Identify serial devices",
  "Start live view",
  "Stop live view",
  "Turn",
  "Is everything ready for a scan?",
] as const;

export const rig: Room = {
  id: "rig",
  title: "Setup",
  needsScan: false,
  View: Rig,
  commands: [
    { title: "Calibrate …", group: "Setup", run: () => go("calibrate", null) },
    ...PRESSED.map((title) => ({ title, group: "Setup", run: () => pressNamed(title) })),
  ],
};
