/** Settings that are being chosen, what they would make, and two of them side by side. */
import { batch, computed, effect, signal } from "@preact/signals";
import { link } from "../bus";
import { RefusedError } from "../link";
import { type MeshModel, plainMesh } from "../mesh/model";
import { doEdit, mark, mesh, opened, settings, shape } from "../part";
import type { RemedyOption, SettingsCompared, SettingsTried } from "../protocol";
import { complain, connection, place } from "../state";
import type { Cylinder } from "../viewport/cylinder";
import { cylinder } from "../viewport/place";
import { gridShown, tab } from "./state";

export type Value = boolean | number | string | null;
export type Values = Record<string, Value>;

export const IN_USE = "in use";
export const DEFAULTS = "defaults";
export const TYPED = "typed";
/** ms for which nothing is typed or dragged before it is tried. */
const REST_MS = 150;

/** What is typed and not yet applied; null for what is in use. */
export const typed = signal<Values | null>(null);
/** The name of the set that was taken up; null for none. */
export const chosenSet = signal<string | null>(null);
/** Whether the working volume is drawn over the surface. */
export const volumeShown = signal(true);

export interface Tried {
  header: SettingsTried;
  /** Profiles before and after, (3n) mm with NaN where they are torn. */
  profiles: readonly (readonly [Float32Array, Float32Array])[];
  old: MeshModel | null;
  new: MeshModel | null;
}

export const trial = signal<Tried | null>(null);
export const trying = signal(false);
export const refusal = signal<Trouble | null>(null);

/** What is wrong with what is typed. */
export interface Trouble {
  text: string;
  hint: string;
  options: readonly RemedyOption[];
}

/** Why settings cannot be tried, or make nothing of the patch. */
export const trouble = computed<Trouble | null>(() => {
  if (refusal.value) return refusal.value;
  const said = trial.value?.header.findings.find(({ severity }) => severity === "error");
  return said ? { ...said, hint: said.remedy } : null;
});
/** The setting that it is about. */
export const wrongField = computed(() => trouble.value?.options[0]?.name ?? null);

export interface Sides {
  header: SettingsCompared;
  names: readonly [string, string];
  meshes: readonly [MeshModel, MeshModel];
  revision: number;
}

export const sides = signal<Sides | null>(null);
export const comparing = signal(false);
/** mm at the ends of the map; null: as the deviations are. */
export const mapEnd = signal<number | null>(null);

export const inUse = computed(() => (settings.value?.options ?? null) as Values | null);
export const draft = computed(() => typed.value ?? inUse.value);
export const changed = computed(() => {
  const [a, b] = [draft.value, inUse.value];
  return a !== null && b !== null && Object.keys(a).some((name) => a[name] !== b[name]);
});

/** Every option at its default. */
export function defaults(): Values {
  const fields = (opened.value?.fields ?? {}) as Record<string, { default: Value }>;
  return Object.fromEntries(Object.entries(fields).map(([name, field]) => [name, field.default]));
}

/** Settings that have no effect beside the others: they are not shown, and refused by turnscan. */
export function idleIn(values: Values): string[] {
  return [
    ...(values.close ? [] : ["fill", "top", "bottom", "largest_hole"]),
    ...(values.merge === "grid" || values.merge === "paste" ? ["voxel"] : []),
    ...(values.spacing === null ? ["spacing_by"] : []),
  ];
}

/** The settings that a name in a list of choices stands for. */
export function valuesOf(name: string): Values | null {
  if (name === IN_USE) return inUse.value;
  if (name === TYPED) return draft.value;
  if (name === DEFAULTS) return defaults();
  return (settings.value?.sets.find((one) => choiceOf(one.name) === name)?.options ?? null) as Values | null;
}

/** What stands for a named set among choices: with a mark, since a set may be called as a choice. */
export const choiceOf = (set: string) => `=${set}`;

/** The named sets that can be chosen, with what they are called. */
export function setChoices(): (readonly [string, string])[] {
  return (settings.value?.sets ?? []).map(({ name }) => [choiceOf(name), name] as const);
}

/** What can be chosen, with what it is called. */
export function choices(): (readonly [string, string])[] {
  const own = changed.value ? [[TYPED, "as typed, not applied"] as const] : [];
  return [[IN_USE, IN_USE], ...own, [DEFAULTS, DEFAULTS], ...setChoices()];
}

/** The working volume of the draft; what is automatic is the rig's own, no larger than the part. */
export function volumeOf(values: Values): Cylinder | null {
  const own = settings.value?.volume;
  const box = mesh.value?.bounds();
  if (!own || !box) return null;
  const reach = Math.max(...[box.low, box.high].flatMap(([x, y]) => [Math.abs(x), Math.abs(y)]));
  const number = (name: string) => values[name] as number | null;
  const bottom = number("z_min") ?? own[1] ?? box.low[2];
  const top = number("z_max") ?? own[2] ?? box.high[2] + 0.05 * (box.high[2] - box.low[2]) + 1;
  return {
    radius: number("radius") ?? Math.min(own[0], 1.1 * reach),
    bottom,
    top: Math.max(top, bottom + 0.5),
  };
}

