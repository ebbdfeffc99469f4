/** What an import would make of the chosen pictures: steps and gaps, the laser's colour, the stripe. */
import { signal, useSignalEffect } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { link } from "../bus";
import { RefusedError } from "../link";
import type { ImportPreviewed, Remark, SeriesSeen, VerbEntry } from "../protocol";
import { LiveView, type ShownPicture } from "../scanner/picture";
import { isOperator } from "../state";
import { Button, Section, SelectField } from "../ui/controls";
import { chosen, type Values } from "./schema";
import { change, files, formOf, openVerb, schemaOf, send } from "./state";

interface Looked extends ShownPicture {
  header: ImportPreviewed;
}

const looked = signal<Looked | null>(null);
const looking = signal(false);
const refused = signal<{ text: string; hint: string } | null>(null);
/** Values of what is shown or under way. */
let asked = "";
/** What is to be asked for when the answer is there. */
let next: (() => void) | null = null;

async function look(values: Values, laser = "", picture: number | null = null): Promise<void> {
  if (looking.peek()) {
    next = () => void look(values, laser, picture);
    return;
  }
  looking.value = true;
  try {
    const { header, arrays } = await link.request({ kind: "preview_import", values, laser, picture });
    if (header.kind !== "import_preview") return;
    const jpeg = new Blob([new Uint8Array(arrays.u8("jpeg"))], { type: "image/jpeg" });
    looked.value = { header, image: await createImageBitmap(jpeg), stripe: arrays.f32("stripe") };
    refused.value = null;
  } catch (error) {
    if (!(error instanceof RefusedError)) throw error;
    refused.value = { text: error.message, hint: error.hint };
  } finally {
    looking.value = false;
    const more = next;
    next = null;
    more?.();
  }
}

/** A list of steps as ranges: 3, 7–9. */
export function ranges(steps: readonly number[]): string {
  const runs: [number, number][] = [];
  for (const step of steps) {
    const last = runs.at(-1);
    if (last && step === last[1] + 1) last[1] = step;
    else runs.push([step, step]);
  }
  return runs.map(([from, to]) => (from === to ? `${from}` : `${from}–${to}`)).join(", ");
}

/** The first picture of a series that a finding names. */
export function pictureOf(finding: Pick<Remark, "where">, series: Pick<SeriesSeen, "pictures">): number | null {
  const words = new Set(finding.where.split(/[\s,:]+/));
  const at = series.pictures.findIndex((name) => words.has(name));
  return at < 0 ? null : at;
}

function Facts({ header }: { header: ImportPreviewed }) {
  const now = header.series.find(({ laser }) => laser === header.laser) ?? header.series[0];
  const last = now.steps[now.steps.length - 1];
  return (
    <dl class="facts-list">
      <dt>Pictures</dt>
      <dd>
        {now.pictures.length}, steps {now.steps[0]} to {last}
      </dd>
      <dt>Missing steps</dt>
      <dd>{now.missing.length ? `${now.missing.length}: ${ranges(now.missing)}` : "none"}</dd>
      {header.weights && (
        <>
          <dt>Laser light</dt>
          <dd>{["red", "green", "blue"].map((name, k) => `${header.weights?.[k].toFixed(2)} ${name}`).join(", ")}</dd>
        </>
      )}
      <dt>Background</dt>
      <dd>{now.background}</dd>
      <dt>Threshold</dt>
      <dd>
        {now.threshold.toFixed(1)} grey levels, noise {now.noise.toFixed(2)}
      </dd>
      <dt>Line</dt>
      <dd>in {Math.round(100 * now.line_share)} % of the rows</dd>
    </dl>
  );
}

