/** What became of a verb: how far it is, why it failed, or its findings and files. */
import { useEffect, useRef } from "preact/hooks";
import type { JobState, Remark, RemedyOption, VerbEntry } from "../protocol";
import { ask, go } from "../state";
import { Button } from "../ui/controls";
import { left } from "../ui/frame";
import { Icon } from "../ui/icons";
import { goTo } from "./fields";
import { isMesh, ResultSurface, Tables } from "./result";
import { filledIn, labelOf } from "./schema";
import { change, type Failure, formOf, openVerb, runOf, schemaOf, verbs } from "./state";

export function Outcome({ verb }: { verb: VerbEntry }) {
  const form = formOf(verb);
  const job = runOf(form);
  const place = useRef<HTMLDivElement>(null);
  // What became of it is below a long form: show it as soon as it is there.
  const state = form.refused ? "refused" : job?.state;
  useEffect(() => {
    if (state) place.current?.scrollIntoView({ block: "nearest" });
  }, [state]);
  return (
    <div ref={place}>
      {form.refused && <Failed verb={verb} failure={form.refused} />}
      {job?.state === "running" && <Running job={job} />}
      {job?.state === "failed" && <Failed verb={verb} failure={job} />}
      {job?.state === "cancelled" && <p class="quiet">Cancelled; nothing was written.</p>}
      {job?.state === "done" && <Done verb={verb} job={job} />}
    </div>
  );
}

function Running({ job }: { job: JobState }) {
  return (
    <div class="row" role="status">
      <progress aria-label={job.title} {...(job.total ? { max: job.total, value: job.done } : {})} />
      {job.seconds_left !== null && <span class="num">{left(job.seconds_left)}</span>}
      <Button small onClick={() => void ask({ kind: "cancel", job: job.job })}>
        Cancel
      </Button>
    </div>
  );
}

/** Buttons that put what is proposed into a field, or lead to it. */
function Remedies({ verb, options }: { verb: VerbEntry; options: readonly RemedyOption[] }) {
  const schema = schemaOf(verb);
  const known = options.filter(({ name }) => name === "name" || name in schema.properties);
  return (
    <>
      {known.map((option) => (
        <Button
          key={`${option.name} ${option.value}`}
          small
          onClick={() => {
            change(verb, { values: filledIn(schema, formOf(verb).values, option) });
            goTo(option.name);
          }}
        >
          {option.value === null ? labelOf(option.name) : `${labelOf(option.name)}: ${option.value}`}
        </Button>
      ))}
    </>
  );
}

function Failed({ verb, failure }: { verb: VerbEntry; failure: Failure }) {
  return (
    <div class="notice error" role="alert">
      <span>{failure.text}</span>
      {failure.hint && <span class="hint">{failure.hint}</span>}
      <span class="row">
        <Remedies verb={verb} options={failure.options} />
      </span>
    </div>
  );
}

function Finding({ verb, finding }: { verb: VerbEntry; finding: Remark }) {
  return (
    <li class={`finding ${finding.severity}`}>
      <span>
        <strong>{finding.severity}</strong> {finding.where && <em>{finding.where}: </em>}
        {finding.text}
      </span>
      {finding.remedy && <span class="quiet">{finding.remedy}</span>}
      <span class="row">
        <Remedies verb={verb} options={finding.options} />
      </span>
    </li>
  );
}

function Done({ verb, job }: { verb: VerbEntry; job: JobState }) {
  const surface = job.files.find(({ name }) => isMesh(name));
  return (
    <div class="outcome">
      {job.files.length > 0 && (
        <ul class="list" aria-label="Files that were written">
          {job.files.map(({ file, name, scan }) => (
            <li key={file}>
              {scan ? (
                <Button kind="primary" onClick={() => go("repair", file)}>
                  Open {name}
                </Button>
              ) : name.endsWith(".html") ? (
                <a class="button plain grow" href={`api/files/${file}/page`} target="_blank" rel="noreferrer">
                  <Icon name="export" />
                  Open {name}
                </a>
              ) : (
                <>
                  <a class="button plain grow" href={`api/files/${file}`} download={name}>
                    <Icon name="export" />
                    {name}
                  </a>
                  {verbs.value
                    .filter((other) => other.verb === "compare" && /\.(stl|ply|obj|3mf|glb)$/.test(name))
                    .map((other) => (
                      <Button key={other.verb} small onClick={() => openVerb(other.verb, file)}>
                        {other.title}
                      </Button>
                    ))}
                </>
              )}
            </li>
          ))}
        </ul>
      )}
      {surface && <ResultSurface key={surface.file} {...surface} open={verb.verb === "join"} />}
      {job.text && <pre class="figures">{job.text}</pre>}
      <Tables of={job.tables ?? []} />
      {job.findings.length > 0 && (
        <ul class="findings" aria-label="Findings">
          {job.findings.map((finding) => (
            <Finding key={`${finding.code} ${finding.where} ${finding.text}`} verb={verb} finding={finding} />
          ))}
        </ul>
      )}
    </div>
  );
}
