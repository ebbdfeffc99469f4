/** Status line, notices, palette and key sheet: what is the same in every room. */
import { signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useMemo, useState } from "preact/hooks";
import { allCommands, type Command, commandsElsewhere, keysOpen, paletteOpen } from "../commands";
import { ask, dismiss, jobs, notices } from "../state";
import { Button } from "./controls";
import { dialogs, useDialog } from "./dialog";
import { onThisPage } from "./onpage";

/** What the tool at hand does, for the status line. */
export const hint = signal("");

export function StatusLine({ children }: { children?: ComponentChildren }) {
  const running = [...jobs.value.values()].filter((job) => job.state === "running");
  return (
    <footer class="status" inert={dialogs.value.length > 0}>
      <span class="hint">{hint.value}</span>
      {running.map((job) => (
        <span key={job.job} class="row" role="status">
          {job.title}
          <progress aria-label={job.title} {...(job.total ? { max: job.total, value: job.done } : {})} />
          {job.seconds_left !== null && <span class="num">{left(job.seconds_left)}</span>}
          <Button kind="plain" small onClick={() => void ask({ kind: "cancel", job: job.job })}>
            Cancel
          </Button>
        </span>
      ))}
      {children}
    </footer>
  );
}

export function left(seconds: number): string {
  const whole = Math.round(seconds);
  return whole < 60 ? `${whole} s left` : `${Math.floor(whole / 60)} min ${whole % 60} s left`;
}

export function Notices() {
  return (
    <div class="notices" role="log" aria-live="polite" aria-label="Messages">
      {notices.value.map(({ id, severity, text, hint: advice }) => (
        <div key={id} class={`notice ${severity}`} role={severity === "error" ? "alert" : undefined}>
          <span>{text}</span>
          <Button kind="plain" small icon="close" label="Close this message" onClick={() => dismiss(id)} />
          {advice && <span class="hint">{advice}</span>}
        </div>
      ))}
    </div>
  );
}

export function Palette() {
  return paletteOpen.value ? <PaletteDialog /> : null;
}

function PaletteDialog() {
  const close = () => (paletteOpen.value = false);
  const dialog = useDialog(close);
  const [words, setWords] = useState("");
  const [at, setAt] = useState(0);
  const wanted = words.toLowerCase().split(/\s+/).filter(Boolean);
  // What the server offers may come while the list is shown: it is in it then.
  const named = [...allCommands(), ...commandsElsewhere()];
  const titles = named.map(({ title }) => title);
  const onPage = useMemo(() => onThisPage(new Set(titles)), [titles.join("\n")]);
  const found = [...named, ...onPage].filter(({ title, group }) =>
    wanted.every((word) => `${title} ${group}`.toLowerCase().includes(word)),
  );
  const run = (command: Command | undefined) => {
    if (!command || !(command.enabled?.() ?? true)) return;
    close();
    command.run();
  };
  const onKeyDown = (event: KeyboardEvent) => {
    if (event.key === "ArrowDown") setAt(Math.min(at + 1, found.length - 1));
    else if (event.key === "ArrowUp") setAt(Math.max(at - 1, 0));
    else if (event.key === "Enter") run(found[at]);
    else return;
    event.preventDefault();
  };
  return (
    <dialog ref={dialog} class="palette" aria-label="All commands" aria-modal="true">
      <input
        type="text"
        placeholder="What do you want to do?"
        role="combobox"
        aria-expanded="true"
        aria-controls="palette-list"
        aria-activedescendant={found.length ? `command-${at}` : undefined}
        aria-label="Search the commands"
        value={words}
        onInput={(event) => {
          setWords(event.currentTarget.value);
          setAt(0);
        }}
        onKeyDown={onKeyDown}
      />
      <ul id="palette-list" role="listbox" aria-label="Commands">
        {found.map((command, i) => (
          <li
            key={`${command.group} ${command.title}`}
            id={`command-${i}`}
            role="option"
            aria-selected={i === at}
            aria-disabled={!(command.enabled?.() ?? true)}
            onClick={() => run(command)}
            onMouseMove={() => setAt(i)}
          >
            <span>{command.title}</span>
            {command.keys && <kbd>{command.keys}</kbd>}
          </li>
        ))}
      </ul>
    </dialog>
  );
}

const MOUSE: readonly (readonly [string, string])[] = [
  ["Use the tool", "left button"],
  ["Turn about the point", "right button"],
  ["Shift", "middle button"],
  ["Nearer to the cursor", "wheel"],
  ["Size of the brush", "Ctrl+wheel"],
  ["Add to the selection", "Shift"],
  ["Remove from the selection", "Ctrl or Alt"],
  ["What is in both", "Shift+Ctrl"],
  ["Look straight along an axis", "click on the axes"],
];

export function KeySheet() {
  return keysOpen.value ? <KeyDialog /> : null;
}

function KeyDialog() {
  const close = () => (keysOpen.value = false);
  const dialog = useDialog(close);
  const groups = Map.groupBy(
    allCommands().filter(({ keys }) => keys),
    ({ group }) => group,
  );
  return (
    <dialog ref={dialog} class="keys" aria-labelledby="keys-title" aria-modal="true">
      <header>
        <h2 id="keys-title">Keys and mouse</h2>
        <Button kind="plain" icon="close" label="Close" keys="Esc" onClick={close} />
      </header>
      <div class="columns">
        <section>
          <h3>Mouse</h3>
          <dl>
            {MOUSE.map(([what, how]) => [
              <dt key={what}>{what}</dt>,
              <dd key={how}>
                <kbd>{how}</kbd>
              </dd>,
            ])}
          </dl>
        </section>
        {[...groups].map(([group, commands]) => (
          <section key={group}>
            <h3>{group}</h3>
            <dl>
              {commands.map(({ title, keys }) => [
                <dt key={title}>{title}</dt>,
                <dd key={keys}>
                  <kbd>{keys}</kbd>
                </dd>,
              ])}
            </dl>
          </section>
        ))}
      </div>
    </dialog>
  );
}
