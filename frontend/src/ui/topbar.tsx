import { keysOpen, paletteOpen, stop } from "../commands";
import { scanName } from "../part";
import type { DeviceState, LaserState } from "../protocol";
import { rooms } from "../rooms";
import {
  answering,
  ask,
  clients,
  connection,
  devices,
  go,
  isOperator,
  operator,
  place,
  scans,
  stopping,
  theme,
} from "../state";
import { Button } from "./controls";
import { dialogs } from "./dialog";
import { Icon } from "./icons";

const CONNECTION = {
  connecting: ["busy", "connecting"],
  open: ["good", "server online"],
  silent: ["bad", "no answer: laser state unknown"],
  lost: ["bad", "no connection: laser state unknown"],
} as const;
const DEVICE = { none: "", ready: "good", busy: "busy", failed: "bad" } as const;

export function TopBar() {
  const silent = connection.value === "open" && !answering.value;
  const [dot, words] = CONNECTION[silent ? "silent" : connection.value];
  const ofNoPart = scans.value.some(({ scan, simulated }) => simulated && scan === place.value.scan);
  return (
    <header class="topbar" inert={dialogs.value.length > 0}>
      <button type="button" class="brand" onClick={() => go("projects", null)} title="All scans">
        <Icon name="logo" />
        turnscan
      </button>
      <nav class="rooms" aria-label="Rooms">
        {rooms.map(({ id, title, needsScan }, i) => (
          <button
            key={id}
            type="button"
            class="button"
            title={`${title} (Alt+${i + 1})`}
            aria-current={place.value.room === id ? "page" : undefined}
            disabled={needsScan && !place.value.scan}
            onClick={() => go(id)}
          >
            {title}
          </button>
        ))}
      </nav>
      {scanName.value && (
        <span class="part-name" title={scanName.value}>
          {scanName.value}
        </span>
      )}
      {ofNoPart && (
        <span class="chip" title="The pictures of this scan are of no real part">
          simulated
        </span>
      )}
      <span class="spring" />
      <div class="chips" role="status" aria-label="Devices and connection">
        {devices.value?.camera && <DeviceChip name="Camera" device={devices.value.camera} />}
        {devices.value?.table && (
          <DeviceChip name="Table" device={devices.value.table} angle={devices.value.angle_deg} />
        )}
        {devices.value?.lasers.map((laser) => (
          <LaserChip key={laser.name} laser={laser} />
        ))}
        <span class="chip">
          <span class={`dot ${dot}`} />
          {words}
        </span>
        <span class="chip" title="One operator may edit, move and light; all others watch.">
          {isOperator.value ? "operator" : "watching"}
          {clients.value > 1 && <span class="num">· {clients.value}</span>}
        </span>
      </div>
      {!isOperator.value && connection.value === "open" && (
        <Button
          small
          label={operator.value ? "The operator before you will see it" : undefined}
          onClick={() => void ask({ kind: "take_control" })}
        >
          Take control
        </Button>
      )}
      <Button
        kind="plain"
        icon="search"
        label="All commands"
        keys="Ctrl+K"
        onClick={() => (paletteOpen.value = true)}
      />
      <Button
        kind="plain"
        icon="sun"
        label="Dark or light"
        onClick={() => (theme.value = theme.value === "dark" ? "light" : "dark")}
      />
      <Button kind="plain" icon="help" label="Keys" keys="?" onClick={() => (keysOpen.value = true)} />
    </header>
  );
}

function DeviceChip({ name, device, angle }: { name: string; device: DeviceState; angle?: number | null }) {
  if (device.state === "none") return null;
  return (
    <span class="chip" title={device.text}>
      <span class={`dot ${DEVICE[device.state]}`} />
      {name}
      {angle !== undefined && angle !== null && <span class="num">{angle.toFixed(1)}°</span>}
    </span>
  );
}

/** A laser that nobody has confirmed to be dark is shown as lit. */
function LaserChip({ laser }: { laser: LaserState }) {
  const lit = answering.value ? laser.lit : null;
  const dark = lit === false;
  const words = lit === null ? "not known" : lit ? "lit" : "dark";
  return (
    <span
      class={`chip ${dark ? "" : "lit"}`}
      title={`Laser ${laser.name}: ${words}, confirmed ${laser.age_seconds.toFixed(0)} s ago`}
    >
      <span class="dot" />
      {laser.name}: {words}
    </span>
  );
}

/** Beside the bar, not in it: it stays when a dialog makes all else inert. */
export function StopButton() {
  return (
    <button
      type="button"
      class="stop"
      title="Lasers dark, table still, at once (Ctrl+.)"
      aria-keyshortcuts="Control+."
      onClick={() => void stop()}
    >
      STOP
    </button>
  );
}

/** What nobody may miss: that it is not known whether a laser is lit. */
export function Alarm() {
  const lasers = devices.value?.lasers.length ?? 0;
  const unheard = connection.value !== "connecting" && !answering.value;
  if (stopping.value !== "unconfirmed" && !(unheard && lasers > 0)) return null;
  const why = unheard ? "The server does not answer" : "STOP is not confirmed";
  return (
    <div class="alarm" role="alert">
      <strong>{why}: laser state unknown.</strong> Keep away from the laser, and cut its power.
    </div>
  );
}
