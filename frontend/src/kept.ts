/** Texts that this browser remembers from one visit to the next. */
import { effect, type Signal, signal } from "@preact/signals";

interface Kept {
  key: string;
  value: Signal<string>;
  allowed: readonly string[] | null;
}

const all: Kept[] = [];

/** A text that `remember` reads and writes; `allowed` null takes any. */
export function kept<T extends string>(key: string, first: T, allowed: readonly T[] | null = null): Signal<T> {
  const value = signal<T>(first);
  all.push({ key: `turnscan.${key}`, value: value as unknown as Signal<string>, allowed });
  return value;
}

/** Take what is in the storage, and put there what changes from now on. */
export function remember(storage: Pick<Storage, "getItem" | "setItem">): void {
  for (const { key, value, allowed } of all) {
    const found = storage.getItem(key);
    if (found !== null && (allowed?.includes(found) ?? true)) value.value = found;
    effect(() => storage.setItem(key, value.value));
  }
}
