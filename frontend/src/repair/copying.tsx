/** A dialog that copies edits of this scan to another one. */
import { signal } from "@preact/signals";
import { useState } from "preact/hooks";
import { link } from "../bus";
import { cursor, history, opened } from "../part";
import type { Remark } from "../protocol";
import { complain, go, isOperator, notify, scans } from "../state";
import { Button, Check, SelectField } from "../ui/controls";
import { useDialog } from "../ui/dialog";

const shown = signal(false);

/** Offer to copy edits of the scan that is open. */
export function CopyEdits() {
  return (
    <Button icon="copy" disabled={!history.value.length || !isOperator.value} onClick={() => (shown.value = true)}>
      Copy edits to another scan …
    </Button>
  );
}

/** The dialog, where the page puts all of them: what is in a room rests while one is open. */
export function CopyEditsDialog() {
  return shown.value ? <CopyDialog /> : null;
}

const edits = (many: number) => `${many} ${many === 1 ? "edit" : "edits"}`;

function CopyDialog() {
  const close = () => (shown.value = false);
  const dialog = useDialog(close);
  const source = opened.value;
  const counts = history.value.slice(0, cursor.value);
  const [left, setLeft] = useState<ReadonlySet<number>>(
    new Set(counts.filter(({ on }) => !on).map(({ edit }) => edit)),
  );
  const [to, setTo] = useState("");
  const [busy, setBusy] = useState(false);
  const [unfit, setUnfit] = useState<readonly Remark[] | null>(null);
  const others = scans.value.filter(({ scan, content }) => scan !== source?.scan && content);
  const chosen = counts.map(({ edit }) => edit).filter((edit) => !left.has(edit));

  function openTarget(): void {
    close();
    go("repair", to);
  }

  async function copy(): Promise<void> {
    const target = others.find(({ scan }) => scan === to);
    if (!source || !target) return;
    setBusy(true);
    try {
      const { header } = await link.request({ kind: "copy_edits", scan: source.scan, edits: chosen, to });
      if (header.kind === "done") setUnfit(header.findings);
      notify("note", `${edits(chosen.length)} added to ${target.name}.`, "They can be undone there.");
    } catch (error) {
      complain(error);
    } finally {
      setBusy(false);
    }
  }
  if (unfit) {
    return (
      <dialog ref={dialog} class="invite" aria-labelledby="copy-title" aria-modal="true">
        <header>
          <h2 id="copy-title">Edits copied</h2>
          <Button kind="plain" icon="close" label="Close" keys="Esc" onClick={close} />
        </header>
        <div class="body">
          <p role="status">
            {unfit.length
              ? `${edits(chosen.length)} added to the history; of these not everything fits:`
              : `${edits(chosen.length)} added to the history; all of them fit.`}
          </p>
          <ul class="copied-edits" aria-label="What does not fit">
            {unfit.map(({ where, text, remedy }, i) => (
              <li key={i}>
                <strong>{where}</strong> {text} <span class="quiet">{remedy}</span>
              </li>
            ))}
          </ul>
          <Button kind="primary" onClick={openTarget}>
            Open that scan
          </Button>
        </div>
      </dialog>
    );
  }
  return (
    <dialog ref={dialog} class="invite" aria-labelledby="copy-title" aria-modal="true">
      <header>
        <h2 id="copy-title">Copy edits to another scan</h2>
        <Button kind="plain" icon="close" label="Close" keys="Esc" onClick={close} />
      </header>
      <div class="body">
        <SelectField
          label="To"
          value={to}
          options={[["", "choose …"] as const, ...others.map(({ scan, name }) => [scan, name] as const)]}
          onChange={setTo}
        />
        <div class="copied-edits" role="group" aria-label="Edits to copy">
          {counts.map(({ edit, text, title }) => (
            <Check
              key={edit}
              label={title ? `${title}: ${text}` : text}
              checked={!left.has(edit)}
              onChange={(on) => {
                const next = new Set(left);
                if (on) next.delete(edit);
                else next.add(edit);
                setLeft(next);
              }}
            />
          ))}
        </div>
        <p class="quiet">
          They come after the edits that scan has, and can be undone there. Its surface is made, to say what fits.
        </p>
        <Button kind="primary" disabled={!to || !chosen.length || busy} onClick={() => void copy()}>
          {busy ? "Copying …" : `Copy ${edits(chosen.length)}`}
        </Button>
      </div>
    </dialog>
  );
}
