/** Resuming scans that were interrupted. */
import { signal } from "@preact/signals";
import { ask, devices, go, isOperator, scans } from "../state";
import { Button, Check, NumberField, Section } from "../ui/controls";

/** Where a person says that the table stands; null believes the table. */
const standing = signal<number | null>(null);
const retake = signal(false);

/** Take what a scan is missing with what is connected; without devices, the way to them. */
export async function resume(scan: string): Promise<void> {
  if (!devices.value?.addresses.length) {
    go("rig");
    return;
  }
  go("scan");
  await ask({ kind: "resume", scan, retake: retake.value, at_deg: standing.value });
}

export function InterruptedPanel() {
  const interrupted = scans.value.filter((entry) => entry.missing > 0);
  if (!interrupted.length || !devices.value?.addresses.length) return null;
  return (
    <Section title="Interrupted" count={interrupted.length}>
      <ul class="list" aria-label="Interrupted scans">
        {interrupted.map(({ scan, name, missing }) => (
          <li key={scan}>
            <span class="grow">
              {name} <span class="quiet">{missing} steps missing</span>
            </span>
            <Button
              small
              disabled={!isOperator.value}
              label={`Capture what ${name} is missing`}
              onClick={() => void resume(scan)}
            >
              Resume
            </Button>
          </li>
        ))}
      </ul>
      <NumberField
        label="Current table angle"
        value={standing.value}
        unit="°"
        placeholder="as the controller reports"
        onChange={(value) => (standing.value = value)}
      />
      <Check label="Retake damaged frames" checked={retake.value} onChange={(on) => (retake.value = on)} />
    </Section>
  );
}
