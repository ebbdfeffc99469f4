/** Export: the repaired surface as a file for CAD or print. */
import { signal } from "@preact/signals";
import { http, openedFor } from "../link";
import { figures, isOpen, opened } from "../part";
import type { ExportRequest, StartedExport } from "../protocol";
import { complain, jobs, place } from "../state";
import { Button, Check, count, mm, Section, SelectField } from "../ui/controls";
import { Icon } from "../ui/icons";
import { SurfaceView, viewCommands } from "../ui/surface";
import type { Room } from "./room";

type Format = ExportRequest["format"];
type Form = NonNullable<ExportRequest["dxf_forms"]>[number];

const FORMATS: readonly (readonly [Format, string, string])[] = [
  ["dxf", "DXF", "for AutoCAD and other CAD"],
  ["stl", "STL", "for printing and machining"],
  ["ply", "PLY", "with uncertainty and origin"],
  ["obj", "OBJ", "for rendering and modelling"],
  ["3mf", "3MF", "for printing, with its unit"],
  ["glb", "GLB", "for web, phones, museums"],
  ["xyz", "XYZ", "the measured points alone"],
  ["step", "STEP", "a solid of its shapes, for CAD"],
];
const FORMS: readonly (readonly [Form, string])[] = [
  ["3dface", "3DFACE, one for each triangle"],
  ["polyface", "polyface meshes"],
  ["mesh", "MESH (R2010)"],
  ["profiles", "profiles as polylines"],
];
const BINARY: readonly Format[] = ["stl", "ply"];

const format = signal<Format>("dxf");
const forms = signal<readonly Form[]>(["3dface"]);
const version = signal<"auto" | "R12" | "R2010">("auto");
const ascii = signal(false);
const objTexture = signal(false);
/** Exports started in this page, the newest first. */
const started = signal<readonly { job: string; name: string; at: Date }[]>([]);
/** Finished ones stay here when their job is forgotten. */
const ready = signal<ReadonlyMap<string, string>>(new Map());
/** Keep the addresses of finished files: once. */
export function startExport(): void {
  jobs.subscribe((all) => {
    const done = [...all.values()].filter((job) => job.what === "export" && job.download && !ready.peek().has(job.job));
    if (done.length)
      ready.value = new Map([
        ...ready.peek(),
        ...done.map((job) => [job.job, `api/downloads/${job.download}`] as const),
      ]);
  });
}

/** Whether the colours are written as a texture beside the mesh, all in a zip. */
const zipped = () => format.value === "obj" && objTexture.value && opened.value?.textured === true;

function request(): ExportRequest {
  if (zipped()) return { format: "obj", obj_texture: true };
  if (format.value !== "dxf") return { format: format.value, ascii: BINARY.includes(format.value) && ascii.value };
  return { format: "dxf", dxf_forms: [...forms.value], dxf_version: version.value === "auto" ? null : version.value };
}

/** The name of the part, numbered where this page has exported a file of that name. */
function newName(part: string, suffix: string): string {
  const taken = new Set(started.value.map(({ name }) => name));
  let name = `${part}.${suffix}`;
  for (let number = 2; taken.has(name); number++) name = `${part}-${number}.${suffix}`;
  return name;
}

async function start(): Promise<void> {
  const name = newName(opened.value?.name ?? "part", zipped() ? "zip" : format.value);
  try {
    const scan = place.value.scan ?? "";
    const ask = () =>
      http(`api/scans/${scan}/exports`, {
        method: "POST",
        headers: { "Content-Type": "application/json" },
        body: JSON.stringify(request()),
      });
    const response = await openedFor(scan, ask, false);
    const { job }: StartedExport = await response.json();
    started.value = [{ job, name, at: new Date() }, ...started.value];
  } catch (error) {
    complain(error);
  }
}

function Formats() {
  return (
    <div class="cards" role="radiogroup" aria-label="Format">
      {FORMATS.map(([id, title, about]) => (
        <label key={id} class={`card ${format.value === id ? "current" : ""}`}>
          <input type="radio" name="format" checked={format.value === id} onChange={() => (format.value = id)} />
          <strong>{title}</strong>
          <span class="quiet">{about}</span>
        </label>
      ))}
    </div>
  );
}

function toggle(form: Form, on: boolean): void {
  forms.value = FORMS.map(([id]) => id).filter((id) => (id === form ? on : forms.value.includes(id)));
}

