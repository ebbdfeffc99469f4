/** The start page: scans, what was dropped, what to do with files, and the other files. */
import { useRef } from "preact/hooks";
import { demoJob, tryDemo } from "../start/demo";
import { Bin, Gallery, when } from "../start/gallery";
import { ask, connection, devices, go, hello, isOperator, scans } from "../state";
import { Button } from "../ui/controls";
import { Icon, type IconName } from "../ui/icons";
import { invite } from "../ui/invite";
import { whatIs } from "../verbs/schema";
import { arrived, files, openVerb, receive, type Sending, sending, verbs } from "../verbs/state";
import type { Room } from "./room";

/** What can be done with files: each leads to its form. */
function Verbs() {
  const groups = Map.groupBy(verbs.value, ({ group }) => group);
  return (
    <section class="verbs" aria-label="What to do with files">
      {[...groups].map(([group, some]) => (
        <div key={group}>
          <h2>{group}</h2>
          {some.map(({ verb, title, json_schema }) => (
            <Button key={verb} label={String(json_schema.description)} onClick={() => openVerb(verb, null)}>
              {title}
            </Button>
          ))}
        </div>
      ))}
    </section>
  );
}

function sendingText({ done, total, bytes, received, waiting }: Sending): string {
  const megabytes = (n: number) => (n / 1e6).toFixed(n < 1e7 ? 1 : 0);
  const sent = `Sending file ${Math.min(done + 1, total)} of ${total}: ${megabytes(received)} of ${megabytes(bytes)} MB`;
  return waiting ? `${sent}. The server does not answer; sending resumes when it does.` : sent;
}

/** What was dropped, and what can be done with it. */
function Arrived() {
  const here = files.value.filter(({ file }) => arrived.value.includes(file));
  const scansHere = scans.value.filter(({ scan }) => arrived.value.includes(scan));
  if (sending.value)
    return (
      <p class="row" role="status">
        {sendingText(sending.value)}
        <progress aria-label="Files sent" max={sending.value.bytes || 1} value={sending.value.received} />
      </p>
    );
  if (!here.length && !scansHere.length) return null;
  return (
    <section class="arrived" aria-label="What was dropped">
      <h2>You dropped</h2>
      <ul class="list whole">
        {scansHere.map(({ scan, name }) => (
          <li key={scan}>
            <span class="grow">{name}: a scan</span>
            <Button small onClick={() => go("repair", scan)}>
              Open
            </Button>
          </li>
        ))}
        {here.map((entry) => (
          <li key={entry.file}>
            <span class="grow">
              {entry.name}: {whatIs(entry)}
            </span>
            {verbs.value
              .filter(({ verb }) => entry.takers.includes(verb))
              .map(({ verb, title }) => (
                <Button key={verb} small onClick={() => openVerb(verb, entry.file)}>
                  {title}
                </Button>
              ))}
          </li>
        ))}
      </ul>
    </section>
  );
}

/** Files of the folder that are no scans: meshes, rigs, drawings, reports. */
function OtherFiles() {
  const kept = files.value.filter(({ sent, pictures }) => !sent && !pictures);
  if (!kept.length) return null;
  return (
    <section aria-label="Other files">
      <h2>Other files in the folder</h2>
      <table>
        <tbody>
          {kept.map((entry) => (
            <tr key={entry.file}>
              <td>
                <a href={`api/files/${entry.file}`} download={entry.name}>
                  {entry.name}
                </a>
              </td>
              <td class="quiet">{whatIs(entry)}</td>
              <td class="quiet num">{when(entry.modified)}</td>
              <td class="num right">{entry.megabytes.toFixed(1)} MB</td>
            </tr>
          ))}
        </tbody>
      </table>
    </section>
  );
}

interface WayProps {
  icon: IconName;
  title: string;
  about: string;
  disabled?: boolean;
  onClick: () => void;
}

function Way({ icon, title, about, disabled, onClick }: WayProps) {
  return (
    <button type="button" class="way" disabled={disabled} onClick={onClick}>
      <Icon name={icon} />
      <strong>{title}</strong>
      <span>{about}</span>
    </button>
  );
}

/** The four ways to begin. */
function Ways({ choose }: { choose: () => void }) {
  const connected = (devices.value?.addresses.length ?? 0) > 0;
  const demo = demoJob.value;
  const watching = !isOperator.value;
  return (
    <nav class="ways" aria-label="Begin">
      <Way
        icon="camera"
        title="Scan"
        about={connected ? "Take a scan with the connected scanner" : "Connect a scanner, then scan a part"}
        onClick={() => go(connected ? "scan" : "rig", null)}
      />
      <Way
        icon="play"
        title="Try the demo"
        about={
          demo
            ? `Scanning a simulated cup: ${Math.round((100 * demo.done) / (demo.total ?? 100))} %`
            : "Scan a simulated cup, no hardware needed"
        }
        disabled={watching || demo !== undefined}
        onClick={() => void tryDemo()}
      />
      <Way
        icon="folder"
        title="Import"
        about="Pictures, a video, a zip, range scans, a mesh or CAD"
        disabled={watching}
        onClick={choose}
      />
      <Way
        icon="point"
        title="Calibrate"
        about="Camera, laser and turntable, with a board"
        onClick={() => go("calibrate", null)}
      />
    </nav>
  );
}

function Projects() {
  const input = useRef<HTMLInputElement>(null);
  const choose = () => input.current?.click();
  return (
    <div class="room single">
      <div class="projects">
        <Ways choose={choose} />
        <input
          ref={input}
          type="file"
          multiple
          hidden
          aria-label="Files"
          onChange={(event) => void receive(event.currentTarget.files ?? [])}
        />
        <Arrived />
        <div class="row apart">
          <h1>Scans</h1>
          <div class="row">
            {hello.value?.can_show_folder && (
              <Button icon="folder" disabled={!isOperator.value} onClick={() => void ask({ kind: "show_folder" })}>
                Open folder
              </Button>
            )}
            <Button label="A link that lets one more browser in" onClick={() => void invite()}>
              Invite another browser
            </Button>
          </div>
        </div>
        {scans.value.length > 0 ? (
          <Gallery />
        ) : (
          connection.value === "open" && (
            <p class="quiet">
              There are no scans here yet. Choose a way to begin above, or drop files and folders anywhere.
            </p>
          )
        )}
        <Bin />
        <Verbs />
        <OtherFiles />
      </div>
    </div>
  );
}

export const projects: Room = {
  id: "projects",
  title: "Scans",
  needsScan: false,
  View: Projects,
  commands: [
    {
      title: "Try the demo",
      group: "Scans",
      run: () => void tryDemo(),
      enabled: () => isOperator.value && demoJob.value === undefined,
    },
    {
      title: "Open folder",
      group: "Scans",
      run: () => void ask({ kind: "show_folder" }),
      enabled: () => isOperator.value && (hello.value?.can_show_folder ?? false),
    },
  ],
};
