/** Files may be dropped anywhere: while they are over the page it says so. */
import { signal } from "@preact/signals";
import { receive } from "../verbs/state";
import { dropped } from "./folders";

const over = signal(false);

export function DropHint() {
  if (!over.value) return null;
  return (
    <div class="drop-hint" aria-hidden="true">
      <p>Drop scans, pictures, a folder of them, a video, a zip, range scans, a mesh, CAD or a rig</p>
    </div>
  );
}

/** Take what is dropped on any place of the page: once. */
export function startDrops(): void {
  const carriesFiles = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
  window.addEventListener("dragover", (event) => {
    event.preventDefault();
    over.value = carriesFiles(event);
  });
  window.addEventListener("dragleave", (event) => {
    // Leaving the window has no other element that is entered.
    if (!event.relatedTarget) over.value = false;
  });
  // A field that takes files keeps what is dropped on it to itself.
  window.addEventListener("drop", () => (over.value = false), true);
  window.addEventListener("drop", (event) => {
    event.preventDefault();
    void dropped(event.dataTransfer).then(receive);
  });
}
