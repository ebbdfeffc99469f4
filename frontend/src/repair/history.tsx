/** The history: a tree of all edits, with names and pictures, any of which can be gone to. */
import { signal } from "@preact/signals";
import {
  branches,
  canUndo,
  cursor,
  goTo,
  history,
  nameEdit,
  opened,
  redo,
  scannedPicture,
  switchEdit,
  undo,
} from "../part";
import type { BranchEntry, HistoryEntry } from "../protocol";
import { isOperator } from "../state";
import { Button, Section, TextField } from "../ui/controls";
import { CopyEdits } from "./copying";
import { tab } from "./state";

/** The edit that is being named. */
const naming = signal<number | null>(null);

/** The last edit that counts, for the status line; a click shows the whole list. */
export function LastEdit() {
  const list = history.value;
  const last = list[cursor.value - 1];
  if (!list.length) return null;
  return (
    <Button kind="plain" small label="The last edit; show the history" onClick={() => (tab.value = "history")}>
      <span class={last?.on === false ? "off" : ""}>{last ? last.text : "as scanned"}</span>
      <span class="quiet num">
        {cursor.value} of {list.length}
      </span>
    </Button>
  );
}

function nameOf({ title, text }: HistoryEntry): string {
  return title ? `${title}: ${text}` : text;
}

/** The surface after an edit; what is not drawn yet has an empty place. */
function Picture({ name }: { name: string }) {
  return name ? (
    <img class="step-picture" src={`api/scans/${opened.value?.scan}/steps/${name}.png`} alt="" />
  ) : (
    <span class="step-picture" />
  );
}

function Step({ entry, inHistory }: { entry: HistoryEntry; inHistory: boolean }) {
  const named = naming.value === entry.edit;
  return (
    <div class="step">
      {inHistory && (
        <input
          type="checkbox"
          checked={entry.on}
          title={entry.on ? "Disable this edit" : "Enable this edit"}
          aria-label={`${entry.text}: in use`}
          disabled={entry.index >= cursor.value}
          onChange={(event) => void switchEdit(entry.edit, event.currentTarget.checked)}
        />
      )}
      <button
        type="button"
        class="button plain grow"
        title="Go to the state after this edit"
        onClick={() => void goTo(entry.edit)}
      >
        <Picture name={entry.picture} />
        <span class={entry.on ? "" : "off"}>
          {entry.title && <strong>{entry.title}</strong>}
          <span class={entry.title ? "quiet" : ""}>{entry.text}</span>
        </span>
        <span class="quiet num">{new Date(entry.at).toLocaleTimeString("sv").slice(0, 5)}</span>
      </button>
      <Button
        kind="plain"
        small
        icon="pencil"
        label={`Name: ${nameOf(entry)}`}
        pressed={named}
        disabled={!isOperator.value}
        onClick={() => (naming.value = named ? null : entry.edit)}
      />
      {named && (
        <TextField
          label="Name of this edit"
          value={entry.title}
          onChange={(name) => {
            naming.value = null;
            void nameEdit(entry.edit, name);
          }}
        />
      )}
    </div>
  );
}

/** The branches that grow from an edit, and those that grow from them. */
function Growing({ from }: { from: number }) {
  return (
    <>
      {branches.value
        .filter(({ after }) => after === from)
        .map((branch) => (
          <BranchList key={branch.edits[0].edit} branch={branch} />
        ))}
    </>
  );
}

function BranchList({ branch: { edits } }: { branch: BranchEntry }) {
  // It goes by the name that its steps were given last.
  const name = edits.findLast(({ title }) => title)?.title;
  return (
    <ul class="branch" aria-label={name ? `Branch ${name}` : `Branch of ${edits.length} other edits`}>
      {edits.map((entry) => (
        <li key={entry.edit}>
          <Step entry={entry} inHistory={false} />
          <Growing from={entry.edit} />
        </li>
      ))}
    </ul>
  );
}

export function HistoryPanel() {
  const list = history.value;
  const at = cursor.value;
  return (
    <Section title="History" count={list.length}>
      <div class="grid-2">
        <Button icon="undo" keys="Ctrl+Z" label="Undo" disabled={!canUndo.value} onClick={() => void undo()}>
          Undo
        </Button>
        <Button icon="redo" keys="Ctrl+Shift+Z" label="Redo" disabled={at >= list.length} onClick={() => void redo()}>
          Redo
        </Button>
      </div>
      <ol class="tree" aria-label="Edits, the first one first">
        <li class={at === 0 ? "current" : ""}>
          <div class="step">
            <button type="button" class="button plain grow" onClick={() => void goTo(0)}>
              <Picture name={scannedPicture.value} />
              <span>As scanned</span>
            </button>
          </div>
          <Growing from={0} />
        </li>
        {list.map((entry) => (
          <li
            key={entry.edit}
            class={`${entry.index + 1 === at ? "current" : ""} ${entry.index >= at ? "undone" : ""}`}
          >
            <Step entry={entry} inHistory />
            <Growing from={entry.edit} />
          </li>
        ))}
      </ol>
      {branches.value.length > 0 && (
        <p class="quiet">Indented edits are branches: a click on one makes its branch the history. Nothing is lost.</p>
      )}
      <CopyEdits />
      <p class="quiet">Every edit is in the scan file; the pictures are never changed.</p>
    </Section>
  );
}
