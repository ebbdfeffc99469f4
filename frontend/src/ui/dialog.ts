import { signal } from "@preact/signals";
import { useLayoutEffect, useRef } from "preact/hooks";

/**
 * How to close each dialog that is open, the topmost last. A dialog is not modal in the browser's
 * sense, which would take STOP away: the page makes everything else inert, and the keyboard goes
 * between the dialog and STOP alone.
 */
export const dialogs = signal<readonly (() => void)[]>([]);

/** Open a native dialog for as long as the component is there. */
export function useDialog(close: () => void) {
  const ref = useRef<HTMLDialogElement>(null);
  // Before the next key: what is typed at once belongs into the dialog.
  useLayoutEffect(() => {
    const before = document.activeElement;
    dialogs.value = [...dialogs.peek(), close];
    ref.current!.show();
    return () => {
      dialogs.value = dialogs.peek().filter((one) => one !== close);
      // What the dialog led to keeps the keyboard.
      const back = () => (document.activeElement ?? document.body) === document.body;
      if (before instanceof HTMLElement) setTimeout(() => back() && before.focus());
    };
  }, []);
  return ref;
}

/** Close the topmost dialog; false where none is open. */
export function closeDialog(): boolean {
  const top = dialogs.peek().at(-1);
  top?.();
  return top !== undefined;
}
