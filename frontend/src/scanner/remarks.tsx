/** What a job found, in words. */
import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import type { JobState, Remark } from "../protocol";
import { jobs } from "../state";

export function RemarkLine({ remark }: { remark: Remark }) {
  return (
    <p class={`remark ${remark.severity}`}>
      {remark.where && <strong>{remark.where}: </strong>}
      {remark.text}
      {remark.remedy && <span class="quiet"> {remark.remedy}</span>}
    </p>
  );
}

/** The last job of a kind; it stays here when the list of jobs forgets it. */
export function useLastJob(what: JobState["what"]): JobState | null {
  const last = useSignal<JobState | null>(null);
  const now = [...jobs.value.values()].findLast((job) => job.what === what);
  useEffect(() => {
    if (now) last.value = now;
  }, [now]);
  return now ?? last.value;
}
