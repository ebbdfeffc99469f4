/** What can be pressed on the page, for commands that lead there and for the list of all commands. */
import type { Command } from "../commands";
import { notify } from "../state";

const PRESSED = "button, a.button, summary";
const FILLED = "input:not([type=file]):not([hidden]), select";

const words = (text: string | null | undefined) => (text ?? "").replace(/\s+/g, " ").trim();

/** As people and screen readers call it. */
function nameOf(element: HTMLElement): string {
  const said = words(element.getAttribute("aria-label"));
  if (said) return said;
  if (element instanceof HTMLInputElement || element instanceof HTMLSelectElement)
    return words(element.labels?.[0]?.textContent);
  return words((element.localName === "summary" ? element.firstChild : element)?.textContent);
}

function show(element: HTMLElement): void {
  for (let at: HTMLElement | null = element.parentElement; at; at = at.parentElement)
    if (at instanceof HTMLDetailsElement && !element.matches("summary")) at.open = true;
  element.scrollIntoView({ block: "nearest" });
  element.focus();
}

function press(element: HTMLElement): void {
  show(element);
  element.click();
}

const resting = (element: HTMLElement) => element.matches(":disabled") || element.closest("[inert]") !== null;

const LOOKS = 20;
const PAUSE_MS = 25;

/** Press what has this name in the room that is being shown; where it cannot be pressed it says so. */
export function pressNamed(name: string, looks = LOOKS): void {
  // The room that a command leads to, and what was chosen in it, are on the page only later.
  setTimeout(() => {
    const all = [...document.querySelectorAll<HTMLElement>(`main :is(${PRESSED}, ${FILLED})`)];
    const element = all.find((one) => nameOf(one) === name);
    if (element && !resting(element)) press(element);
    else if (looks > 1) pressNamed(name, looks - 1);
    else notify("note", `“${name}” cannot be used at the moment.`);
  }, PAUSE_MS);
}

/** Every button, section and field of the room that is shown: buttons are pressed, fields are led to. */
export function onThisPage(known: ReadonlySet<string>): Command[] {
  const found = new Map<string, Command>();
  for (const element of document.querySelectorAll<HTMLElement>(`main :is(${PRESSED}, ${FILLED})`)) {
    const title = nameOf(element);
    const listed = known.has(title) || known.has(`${title} …`) || found.has(title);
    if (!title || listed || element.closest("[hidden]")) continue;
    // The room rests while the list is shown: what is disabled says so by itself.
    const enabled = () => !element.matches(":disabled");
    const act = element.matches(PRESSED) ? press : show;
    found.set(title, { title, group: "On this page", run: () => setTimeout(() => act(element)), enabled });
  }
  return [...found.values()];
}