export function put(values: Values): void {
  if (draft.value) typed.value = { ...draft.value, ...values };
}

/** A handle was dragged: what it changed is typed, the rest stays automatic. */
function dragged(now: Cylinder | null): void {
  const values = draft.peek();
  const before = values && volumeOf(values);
  if (!now || !before || !values) return;
  const round = (mm: number) => Math.round(100 * mm) / 100;
  const next: Values = {};
  for (const [part, name] of [
    ["radius", "radius"],
    ["bottom", "z_min"],
    ["top", "z_max"],
  ] as const)
    if (Math.abs(now[part] - before[part]) > 1e-9) next[name] = round(now[part]);
  if (Object.keys(next).length) put(next);
}

let turn = 0;

async function attempt(scan: string, options: Values): Promise<void> {
  const mine = ++turn;
  const at = mark.peek();
  trying.value = true;
  try {
    const grid = at && at.grid >= 0 ? at.grid : gridShown.peek();
    const step = at && at.step >= 0 ? at.step : null;
    const { header, arrays } = await link.request({ kind: "try_settings", scan, options, grid, step });
    if (mine !== turn || header.kind !== "settings_tried") return;
    const patch = (name: "old" | "new") => {
      const faces = arrays.u32(`${name}.faces`);
      if (!faces.length) return null;
      return plainMesh(arrays.f32(`${name}.positions`), faces, name === "new" ? arrays.f32("new.distance") : null);
    };
    const profiles = header.steps.map((_, k) => [arrays.f32(`old.${k}`), arrays.f32(`new.${k}`)] as const);
    batch(() => {
      trial.value = { header, profiles, old: patch("old"), new: patch("new") };
      refusal.value = null;
    });
  } catch (error) {
    if (!(error instanceof RefusedError)) throw error;
    if (mine === turn && error.code !== "cancelled" && error.code !== "lost")
      refusal.value = { text: error.message, hint: error.hint, options: error.options };
  } finally {
    if (mine === turn) trying.value = false;
  }
}

function drop(): void {
  turn += 1;
  batch(() => {
    trial.value = refusal.value = null;
    trying.value = false;
  });
}

/** Follow the settings, the marked point and the handles: once. */
export function startChoices(): void {
  let used = "";
  effect(() => {
    // A set that is kept or renamed is news of the settings, and leaves what is typed.
    const now = JSON.stringify([opened.value?.scan, inUse.value]);
    if (now === used) return;
    used = now;
    batch(() => {
      typed.value = null;
      chosenSet.value = null;
    });
  });
  let timer: ReturnType<typeof setTimeout> | undefined;
  effect(() => {
    clearTimeout(timer);
    const scan = opened.value?.scan;
    const [values, at] = [draft.value, mark.value];
    void [at, shape.value];
    if (!scan || !values || !changed.value || tab.value !== "settings" || connection.value !== "open") drop();
    else timer = setTimeout(() => void attempt(scan, values).catch(complain), REST_MS);
  });
  effect(() => {
    void shape.value;
    const shown = volumeShown.value && tab.value === "settings" && place.value.room === "repair";
    cylinder.value = shown && draft.value ? volumeOf(draft.value) : null;
  });
  cylinder.subscribe(dragged);
  let scan: string | undefined;
  effect(() => {
    if (opened.value?.scan === scan) return;
    scan = opened.value?.scan;
    sides.value = null;
  });
}

/** Both settings with all edits, and how far their surfaces lie apart. */
export async function compareSides(first: string, second: string, revision: number): Promise<void> {
  const scan = opened.value?.scan;
  const [a, b] = [valuesOf(first), valuesOf(second)];
  if (!scan || !a || !b || comparing.value) return;
  const words = new Map(choices());
  comparing.value = true;
  try {
    const { header, arrays } = await link.request({ kind: "compare_settings", scan, first: a, second: b });
    if (header.kind !== "settings_compared" || opened.value?.scan !== scan) return;
    const surface = (name: string) =>
      plainMesh(arrays.f32(`${name}.positions`), arrays.u32(`${name}.faces`), arrays.f32(`${name}.distance`));
    sides.value = {
      header,
      names: [words.get(first) ?? first, words.get(second) ?? second],
      meshes: [surface("first"), surface("second")],
      revision,
    };
  } catch (error) {
    complain(error);
  } finally {
    comparing.value = false;
  }
}

/** Keep what is typed, or in use, as a named set. */
export const keepSet = (name: string) => doEdit({ kind: "keep_set", name, options: draft.value ?? {} });
export const renameSet = (name: string, to: string) => doEdit({ kind: "rename_set", name, to });
export const deleteSet = (name: string) => doEdit({ kind: "delete_set", name });
