/** The start page: scans, what was dropped, what to do with files, and the other files. */
import { useRef, useState } from "preact/hooks";
import { isScanning } from "../scanner/live";
import { resume } from "../scanner/resume";
import { connection, go, isOperator, scans } from "../state";
import { Button } from "../ui/controls";
import { invite } from "../ui/invite";
import { whatIs } from "../verbs/schema";
import { arrived, files, openVerb, receive, sending, verbs } from "../verbs/state";
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

/** What was dropped, and what can be done with it. */
function Arrived() {
  const here = files.value.filter(({ file }) => arrived.value.includes(file));
  const scansHere = scans.value.filter(({ scan }) => arrived.value.includes(scan));
  if (sending.value)
    return (
      <p class="row" role="status">
        Sending {sending.value.done} of {sending.value.total} files
        <progress aria-label="Files sent" max={sending.value.total} value={sending.value.done} />
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
              <td class="quiet num">{new Date(entry.modified).toLocaleString("sv").slice(0, 16)}</td>
              <td class="num right">{entry.megabytes.toFixed(1)} MB</td>
            </tr>
          ))}
        </tbody>
      </table>
    </section>
  );
}

function Projects() {
  const input = useRef<HTMLInputElement>(null);
  const [over, setOver] = useState(false);
  return (
    <div class="room single">
      <div class="projects">
        <div class="row apart">
          <h1>Scans</h1>
          <Button label="A link that lets one more browser in" onClick={() => void invite()}>
            Invite another browser
          </Button>
        </div>
        <Arrived />
        {scans.value.length > 0 && (
          <table>
            <thead>
              <tr>
                <th scope="col">Name</th>
                <th scope="col">Changed</th>
                <th scope="col" class="right">
                  Size
                </th>
                <th scope="col">
                  <span class="sr-only">State</span>
                </th>
              </tr>
            </thead>
            <tbody>
              {scans.value.map(({ scan, name, modified, megabytes, open, missing }) => (
                <tr key={scan}>
                  <td>
                    <button type="button" class="link" onClick={() => go("repair", scan)}>
                      {name}
                    </button>
                  </td>
                  <td class="quiet num">{new Date(modified).toLocaleString("sv").slice(0, 16)}</td>
                  <td class="num right">{megabytes.toFixed(1)} MB</td>
                  <td class="quiet">
                    {open && "open "}
                    {missing > 0 && (
                      <>
                        {missing} steps missing{" "}
                        <Button
                          small
                          disabled={!isOperator.value || isScanning()}
                          label={`Capture what ${name} is missing`}
                          onClick={() => void resume(scan)}
                        >
                          Resume
                        </Button>
                      </>
                    )}
                  </td>
                </tr>
              ))}
            </tbody>
          </table>
        )}
        <div
          role="group"
          aria-label="Files from this computer"
          class={`drop ${over ? "over" : ""}`}
          onDragOver={() => setOver(true)}
          onDragLeave={() => setOver(false)}
          onDrop={() => setOver(false)}
        >
          {scans.value.length === 0 && connection.value === "open" && <p>There are no scans here yet.</p>}
          <p>Drop scans, pictures (many, a video or a zip), range scans, meshes or a rig here</p>
          <Button onClick={() => input.current?.click()}>Choose files</Button>
          <input
            ref={input}
            type="file"
            multiple
            hidden
            aria-label="Files"
            onChange={(event) => void receive(event.currentTarget.files ?? [])}
          />
        </div>
        <Verbs />
        <OtherFiles />
      </div>
    </div>
  );
}

export const projects: Room = { id: "projects", title: "Scans", needsScan: false, View: Projects, commands: [] };
