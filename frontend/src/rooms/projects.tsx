/** The list of scan files, and the place where files can be dropped. */
import { useRef, useState } from "preact/hooks";
import { http } from "../link";
import type { Added } from "../protocol";
import { isScanning } from "../scanner/live";
import { resume } from "../scanner/resume";
import { complain, connection, go, isOperator, scans } from "../state";
import { Button } from "../ui/controls";
import { invite } from "../ui/invite";
import type { Room } from "./room";

/** Send scan files to the server, and open the last one. */
export async function addFiles(files: Iterable<File>): Promise<void> {
  for (const file of files) {
    try {
      const response = await http(`api/scans?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file });
      const { scan }: Added = await response.json();
      go("repair", scan);
    } catch (error) {
      complain(error);
    }
  }
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
                          label={`Take what ${name} is missing`}
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
          aria-label="Scan files from this computer"
          class={`drop ${over ? "over" : ""}`}
          onDragOver={() => setOver(true)}
          onDragLeave={() => setOver(false)}
          onDrop={() => setOver(false)}
        >
          {scans.value.length === 0 && connection.value === "open" && <p>There are no scans here yet.</p>}
          <p>Drop scan files (.turnscan) here</p>
          <Button onClick={() => input.current?.click()}>Choose files</Button>
          <input
            ref={input}
            type="file"
            accept=".turnscan"
            multiple
            hidden
            aria-label="Scan files"
            onChange={(event) => void addFiles(event.currentTarget.files ?? [])}
          />
        </div>
      </div>
    </div>
  );
}

export const projects: Room = { id: "projects", title: "Scans", needsScan: false, View: Projects, commands: [] };