function Options() {
  if (format.value === "dxf") {
    return (
      <Section title="DXF">
        {FORMS.map(([id, text]) => (
          <Check key={id} label={text} checked={forms.value.includes(id)} onChange={(on) => toggle(id, on)} />
        ))}
        <SelectField
          label="Version"
          value={version.value}
          options={[
            ["auto", "automatic"],
            ["R12", "R12"],
            ["R2010", "R2010"],
          ]}
          onChange={(value) => (version.value = value)}
        />
      </Section>
    );
  }
  if (format.value === "obj" && opened.value?.textured)
    return (
      <Section title="OBJ">
        <Check
          label="Colours also as a texture (zip with MTL and PNG)"
          checked={objTexture.value}
          onChange={(on) => (objTexture.value = on)}
        />
      </Section>
    );
  if (!BINARY.includes(format.value)) return null;
  return (
    <Section title={format.value.toUpperCase()}>
      <Check label="As text, larger" checked={ascii.value} onChange={(on) => (ascii.value = on)} />
    </Section>
  );
}

/** What a person should know before the file leaves the house. */
function Advice() {
  const now = figures.value;
  if (!now) return null;
  return (
    <Section title="What is written">
      <dl class="facts">
        <dt>Unit</dt>
        <dd>mm</dd>
        <dt>Triangles</dt>
        <dd>{count(now.faces)}</dd>
        {now.bounds && (
          <>
            <dt>Size</dt>
            <dd>{now.bounds[1].map((high, k) => (high - now.bounds![0][k]).toFixed(1)).join(" × ")} mm</dd>
            <dt>Lowest point</dt>
            <dd>{mm(now.bounds[0][2])}</dd>
          </>
        )}
        {now.volume !== null && (
          <>
            <dt>Volume</dt>
            <dd>{(now.volume / 1000).toFixed(2)} cm³</dd>
          </>
        )}
      </dl>
      {!now.closed && format.value !== "xyz" && (
        <p class="advice">
          The surface is open: a printer or a solid modeller may refuse it. Fill its holes in Edit first.
        </p>
      )}
      {format.value === "dxf" && now.faces > 200_000 && (
        <p class="advice">{count(now.faces)} triangles are heavy for CAD: decimate in Edit, or write profiles.</p>
      )}
    </Section>
  );
}

function Files() {
  if (!started.value.length) return null;
  return (
    <Section title="Files">
      <ul class="list" aria-label="Exported files, the newest first">
        {started.value.map(({ job, name, at }) => {
          const state = jobs.value.get(job);
          const download = ready.value.get(job);
          return (
            <li key={job}>
              {download ? (
                <a class="button plain grow" href={download} download={name}>
                  <Icon name="export" />
                  {name}
                  <span class="quiet num">{at.toLocaleTimeString("sv")}</span>
                </a>
              ) : (
                <span class="grow">
                  {name} <span class="quiet">{state?.state === "failed" ? state.text : "being written …"}</span>
                </span>
              )}
            </li>
          );
        })}
      </ul>
    </Section>
  );
}

function Export() {
  const nothing = format.value === "dxf" && forms.value.length === 0;
  return (
    <div class="room no-rail">
      <section class="pane surface" aria-label="Surface">
        <header>
          <h2>Surface</h2>
          <span class="about">as it will be written</span>
        </header>
        <div class="stage">
          <SurfaceView />
        </div>
      </section>
      <aside class="inspector" aria-label="Export" inert={!isOpen.value}>
        <Section title="Format">
          <Formats />
        </Section>
        <Options />
        <Advice />
        <div class="action">
          <Button kind="primary" icon="export" disabled={nothing} onClick={() => void start()}>
            Export {format.value.toUpperCase()}
          </Button>
          <span class="quiet">Each file is read back and compared before you get it.</span>
        </div>
        <Files />
      </aside>
    </div>
  );
}

export const exporting: Room = {
  id: "export",
  title: "Export",
  needsScan: true,
  View: Export,
  commands: [
    ...viewCommands,
    ...FORMATS.map(([id, title]) => ({
      title: `Export as ${title}`,
      group: "Export",
      run: () => {
        format.value = id;
        void start();
      },
    })),
    { title: "Write the file", group: "Export", keys: "Ctrl+Enter", run: () => void start() },
  ],
};