function Shown({ verb }: { verb: VerbEntry }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const shown = looked.value;
  useEffect(() => {
    const view = new LiveView(canvas.current!);
    const off = looked.subscribe((picture) => view.show(picture));
    return () => {
      off();
      view.dispose();
    };
  }, []);
  const header = shown?.header;
  const now = header?.series.find(({ laser }) => laser === header.laser);
  const show = (laser: string, picture: number | null) =>
    void look(chosen(schemaOf(verb), formOf(verb).values), laser, picture);
  const seen = shown ? shown.stripe.reduce((n, at) => n + Number(!Number.isNaN(at)), 0) : 0;
  return (
    <div class="preview">
      <div class="pane">
        <header>
          <h2>{header && now ? now.pictures[header.picture] : "Picture"}</h2>
          {header && (
            <span class="about">
              step {header.step} · stripe in {seen} of {shown.stripe.length} lines
            </span>
          )}
        </header>
        <div class="stage">
          <canvas ref={canvas} aria-label="Picture with the stripe that is found" role="img" />
        </div>
      </div>
      {header && now && (
        <div class="about-pictures">
          {header.series.length > 1 && (
            <SelectField
              label="Laser"
              value={header.laser}
              options={header.series.map(({ laser }) => [laser, laser] as const)}
              onChange={(laser) => show(laser, null)}
            />
          )}
          <div class="row">
            <Button
              icon="left"
              label="Picture before"
              disabled={header.picture === 0}
              onClick={() => show(header.laser, header.picture - 1)}
            />
            <input
              type="range"
              aria-label="Picture"
              min={0}
              max={now.pictures.length - 1}
              value={header.picture}
              onInput={(event) => show(header.laser, event.currentTarget.valueAsNumber)}
            />
            <Button
              icon="right"
              label="Picture after"
              disabled={header.picture === now.pictures.length - 1}
              onClick={() => show(header.laser, header.picture + 1)}
            />
          </div>
          <Facts header={header} />
          <ul class="findings" aria-label="Findings on the pictures">
            {header.findings.map((finding) => {
              const at = pictureOf(finding, now);
              return (
                <li key={finding.code} class={`finding ${finding.severity}`}>
                  <span>{finding.text}</span>
                  {finding.remedy && <span class="quiet">{finding.remedy}</span>}
                  {at !== null && (
                    <Button small onClick={() => show(header.laser, at)}>
                      Show {now.pictures[at]}
                    </Button>
                  )}
                </li>
              );
            })}
          </ul>
        </div>
      )}
    </div>
  );
}

/** Angles of even steps that make a full turn, as the field has them; null before the pictures were looked at. */
export function fullTurn(series: readonly Pick<SeriesSeen, "steps" | "missing">[]): string | null {
  const last = Math.max(-1, ...series.flatMap(({ steps, missing }) => [...steps, ...missing]));
  return last > 0 ? `step:${Number((360 / (last + 1)).toFixed(6))}` : null;
}

/** Ways to say the angles, without knowing how they are written. */
function AngleWays({ verb }: { verb: VerbEntry }) {
  const input = useRef<HTMLInputElement>(null);
  const set = (angles: string) => change(verb, { values: { ...formOf(verb).values, angles } });
  const turn = fullTurn(looked.value?.header.series ?? []);
  const tables = files.value.filter(({ kinds, name }) => kinds.includes("table") && /\.csv$/i.test(name));
  const take = async (list: FileList | null) => {
    const sent = await send(list ?? []);
    const table = files.value.find(({ file }) => sent.includes(file));
    if (table) set(table.name);
  };
  return (
    <span class="row">
      {turn && (
        <Button small onClick={() => set(turn)}>
          Even steps of a full turn
        </Button>
      )}
      <Button small onClick={() => set("markers")}>
        Markers on the table
      </Button>
      {tables.map(({ file, name }) => (
        <Button key={file} small onClick={() => set(name)}>
          {name}
        </Button>
      ))}
      <Button small onClick={() => input.current?.click()}>
        A file of angles …
      </Button>
      <input
        ref={input}
        type="file"
        hidden
        accept=".csv"
        aria-label="CSV file from this computer"
        onChange={(event) => void take(event.currentTarget.files)}
      />
    </span>
  );
}

/** What helps to fill in a field of an import. */
export function importHelp(verb: VerbEntry, name: string): ComponentChildren {
  if (name === "angles") return <AngleWays verb={verb} />;
  if (name !== "rig") return undefined;
  return (
    <span class="row">
      <Button small onClick={() => openVerb("calibrate", null)}>
        Make a rig from pictures of a board …
      </Button>
    </span>
  );
}

/** The pictures that are chosen, looked at again whenever a choice about them changes. */
export function ImportPreview({ verb }: { verb: VerbEntry }) {
  useSignalEffect(() => {
    const { values } = formOf(verb);
    const { angles: _, rig: __, ...about } = chosen(schemaOf(verb), values);
    const key = JSON.stringify(about);
    if (key === asked || !isOperator.value) return;
    asked = key;
    if ((values.pictures as string[])?.length) void look(about);
    else looked.value = refused.value = null;
  });
  const form = formOf(verb);
  if (!(form.values.pictures as string[])?.length) return null;
  return (
    <Section title="In the pictures">
      {refused.value && (
        <div class="notice error" role="alert">
          <span>{refused.value.text}</span>
          {refused.value.hint && <span class="hint">{refused.value.hint}</span>}
        </div>
      )}
      {looking.value && !looked.value && (
        <p class="quiet" role="status">
          Looking at the pictures …
        </p>
      )}
      {looked.value && <Shown verb={verb} />}
    </Section>
  );
}
