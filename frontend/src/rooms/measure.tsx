/** Inspect: dimensions with their uncertainty and limits, and the deviation from a reference; kept with the scan. */
import { effect, signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { link } from "../bus";
import type { AnyArray } from "../envelope";
import { DeviationPanel, forgetProbes, probe, probeItems, probing } from "../inspect/deviation";
import { DimensionsPanel, keepCurrent, written } from "../inspect/dimensions";
import { ReportPanel } from "../inspect/report";
import { SectionsPanel, sectionItems } from "../inspect/sections";
import { ShapesPanel } from "../inspect/shapes";
import { isOpen, mark, measures, opened } from "../part";
import type { TakeMeasure } from "../protocol";
import { stepCommands } from "../repair/commands";
import { complain, isOperator } from "../state";
import { Button, openSection, Section } from "../ui/controls";
import { hint } from "../ui/frame";
import type { IconName } from "../ui/icons";
import { pressNamed } from "../ui/onpage";
import { SurfaceView, viewCommands } from "../ui/surface";
import type { Vec } from "../viewport/camera";
import type { Item } from "../viewport/overlay";
import type { Hit } from "../viewport/pick";
import { currentViewport, hear, selected, tool } from "../viewport/place";
import type { Tool } from "../viewport/tools";
import type { Room } from "./room";

type What = TakeMeasure["what"];

interface Kind {
  what: What;
  title: string;
  keys: string;
  /** Points that are to be clicked. */
  places: number;
  region: "none" | "may" | "must";
  how: string;
}

const KINDS: readonly Kind[] = [
  { what: "distance", title: "Distance", keys: "D", places: 2, region: "none", how: "Click two points." },
  {
    what: "to_plane",
    title: "Point to plane",
    keys: "T",
    places: 1,
    region: "must",
    how: "Select the flat region, then click the point.",
  },
  {
    what: "diameter",
    title: "Diameter",
    keys: "C",
    places: 1,
    region: "may",
    how: "Click a height for the section there, or select a round region.",
  },
  {
    what: "angle",
    title: "Angle",
    keys: "G",
    places: 3,
    region: "none",
    how: "Click three points; the second is the corner.",
  },
  {
    what: "area",
    title: "Area",
    keys: "Q",
    places: 0,
    region: "may",
    how: "Of the selection, or of the whole surface.",
  },
  { what: "volume", title: "Volume", keys: "U", places: 0, region: "none", how: "Of the closed surface." },
];
const TOOLS: readonly (readonly [Tool & IconName, string, string])[] = [
  ["navigate", "Look and click points", "V"],
  ["box", "Box", "R"],
  ["lasso", "Lasso", "L"],
  ["brush", "Brush", "B"],
  ["angle", "Region bounded by sharp edges", "A"],
];
const INK = "#f0691e";

const kind = signal<Kind>(KINDS[0]);
const places = signal<readonly Vec[]>([]);
const busy = signal(false);

function choose(next: Kind): void {
  kind.value = next;
  places.value = [];
  probing.value = false;
  tool.value = "navigate";
}

/** Whether there is enough for a measurement. */
function enough(): boolean {
  const { places: wanted, region } = kind.value;
  const some = selected.value > 0;
  if (kind.value.what === "diameter") return some || places.value.length === 1;
  return places.value.length === wanted && (region !== "must" || some);
}

async function take(): Promise<void> {
  const scan = opened.value?.scan;
  if (!scan || !enough() || busy.value) return;
  const selection = kind.value.region !== "none" ? currentViewport()?.selection : undefined;
  const arrays: Record<string, AnyArray> = selection?.count ? selection.arrays() : {};
  busy.value = true;
  try {
    await link.request({ kind: "measure", scan, what: kind.value.what, places: [...places.value] }, arrays);
    places.value = [];
  } catch (error) {
    complain(error);
  } finally {
    busy.value = false;
  }
}

function click(hit: Hit): void {
  if (!probe(hit)) add(hit);
}

function add({ point }: { point: Vec }): void {
  if (tool.value !== "navigate" || !kind.value.places) return;
  const next = [...places.value, point];
  places.value = next.slice(-kind.value.places);
  // A distance needs no more words; a region may still be wanted for the others.
  if (enough() && kind.value.region === "none") void take();
}

/** The point that is marked in all views can be taken, too: so no mouse is needed. */
const marked = () => mark.value?.point ?? null;

function addMarked(): void {
  const point = marked();
  if (point) add({ point: [...point] });
}

function items(): Item[] {
  const out: Item[] = places.value.map((at, k) => ({ kind: "point", at: [...at], colour: INK, label: String(k + 1) }));
  const at = marked();
  if (at) out.push({ kind: "point", at: [...at], colour: INK });
  for (const measure of measures.value) {
    const points = measure.places.map(([x, y, z]): Vec => [x, y, z]);
    const label = measure.name ? `${measure.name}: ${written(measure)}` : written(measure);
    if (points.length > 1)
      out.push({ kind: "line", points, colour: "#ffc24a", label, closed: measure.what === "diameter" });
    else if (points.length) out.push({ kind: "point", at: points[0], colour: "#ffc24a", label });
  }
  return [...out, ...probeItems(), ...sectionItems()];
}

function Rail() {
  return (
    <div class="rail" inert={!isOpen.value} role="toolbar" aria-label="Tools" aria-orientation="vertical">
      {TOOLS.map(([name, label, keys]) => (
        <Button
          key={name}
          icon={name}
          label={label}
          keys={keys}
          pressed={tool.value === name}
          onClick={() => (tool.value = name)}
        />
      ))}
    </div>
  );
}

function KindPanel() {
  const now = kind.value;
  return (
    <Section title="New measurement">
      <div class="grid-2" role="group" aria-label="What to measure">
        {KINDS.map((one) => (
          <Button key={one.what} pressed={one === now} keys={one.keys} label={one.title} onClick={() => choose(one)}>
            {one.title}
          </Button>
        ))}
      </div>
      <p class="quiet">{now.how}</p>
      {now.places > 0 && (
        <p class="num" role="status">
          {places.value.length} of {now.places} points
          {now.region !== "none" && ` · ${selected.value} triangles selected`}
        </p>
      )}
      {now.places > 0 && marked() && (
        <Button keys="M" label="Take the point that is marked; arrows and PgUp, PgDn move it" onClick={addMarked}>
          Take the marked point
        </Button>
      )}
      <Button
        kind="primary"
        icon="ruler"
        keys="Enter"
        label="Measure it"
        disabled={!isOperator.value || busy.value || !enough()}
        onClick={() => void take()}
      >
        Measure it
      </Button>
    </Section>
  );
}

function MeasureRoom() {
  useEffect(() => {
    hear.pick = click;
    tool.value = "navigate";
    const stops = [
      effect(() => currentViewport()?.setItems(items())),
      effect(() => {
        hint.value = probing.value ? "Click the surface to read its deviation." : kind.value.how;
      }),
      keepCurrent(),
    ];
    return () => {
      for (const stop of stops) stop();
      hear.pick = () => {};
      hint.value = "";
      places.value = [];
      forgetProbes();
      currentViewport()?.setItems([]);
    };
  }, []);
  return (
    <div class="room">
      <Rail />
      <section class="pane surface" aria-label="Surface">
        <header>
          <h2>Surface</h2>
        </header>
        <div class="stage">
          <SurfaceView />
        </div>
      </section>
      <aside class="inspector" aria-label="Inspect" inert={!isOpen.value}>
        <KindPanel />
        <DimensionsPanel />
        <ShapesPanel />
        <SectionsPanel />
        <DeviationPanel />
        <ReportPanel />
      </aside>
    </div>
  );
}

/** What has settings of its own: the command leads to them. */
const PANELS = ["Shapes", "Sections", "Deviation from a reference", "Report"] as const;

const PRESSED = ["Save as CSV", "Measure the same on another scan …"] as const;

export const measure: Room = {
  id: "measure",
  title: "Inspect",
  needsScan: true,
  View: MeasureRoom,
  commands: [
    ...KINDS.map((one) => ({ title: one.title, group: "Measure", keys: one.keys, run: () => choose(one) })),
    ...viewCommands,
    ...stepCommands,
    ...TOOLS.map(([name, title, keys]) => ({ title, group: "Tools", keys, run: () => (tool.value = name) })),
    ...PANELS.map((title) => ({ title: `${title} …`, group: "Measure", run: () => openSection(title) })),
    ...PRESSED.map((title) => ({ title, group: "Measure", run: () => pressNamed(title) })),
    { title: "Take the marked point", group: "Measure", keys: "M", run: addMarked, enabled: () => marked() !== null },
    { title: "Measure it", group: "Measure", keys: "Enter", run: () => void take(), enabled: enough },
    {
      title: "Discard the points",
      group: "Measure",
      keys: "Esc",
      run: () => {
        places.value = [];
        currentViewport()?.clearSelection();
      },
    },
  ],
};
