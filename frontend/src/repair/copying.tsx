/** A dialog that copies edits of this scan to another one. */
import { signal } from "@preact/signals";
import { useState } from "preact/hooks";
import { cursor, history, opened } from "../part";
import { ask, isOperator, notify, scans } from "../state";
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

function CopyDialog() {
  const close = () => (shown.value = false);
  const dialog = useDialog(close);
  const source = opened.value;
  const counts = history.value.slice(0, cursor.value);
  const [left, setLeft] = useState<ReadonlySet<number>>(
    new Set(counts.filter(({ on }) => !on).map(({ edit }) => edit)),
  );
  const [to, setTo] = useState("");
  const others = scans.value.filter(({ scan, content }) => scan !== source?.scan && content);
  const chosen = counts.map(({ edit }) => edit).filter((edit) => !left.has(edit));

  async function copy(): Promise<void> {
    const target = others.find(({ scan }) => scan === to);
    if (!source || !target) return;
    if (await ask({ kind: "copy_edits", scan: source.scan, edits: chosen, to })) {
      notify("note", `${chosen.length} edits were added to ${target.name}.`, "Open it to see what they do there.");
      close();
    }
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
          {counts.map(({ edit, text }) => (
            <Check
              key={edit}
              label={text}
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
        <p class="quiet">They come after the edits that scan has, and can be undone there.</p>
        <Button kind="primary" disabled={!to || !chosen.length} onClick={() => void copy()}>
          Copy {chosen.length} {chosen.length === 1 ? "edit" : "edits"}
        </Button>
      </div>
    </dialog>
  );
}
