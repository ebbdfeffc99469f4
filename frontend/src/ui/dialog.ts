import { useLayoutEffect, useRef } from "preact/hooks";

/** Open a native dialog for as long as the component is there. */
export function useDialog(close: () => void) {
  const ref = useRef<HTMLDialogElement>(null);
  // Before the next key: what is typed at once belongs into the dialog.
  useLayoutEffect(() => {
    const dialog = ref.current!;
    dialog.showModal();
    dialog.addEventListener("close", close);
    return () => dialog.removeEventListener("close", close);
  }, []);
  return ref;
}
