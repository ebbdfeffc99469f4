import type { Command } from "../commands";
import { openSection } from "../ui/controls";
import { pressNamed } from "../ui/onpage";
import { viewCommands } from "../ui/surface";
import { bordersShown, brushRadius, currentViewport, selected, tool, visibleOnly } from "../viewport/place";
import { TOOLS, type Tool } from "../viewport/tools";
import { deletePoints, deleteSelected, deleteUnselected } from "./edits";
import { onPage } from "./panes";
import { nudge } from "./point";
import { bridgeFrom, large, lines, preview, stepMark, type Tab, tab } from "./state";

export const TOOL_NAMES: Record<Tool, readonly [string, string]> = {
  navigate: ["Look and click points", "V"],
  box: ["Box", "R"],
  lasso: ["Lasso", "L"],
  polygon: ["Polygon", "P"],
  brush: ["Brush", "B"],
  connected: ["Connected piece", "W"],
  angle: ["Region bounded by sharp edges", "A"],
  smooth: ["Smoothing brush", "G"],
  bridge: ["Bridge between two boundaries", "J"],
  cut: ["Cut by a plane", "K"],
};

const COPY = "Copy edits to another scan …";

const view = () => currentViewport();
const some = () => selected.value > 0;
const resizeBrush = (factor: number) => (brushRadius.value = Math.max(3, Math.min(300, brushRadius.value * factor)));

/** Take a tool in hand, and show the panel it belongs to. */
export function take(name: Tool): void {
  tool.value = name;
  bridgeFrom.value = null;
  if (name !== "navigate") tab.value = "repair";
}

/** Drop what is under way: a preview, the selection, the tool, in this order. */
function dropLatest(): void {
  if (preview.value) preview.value = null;
  else if (bridgeFrom.value) bridgeFrom.value = null;
  else if (lines.value.length) lines.value = [];
  else if (some()) view()?.clearSelection();
  else tool.value = "navigate";
}

/** To walk through the profiles: the point that is marked moves on. */
export const stepCommands: readonly Command[] = [
  { title: "Profile before", group: "Profile", keys: "PgUp", run: () => void stepMark(-1, 0) },
  { title: "Profile after", group: "Profile", keys: "PgDn", run: () => void stepMark(1, 0) },
  { title: "Ten profiles before", group: "Profile", keys: "Shift+PgUp", run: () => void stepMark(-10, 0) },
  { title: "Ten profiles after", group: "Profile", keys: "Shift+PgDn", run: () => void stepMark(10, 0) },
  { title: "Line above", group: "Profile", keys: "Up", run: () => void stepMark(0, -1) },
  { title: "Line below", group: "Profile", keys: "Down", run: () => void stepMark(0, 1) },
];

/** What has settings of its own: the command leads to them. */
const PANELS = [
  ["Fill holes …", "holes", "Holes"],
  ["Smooth …", "repair", "Smooth"],
  ["Remove spikes …", "repair", "Spikes"],
  ["Decimate …", "repair", "Decimate"],
  ["Remove small pieces …", "repair", "Small pieces"],
  ["Make watertight …", "repair", "Make watertight"],
  ["Join first and last profile …", "repair", "Seam"],
  ["Candidates of a stripe …", "point", "Candidates in this line"],
  ["Set of settings …", "settings", "Set of settings"],
  ["Compare two settings …", "settings", "Compare two settings"],
] as const;

function openPanel(where: Tab, section: string): void {
  tab.value = where;
  openSection(section);
}

export const commands: readonly Command[] = [
  ...TOOLS.map((name) => ({
    title: TOOL_NAMES[name][0],
    group: "Tools",
    keys: TOOL_NAMES[name][1],
    run: () => take(name),
  })),
  { title: "Smaller brush", group: "Tools", keys: "[", run: () => resizeBrush(1 / 1.25) },
  { title: "Larger brush", group: "Tools", keys: "]", run: () => resizeBrush(1.25) },
  {
    title: "Visible surface only, or through the part",
    group: "Selection",
    keys: "N",
    run: () => (visibleOnly.value = !visibleOnly.value),
  },
  { title: "Grow", group: "Selection", keys: "+", run: () => view()?.grow(), enabled: some },
  { title: "Shrink", group: "Selection", keys: "-", run: () => view()?.shrink(), enabled: some },
  { title: "Invert", group: "Selection", keys: "Ctrl+I", run: () => view()?.invert() },
  { title: "Select all", group: "Selection", keys: "Ctrl+A", run: () => view()?.selectAll() },
  { title: "Discard preview, selection, tool", group: "Selection", keys: "Esc", run: dropLatest },
  {
    title: "Delete the selection",
    group: "Edit",
    keys: "Del",
    run: () => void (some() ? deleteSelected() : deletePoints()),
  },
  {
    title: "Delete all but the selection",
    group: "Edit",
    keys: "Ctrl+Del",
    run: () => void deleteUnselected(),
    enabled: some,
  },
  ...PANELS.map(([title, where, section]) => ({ title, group: "Edit", run: () => openPanel(where, section) })),
  { title: "Holes and findings", group: "Edit", keys: "H", run: () => (tab.value = "holes") },
  { title: "History", group: "Edit", keys: "Y", run: () => (tab.value = "history") },
  {
    title: COPY,
    group: "Edit",
    run: () => {
      tab.value = "history";
      pressNamed(COPY);
    },
  },
  {
    title: "Profile off",
    group: "Edit",
    run: () => {
      tab.value = "point";
      pressNamed("Profile off");
    },
  },
  { title: "Settings of the reconstruction", group: "Edit", run: () => (tab.value = "settings") },
  ...viewCommands,
  {
    title: "Show the boundaries of holes",
    group: "View",
    keys: "E",
    run: () => (bordersShown.value = !bordersShown.value),
  },
  {
    title: "One view alone, or all",
    group: "View",
    keys: "X",
    run: () => (large.value = large.value ? null : "surface"),
  },
  ...stepCommands,
  { title: "Point to the left", group: "Profile", keys: "Shift+Left", run: () => nudge(-1) },
  { title: "Point to the right", group: "Profile", keys: "Shift+Right", run: () => nudge(1) },
  { title: "Zoom to the marked line", group: "Profile", keys: "Z", run: () => onPage.picture?.zoomToMark() },
];
