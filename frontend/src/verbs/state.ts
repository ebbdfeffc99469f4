/** The verbs that the server runs, the files for them, and what became of them. */
import { computed, signal } from "@preact/signals";
import { link, on } from "../bus";
import { RefusedError } from "../link";
import type { Added, FileEntry, JobState, Received, RemedyOption, VerbEntry } from "../protocol";
import { complain, go, jobs, notify, place, scans } from "../state";
import { chosen, type Schema, startValues, troubles, type Values, withFile } from "./schema";
import { put, type Sent } from "./upload";

export const verbs = signal<readonly VerbEntry[]>([]);
export const files = signal<readonly FileEntry[]>([]);
/** Opaque names of what was dropped last, for the start page to say what it is. */
export const arrived = signal<readonly string[]>([]);
export const sending = signal<Sending | null>(null);
/** What is in each verb's form; kept while the page is open. */
const forms = signal<ReadonlyMap<string, Form>>(new Map());

export interface Sending {
  done: number;
  total: number;
  /** Bytes of all files, and how many of them the server has. */
  bytes: number;
  received: number;
  /** Whether the server does not answer at the moment. */
  waiting: boolean;
}

export interface Form {
  values: Values;
  name: string;
  /** Job of its last run. */
  job: string | null;
  /** Why the last run was refused. */
  refused: Failure | null;
  /** Whether mistakes are shown: from the first run on. */
  tried: boolean;
}

export interface Failure {
  text: string;
  hint: string;
  options: readonly RemedyOption[];
}

/** Runs of this page, by their jobs; the list of all jobs forgets them. */
export const runs = signal<ReadonlyMap<string, JobState>>(new Map());
export const runOf = (form: Form) => (form.job === null ? undefined : runs.value.get(form.job));

const ROOM = "do-";
/** The verb whose form is shown. */
export const verbHere = computed(() =>
  place.value.room.startsWith(ROOM)
    ? verbs.value.find(({ verb }) => verb === place.value.room.slice(ROOM.length))
    : undefined,
);

export const schemaOf = (verb: VerbEntry) => verb.json_schema as unknown as Schema;

export function formOf(verb: VerbEntry): Form {
  const start = { values: startValues(schemaOf(verb)), name: "", job: null, refused: null, tried: false };
  return forms.value.get(verb.verb) ?? start;
}

export function change(verb: VerbEntry, part: Partial<Form>): void {
  forms.value = new Map(forms.value).set(verb.verb, { ...formOf(verb), ...part });
}

/** Show a verb's form, with a file in it: by default the scan that is shown. */
export function openVerb(name: string, file = place.value.scan): void {
  const verb = verbs.value.find((one) => one.verb === name);
  const kinds = scans.value.some(({ scan }) => scan === file)
    ? ["scan"]
    : (files.value.find((one) => one.file === file)?.kinds ?? []);
  if (verb && file) change(verb, { values: withFile(schemaOf(verb), formOf(verb).values, file, kinds) });
  go(`${ROOM}${name}`, null);
}

/** A name for the results: what was typed, or that of the first file and the verb. */
export function resultName(verb: VerbEntry): string {
  const form = formOf(verb);
  if (form.name) return form.name;
  const input = Object.entries(schemaOf(verb).properties).find(([, { role }]) => role === "input");
  const first = input && [form.values[input[0]]].flat()[0];
  const name =
    scans.value.find(({ scan }) => scan === first)?.name ?? files.value.find(({ file }) => file === first)?.name;
  if (!name) return "";
  const stem = name.replace(/\.[^.]*$/, "").replaceAll("/", " ");
  return freeName(verb.verb === "import" ? stem : `${stem} ${verb.verb}`);
}

/** A name, numbered where files of the folder have it. */
export function freeName(name: string): string {
  const taken = [...scans.value.map((one) => `${one.name}.`), ...files.value.map((one) => one.name)];
  const has = (wanted: string) => taken.some((one) => one.startsWith(`${wanted}.`) || one.startsWith(`${wanted}-`));
  let now = name;
  for (let number = 2; has(now); number++) now = `${name} ${number}`;
  return now;
}

/** What other parts of the page put into the values of a verb when it runs; null for not to run. */
export const additions = new Map<string, (values: Values) => Promise<Values | null>>();

