/** The scans as a gallery, what is done with each of them, and the bin. */
import { useEffect, useRef, useState } from "preact/hooks";
import type { FindingCounts, ScanEntry } from "../protocol";
import { isScanning } from "../scanner/live";
import { resume } from "../scanner/resume";
import { ask, binned, go, isOperator, notify, scans } from "../state";
import { Button } from "../ui/controls";
import { Icon } from "../ui/icons";

/** How many findings there are, in words; empty where nothing is known of the scan as it is now. */
export function findingWords(counts: FindingCounts | null): string {
  if (!counts) return "";
  const some = (n: number, one: string) => (n ? [`${n} ${one}${n === 1 ? "" : "s"}`] : []);
  const all = [...some(counts.errors, "error"), ...some(counts.warnings, "warning"), ...some(counts.notes, "note")];
  return all.join(", ") || "no findings";
}

/** A name for a copy that no scan has. */
export function copyName(name: string, taken: readonly string[]): string {
  const first = `${name} copy`;
  let now = first;
  for (let number = 2; taken.includes(now); number++) now = `${first} ${number}`;
  return now;
}

export const when = (iso: string) => new Date(iso).toLocaleString("sv").slice(0, 16);
const megabytes = (size: number) => `${size.toFixed(size < 10 ? 1 : 0)} MB`;

function NameField({ entry, end }: { entry: ScanEntry; end: () => void }) {
  const field = useRef<HTMLInputElement>(null);
  useEffect(() => field.current?.select(), []);
  async function rename(): Promise<void> {
    const name = field.current?.value.trim() ?? "";
    if (!name || name === entry.name || (await ask({ kind: "rename", scan: entry.scan, name }))) end();
  }
  return (
    <form
      class="row"
      onSubmit={(event) => {
        event.preventDefault();
        void rename();
      }}
      onKeyDown={(event) => event.key === "Escape" && end()}
    >
      <input ref={field} type="text" class="grow" aria-label={`New name of ${entry.name}`} defaultValue={entry.name} />
      <button type="submit" class="button small">
        Rename
      </button>
    </form>
  );
}

function Card({ entry }: { entry: ScanEntry }) {
  const [naming, setNaming] = useState(false);
  const { scan, name, content, findings, missing } = entry;
  const watching = !isOperator.value;
  const words = findingWords(findings);
  const severity = findings?.errors ? "bad" : findings?.warnings ? "busy" : "good";
  // Another content, or a scan that has been seen meanwhile, has another picture.
  const picture = `api/scans/${scan}/thumbnail.png?v=${content}${findings ? "s" : ""}`;

  async function discard(): Promise<void> {
    if (await ask({ kind: "to_bin", scan }))
      notify("note", `${name} is in the bin.`, "It can be restored below the scans.");
  }
  return (
    <li class="scan-card">
      <button type="button" class="look" aria-label={name} title={`Open ${name}`} onClick={() => go("repair", scan)}>
        {content ? <img src={picture} alt="" loading="lazy" /> : <span class="quiet">cannot be read</span>}
        <strong>{name}</strong>
      </button>
      {naming && <NameField entry={entry} end={() => setNaming(false)} />}
      <p class="facts">
        <span class="num">{when(entry.modified)}</span>
        <span class="num">{megabytes(entry.megabytes)}</span>
        {entry.open && <span>open</span>}
        {entry.simulated && <span title="Its pictures are of no real part">simulated</span>}
      </p>
      {words && (
        <p class="facts">
          <span class={`dot ${severity}`} />
          {words}
        </p>
      )}
      {missing > 0 && (
        <p class="facts">
          {missing} steps missing{" "}
          <Button
            small
            disabled={watching || isScanning()}
            label={`Capture what ${name} is missing`}
            onClick={() => void resume(scan)}
          >
            Resume
          </Button>
        </p>
      )}
      <div class="row tools">
        <Button
          kind="plain"
          small
          icon="pencil"
          label={`Rename ${name}`}
          disabled={watching}
          onClick={() => setNaming(true)}
        />
        <Button
          kind="plain"
          small
          icon="copy"
          label={`Duplicate ${name} with its edits`}
          disabled={watching}
          onClick={() =>
            void ask({
              kind: "duplicate",
              scan,
              name: copyName(
                name,
                scans.value.map((one) => one.name),
              ),
            })
          }
        />
        <a
          class="button plain small"
          href={`api/scans/${scan}/file`}
          download={`${name}.turnscan`}
          aria-label={`Download ${name} with its edits`}
          title={`Download ${name} with its edits`}
        >
          <Icon name="download" />
        </a>
        <Button
          kind="plain"
          small
          icon="trash"
          label={`Delete ${name}: into the bin`}
          disabled={watching}
          onClick={() => void discard()}
        />
      </div>
    </li>
  );
}

const newestFirst = (a: ScanEntry, b: ScanEntry) =>
  b.modified.localeCompare(a.modified) || a.name.localeCompare(b.name);

export function Gallery() {
  return (
    <ul class="gallery" aria-label="Scans">
      {scans.value.toSorted(newestFirst).map((entry) => (
        <Card key={entry.scan} entry={entry} />
      ))}
    </ul>
  );
}

export function Bin() {
  const [sure, setSure] = useState(false);
  const held = binned.value;
  if (!held.length) return null;
  const size = held.reduce((sum, one) => sum + one.megabytes, 0);
  return (
    <details class="section bin">
      <summary>
        Bin <span class="count num">{held.length}</span>
      </summary>
      <ul class="list whole" aria-label="Scans in the bin">
        {held.map(({ binned: id, name, at, megabytes: mb }) => (
          <li key={id}>
            <span class="grow">{name}</span>
            <span class="quiet num">{when(at)}</span>
            <span class="quiet num">{megabytes(mb)}</span>
            <Button
              small
              disabled={!isOperator.value}
              label={`Restore ${name}`}
              onClick={() => void ask({ kind: "restore", binned: id })}
            >
              Restore
            </Button>
          </li>
        ))}
      </ul>
      <div class="row">
        {sure ? (
          <>
            <Button
              kind="danger"
              onClick={() => {
                setSure(false);
                void ask({ kind: "empty_bin" });
              }}
            >
              Delete for good
            </Button>
            <Button onClick={() => setSure(false)}>Keep</Button>
          </>
        ) : (
          <Button disabled={!isOperator.value} onClick={() => setSure(true)}>
            Empty the bin ({megabytes(size)})
          </Button>
        )}
      </div>
    </details>
  );
}
