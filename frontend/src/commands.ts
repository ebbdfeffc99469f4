/** Everything the page can do, once: the palette, the key sheet and the keyboard read this list. */
import { signal } from "@preact/signals";
import { link } from "./bus";
import { strokeOf } from "./keys";
import { http } from "./link";
import { redo, undo } from "./part";
import { answering, ask, complain, go, level, notify, place, stopping, theme } from "./state";
import { closeDialog, dialogs } from "./ui/dialog";
import { invite } from "./ui/invite";

export interface Command {
  title: string;
  group: string;
  /** As people write them: "Ctrl+Shift+Z"; several are parted by " / ". */
  keys?: string;
  run: () => void;
  enabled?: () => boolean;
}

export const paletteOpen = signal(false);
export const keysOpen = signal(false);
/** The commands of the room that is shown. */
export const roomCommands = signal<readonly Command[]>([]);
/** The rooms, for the commands that lead there and those that they offer. */
export const roomList = signal<readonly Place[]>([]);

/** What can be done with files, each with how to begin it. */
export const fileCommands = signal<readonly Command[]>([]);

/** The start page and the wizard, which no number leads to. */
export const sideRooms = signal<readonly Place[]>([]);

interface Place {
  id: string;
  title: string;
  needsScan: boolean;
  commands: readonly Command[];
}

const DOUBT_MS = 1000;

/** Lasers dark and table stopped, for anybody, from anywhere: by HTTP where the socket is silent. */
export async function stop(): Promise<void> {
  stopping.value = "sent";
  const doubt = setTimeout(() => (stopping.value = "unconfirmed"), DOUBT_MS);
  try {
    if (answering.value) await link.request({ kind: "stop" });
    else await http("api/stop", { method: "POST" });
    stopping.value = "confirmed";
    notify("note", "Stopped: lasers dark, table still.");
  } catch (error) {
    stopping.value = "unconfirmed";
    if (!(error instanceof TypeError)) complain(error); // without a network the banner says it all
  } finally {
    clearTimeout(doubt);
  }
}

function general(): Command[] {
  return [
    { title: "STOP: lasers dark, table still", group: "Everywhere", keys: "Ctrl+.", run: () => void stop() },
    { title: "All commands", group: "Everywhere", keys: "Ctrl+K", run: () => (paletteOpen.value = true) },
    { title: "Keys", group: "Everywhere", keys: "?", run: () => (keysOpen.value = true) },
    { title: "Undo", group: "Everywhere", keys: "Ctrl+Z", run: () => void undo() },
    { title: "Redo", group: "Everywhere", keys: "Ctrl+Shift+Z / Ctrl+Y", run: () => void redo() },
    {
      title: "Dark or light",
      group: "Everywhere",
      run: () => (theme.value = theme.value === "dark" ? "light" : "dark"),
    },
    {
      title: "Beginner or expert panels",
      group: "Everywhere",
      run: () => (level.value = level.value === "beginner" ? "expert" : "beginner"),
    },
    { title: "Invite another browser", group: "Everywhere", run: () => void invite() },
    { title: "Take control", group: "Everywhere", run: () => void ask({ kind: "take_control" }) },
    ...fileCommands.value,
    { title: "All scans", group: "Rooms", run: () => go("projects", null) },
    ...roomList.value.map(({ id, title }, i) => ({
      title: `Go to ${title}`,
      group: "Rooms",
      keys: `Alt+${i + 1}`,
      run: () => go(id),
      enabled: () => place.value.room !== id,
    })),
  ];
}

export function allCommands(): Command[] {
  return [...roomCommands.value, ...general()];
}

/** What the other rooms offer and this one does not: running it leads there first. */
export function commandsElsewhere(): Command[] {
  const here = new Set(allCommands().map(({ title }) => title));
  return [...roomList.value, ...sideRooms.value]
    .filter(({ id, needsScan }) => id !== place.value.room && !(needsScan && place.value.scan === null))
    .flatMap(({ id, title: room, commands }) =>
      commands
        .filter(({ title }) => !here.has(title))
        .map(({ title, run, enabled }) => ({
          title,
          enabled,
          group: room,
          run: () => {
            if (roomList.value.some((one) => one.id === id)) go(id);
            else go(id, null);
            setTimeout(run);
          },
        })),
    );
}

const TEXT_FIELDS = 'input:not([type="checkbox"]):not([type="radio"]):not([type="range"]), textarea, select';

/** Run the command of a key stroke; keys belong to a text field while one is being filled in. */
export function onKey(event: KeyboardEvent): void {
  const stroke = strokeOf(event);
  if (stroke === "Esc" && closeDialog()) {
    event.preventDefault();
    return;
  }
  const target = event.target as Element;
  const writing = target.matches?.(TEXT_FIELDS) || dialogs.value.length > 0;
  if (writing && stroke !== "Ctrl+." && stroke !== "Ctrl+K") return;
  const command = allCommands().find(
    ({ keys, enabled }) => keys?.split(" / ").includes(stroke) && (enabled?.() ?? true),
  );
  if (!command) return;
  event.preventDefault();
  command.run();
}