export async function run(verb: VerbEntry): Promise<void> {
  const form = formOf(verb);
  const schema = schemaOf(verb);
  change(verb, { tried: true, refused: null, job: null });
  if (Object.keys(troubles(schema, form.values)).length) return;
  try {
    const added = additions.get(verb.verb);
    const whole = added ? await added(form.values) : form.values;
    if (!whole) return;
    const values = chosen(schema, whole);
    const { header } = await link.request({ kind: "run_verb", verb: verb.verb, name: resultName(verb), values });
    if (header.kind === "started") change(verb, { job: header.job });
  } catch (error) {
    if (!(error instanceof RefusedError)) throw error;
    change(verb, { refused: { text: error.message, hint: error.hint, options: error.options } });
  }
}

const FAMILIES: Record<string, RegExp> = {
  scans: /\.turnscan$/i,
  archives: /\.zip$/i,
};

/** Send files to the server: scans into the list of scans, all others for verbs. Returns their names. */
export async function send(list: Iterable<File>): Promise<string[]> {
  const all = [...list];
  const scanFiles = all.filter(({ name }) => FAMILIES.scans.test(name));
  const archives = all.filter(({ name }) => FAMILIES.archives.test(name));
  // What is dropped together belongs together: pictures of one series, a .conf and its range scans.
  const rest = all.filter((file) => !scanFiles.includes(file) && !archives.includes(file));
  const found: string[] = [];
  const bytes = all.reduce((sum, { size }) => sum + size, 0);
  let [done, before] = [0, 0];
  const say = (received: number, waiting = false) =>
    (sending.value = { done, total: all.length, bytes, received: before + received, waiting });
  say(0);
  const post = async <T>(path: string, file: File): Promise<T> => {
    const answer = await put(path, file, ({ received, waiting }: Sent) => say(received, waiting));
    done++;
    before += file.size;
    say(0);
    return answer.json();
  };
  try {
    for (const file of scanFiles) {
      const added: Added = await post(`api/scans?name=${encodeURIComponent(file.name)}`, file);
      found.push(added.scan);
    }
    for (const file of archives) {
      const received: Received = await post(`api/files?name=${encodeURIComponent(file.name)}`, file);
      found.push(...received.files);
    }
    let last: Received = { into: "", files: [] };
    for (const file of rest) {
      last = await post(`api/files?name=${encodeURIComponent(file.name)}&into=${last.into}`, file);
    }
    found.push(...last.files);
  } catch (error) {
    if (error instanceof TypeError)
      notify("error", "The file could not be read or sent.", "Check whether it is still there, and send it again.");
    else complain(error);
  } finally {
    sending.value = null;
  }
  await listFiles();
  return found;
}

const sentTables = new Map<string, { text: string; file: string }>();

/** The file of a table that was made on the page, sent where the server has not this one; null where it cannot be. */
export async function sendTable(name: string, text: string): Promise<string | null> {
  const before = sentTables.get(name);
  if (before?.text === text && files.value.some(({ file }) => file === before.file)) return before.file;
  const [file] = await send([new File([text], name)]);
  if (!file) return null;
  sentTables.set(name, { text, file });
  return file;
}

/** Something was dropped on the page: a scan alone is opened, all else is named on the start page. */
export async function receive(list: Iterable<File>): Promise<void> {
  const all = [...list];
  if (!all.length) return;
  const found = await send(all);
  if (!found.length) return;
  if (all.every(({ name }) => FAMILIES.scans.test(name))) {
    go("repair", found[found.length - 1]);
    return;
  }
  arrived.value = found;
  go("projects", null);
}

async function listFiles(): Promise<void> {
  try {
    const { header } = await link.request({ kind: "list_files" });
    if (header.kind === "files") files.value = header.files;
  } catch (error) {
    complain(error);
  }
}

/** Ask for verbs and files on each connection, and keep what became of the runs: once. */
export function startVerbs(): void {
  on("hello", () => {
    link.request({ kind: "list_verbs" }).then(({ header }) => {
      if (header.kind === "verbs") verbs.value = header.verbs;
    }, complain);
    void listFiles();
  });
  on("files", (message) => {
    files.value = message.files;
  });
  jobs.subscribe((all) => {
    const ours = [...all.values()].filter((job) => job.what === "verb" && runs.peek().get(job.job) !== job);
    if (ours.length) runs.value = new Map([...runs.peek(), ...ours.map((job) => [job.job, job] as const)]);
  });
}
