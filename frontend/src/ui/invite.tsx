/** A link that lets one more browser in, once. */
import { signal } from "@preact/signals";
import { http } from "../link";
import type { Invitation } from "../protocol";
import { complain } from "../state";
import { Button } from "./controls";
import { useDialog } from "./dialog";

const link = signal<string | null>(null);

export async function invite(): Promise<void> {
  try {
    const { path }: Invitation = await (await http("api/invitations", { method: "POST" })).json();
    link.value = new URL(path, location.origin).href;
  } catch (error) {
    complain(error);
  }
}

export function InviteDialog() {
  return link.value ? <Shown href={link.value} /> : null;
}

function Shown({ href }: { href: string }) {
  const close = () => (link.value = null);
  const dialog = useDialog(close);
  return (
    <dialog ref={dialog} class="invite" aria-labelledby="invite-title" aria-modal="true">
      <header>
        <h2 id="invite-title">A link for one more browser</h2>
        <Button kind="plain" icon="close" label="Close" keys="Esc" onClick={close} />
      </header>
      <div class="body">
        <input type="text" readOnly value={href} aria-label="Link" onFocus={(event) => event.currentTarget.select()} />
        <p class="quiet">It can be used once. Whoever opens it can watch, and take control.</p>
      </div>
    </dialog>
  );
}
