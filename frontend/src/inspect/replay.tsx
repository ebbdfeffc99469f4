/** A dialog that takes the measurements of this scan on another scan of the same part. */
import { signal } from "@preact/signals";
import { useState } from "preact/hooks";
import { link } from "../bus";
import { cursor, history, opened } from "../part";
import { complain, go, notify, scans } from "../state";
import { Button, SelectField } from "../ui/controls";
import { useDialog } from "../ui/dialog";

export const replaying = signal(false);

type Stands = "same" | "elsewhere";
const STANDS = [
  ["same", "in the same place"],
  ["elsewhere", "elsewhere: find it by its shape"],
] as const;

const CHECK = "Check on the part that each measurement is where it belongs.";

/** Whether an edit measures, or says what a measurement is to be. */
export const measures = (name: string) => name.startsWith("measure_") || name === "specify";

export function ReplayDialog() {
  return replaying.value ? <Shown /> : null;
}

function Shown() {
  const close = () => (replaying.value = false);
  const dialog = useDialog(close);
  const source = opened.value;
  const [to, setTo] = useState("");
  const [stands, setStands] = useState<Stands>("same");
  const [busy, setBusy] = useState(false);
  const edits = history.value
    .slice(0, cursor.value)
    .filter(({ name, on }) => on && measures(name))
    .map(({ edit }) => edit);
  const others = scans.value.filter(({ scan, content }) => scan !== source?.scan && content);

  async function take(): Promise<void> {
    if (!source) return;
    setBusy(true);
    try {
      const by_shape = stands === "elsewhere";
      const { header } = await link.request({ kind: "copy_edits", scan: source.scan, edits, to, by_shape });
      if (header.kind === "done") for (const { text } of header.findings) notify("warning", text, CHECK);
      close();
      go("measure", to);
    } catch (error) {
      complain(error);
      setBusy(false);
    }
  }
  return (
    <dialog ref={dialog} class="invite" aria-labelledby="replay-title" aria-modal="true">
      <header>
        <h2 id="replay-title">Measure the same on another scan</h2>
        <Button kind="plain" icon="close" label="Close" keys="Esc" onClick={close} />
      </header>
      <div class="body">
        <SelectField
          label="Scan of the same part"
          value={to}
          options={[["", "choose …"] as const, ...others.map(({ scan, name }) => [scan, name] as const)]}
          onChange={setTo}
        />
        <SelectField label="It stands there" value={stands} options={STANDS} onChange={setStands} />
        <p class="quiet">
          Measurements, their names and limits are added to that scan and taken on its surface. They can be undone
          there.
        </p>
        <Button kind="primary" disabled={!to || busy} onClick={() => void take()}>
          {busy ? "Measuring …" : "Measure there"}
        </Button>
      </div>
    </dialog>
  );
}
