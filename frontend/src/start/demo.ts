/** The demo: a simulated scan, opened when it is there. */
import { computed, signal } from "@preact/signals";
import { link, on } from "../bus";
import { complain, go, jobs } from "../state";

/** The demo that was asked for here and is being scanned. */
const running = signal<string | null>(null);
export const demoJob = computed(() => jobs.value.get(running.value ?? ""));

export async function tryDemo(): Promise<void> {
  try {
    const { header } = await link.request({ kind: "try_demo" });
    if (header.kind === "started") running.value = header.job;
  } catch (error) {
    complain(error);
  }
}

/** Open the demo when it is scanned: once. */
export function startDemo(): void {
  on("job", ({ job, what, state, files }) => {
    if (what !== "demo" || job !== running.value || state === "running") return;
    running.value = null;
    if (state === "done" && files.length) go("repair", files[0].file);
  });
}
