/** Reports of what was inspected: written into the folder by a job, then opened or downloaded. */
import { signal } from "@preact/signals";
import { link } from "../bus";
import type { Request } from "../link";
import { opened } from "../part";
import { ask, complain, isOperator } from "../state";
import { Button, Section } from "../ui/controls";
import { left } from "../ui/frame";
import { Icon } from "../ui/icons";
import { freeName, runs } from "../verbs/state";

/** Jobs of reports that were asked for here, by what they are of. */
const asked = signal<ReadonlyMap<string, string>>(new Map());

export const REPORTS = [".pdf", ".html"] as const;

interface ReportProps<S extends string> {
  /** What it is of: one report of each is shown. */
  of: string;
  disabled?: boolean;
  /** How it is asked for, under a name that is free. */
  request: (name: string, suffix: S) => Request;
  /** What the file is called, where it is no report. */
  what?: string;
  suffixes: readonly S[];
}

export function ReportButtons<S extends string>({ of, disabled, request, what, suffixes }: ReportProps<S>) {
  const title = what ?? "Report";
  const part = opened.value;
  const key = `${part?.scan} ${of}`;
  const job = runs.value.get(asked.value.get(key) ?? "");
  async function start(suffix: S): Promise<void> {
    try {
      const { header } = await link.request(request(freeName(`${part?.name} ${of}`), suffix));
      if (header.kind === "started") asked.value = new Map(asked.value).set(key, header.job);
    } catch (error) {
      complain(error);
    }
  }
  const running = job?.state === "running";
  return (
    <>
      <div class="grid-2">
        {suffixes.map((suffix) => (
          <Button
            key={suffix}
            label={
              what
                ? `${what} as ${suffix.slice(1).toUpperCase()}`
                : `Report of ${of} as ${suffix.slice(1).toUpperCase()}`
            }
            disabled={disabled || running || !isOperator.value}
            onClick={() => void start(suffix)}
          >
            {title} as {suffix.slice(1).toUpperCase()}
          </Button>
        ))}
      </div>
      {running && (
        <p class="row" role="status">
          <progress aria-label={job.title} {...(job.total ? { max: job.total, value: job.done } : {})} />
          {job.seconds_left !== null && <span class="num">{left(job.seconds_left)}</span>}
          <Button small onClick={() => void ask({ kind: "cancel", job: job.job })}>
            Cancel
          </Button>
        </p>
      )}
      {job?.state === "done" && (
        <ul class="list whole" aria-label={what ?? `Report of ${of}`}>
          {job.files.map(({ file, name }) => (
            <li key={file}>
              <a
                class="button plain grow"
                {...(name.endsWith(".html")
                  ? { href: `api/files/${file}/page`, target: "_blank", rel: "noreferrer" }
                  : { href: `api/files/${file}`, download: name })}
              >
                <Icon name="export" />
                {name}
              </a>
            </li>
          ))}
        </ul>
      )}
    </>
  );
}

/** The report of every size of the part, with what was measured by hand first. */
export function ReportPanel() {
  const scan = opened.value?.scan ?? "";
  return (
    <Section title="Report" open={false}>
      <p class="quiet">
        Your measurements with their limits, then every size that is found in the part, each with a picture and its
        uncertainty.
      </p>
      <ReportButtons
        of="sizes"
        suffixes={REPORTS}
        request={(name, suffix) => ({ kind: "save_report", scan, name, suffix })}
      />
    </Section>
  );
}
