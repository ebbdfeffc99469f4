/** Repair: the surface, the profile with its picture, and the scan grid, all of one scan. */
import { effect } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { COLOURINGS } from "../mesh/colours";
import { canUndo, cursor, figures, history, holes, isOpen, mark, opened, redo, undo } from "../part";
import { refusal, sides, trial } from "../repair/choices";
import { commands, TOOL_NAMES, take } from "../repair/commands";
import { CutPanel } from "../repair/cutting";
import { bridgeAt, smoothFaces } from "../repair/edits";
import { HistoryPanel, LastEdit } from "../repair/history";
import { HolesPanel } from "../repair/lists";
import { Pane } from "../repair/pane";
import { GridPane, PicturePane, ProfilePane } from "../repair/panes";
import { PointPanel } from "../repair/point";
import { RepairPanels } from "../repair/repairs";
import { SelectByPanel, SelectionPanel } from "../repair/selecting";
import { SettingsPanel } from "../repair/settings";
import { SidesView } from "../repair/sides";
import { bridgeFrom, chosenHoles, large, markHit, type Tab, TOOL_HINTS, tab } from "../repair/state";
import { TrialPatch, TrialProfiles } from "../repair/trial";
import { level } from "../state";
import { Button, count, SelectField } from "../ui/controls";
import { hint } from "../ui/frame";
import type { IconName } from "../ui/icons";
import { SurfaceView } from "../ui/surface";
import type { Item } from "../viewport/overlay";
import { colouring, currentViewport, hear, tool, visibleOnly } from "../viewport/place";
import { TOOLS, type Tool } from "../viewport/tools";
import type { Room } from "./room";

const GROUP_ENDS: readonly Tool[] = ["navigate", "angle"];
const TABS: readonly (readonly [Tab, string])[] = [
  ["repair", "Repair"],
  ["point", "Point"],
  ["holes", "Holes"],
  ["history", "History"],
  ["settings", "Settings"],
];
const COLOUR_WORDS = {
  plain: "one colour",
  sigma: "uncertainty",
  laser: "laser",
  height: "height",
  measured: "measured",
  deviation: "deviation from a reference",
  shapes: "shapes found",
  edits: "edits by hand",
};
const COLOUR_OPTIONS = COLOURINGS.map((name) => [name, COLOUR_WORDS[name]] as const);
const IMAGE_COLOURS = ["own", "colours of the texture images"] as const;

function Rail() {
  return (
    <div class="rail" inert={!isOpen.value} role="toolbar" aria-label="Tools" aria-orientation="vertical">
      {TOOLS.map((name) => [
        <Button
          key={name}
          icon={name as IconName}
          label={TOOL_NAMES[name][0]}
          keys={TOOL_NAMES[name][1]}
          pressed={tool.value === name}
          onClick={() => take(name)}
        />,
        GROUP_ENDS.includes(name) && <hr key={`${name}-end`} />,
      ])}
      <hr />
      <Button
        icon="eye"
        label="Visible surface only"
        keys="N"
        pressed={visibleOnly.value}
        onClick={() => (visibleOnly.value = !visibleOnly.value)}
      />
      <Button icon="fit" label="See everything" keys="Shift+F" onClick={() => currentViewport()?.fit()} />
      <hr />
      <Button icon="undo" label="Undo" keys="Ctrl+Z" disabled={!canUndo.value} onClick={() => void undo()} />
      <Button
        icon="redo"
        label="Redo"
        keys="Ctrl+Shift+Z"
        disabled={cursor.value >= history.value.length}
        onClick={() => void redo()}
      />
    </div>
  );
}

function SurfacePane() {
  const now = figures.value;
  return (
    <Pane
      name="surface"
      title="Surface"
      about={now && `${count(now.faces)} triangles${now.closed ? " · closed" : ""}`}
      tools={
        <SelectField
          bare
          label="Colours of the surface"
          value={colouring.value}
          options={opened.value?.textured ? [...COLOUR_OPTIONS, IMAGE_COLOURS] : COLOUR_OPTIONS}
          onChange={(value) => (colouring.value = value)}
        />
      }
    >
      <SurfaceView />
    </Pane>
  );
}

function Inspector() {
  return (
    <aside class="inspector" aria-label="Inspector" inert={!isOpen.value}>
      <div class="tabs" role="tablist" aria-label="Panels">
        {TABS.map(([id, title]) => (
          <button
            key={id}
            type="button"
            role="tab"
            id={`tab-${id}`}
            aria-selected={tab.value === id}
            aria-controls="tab-panel"
            tabIndex={tab.value === id ? 0 : -1}
            onClick={() => (tab.value = id)}
            onKeyDown={(event) => turnTab(event, id)}
          >
            {title}
          </button>
        ))}
      </div>
      <div id="tab-panel" role="tabpanel" aria-labelledby={`tab-${tab.value}`}>
        {tab.value === "repair" && (
          <>
            {tool.value === "cut" && <CutPanel />}
            <SelectionPanel />
            <SelectByPanel />
            <RepairPanels />
            <div class="row" style={{ padding: "8px 12px" }}>
              <Button
                kind="plain"
                small
                onClick={() => (level.value = level.value === "beginner" ? "expert" : "beginner")}
              >
                {level.value === "beginner" ? "Show expert panels" : "Hide expert panels"}
              </Button>
            </div>
          </>
        )}
        {tab.value === "point" && <PointPanel />}
        {tab.value === "holes" && <HolesPanel />}
        {tab.value === "history" && <HistoryPanel />}
        {tab.value === "settings" && <SettingsPanel />}
      </div>
    </aside>
  );
}

/** The arrow keys go through the tabs, as in every list of tabs. */
function turnTab(event: KeyboardEvent, id: Tab): void {
  const by = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
  if (!by) return;
  event.preventDefault();
  const next = TABS[(TABS.findIndex(([one]) => one === id) + by + TABS.length) % TABS.length][0];
  tab.value = next;
  document.getElementById(`tab-${next}`)?.focus();
}

/** What the views mark on the surface: the point, and the chosen holes. */
function markedItems(): Item[] {
  const items: Item[] = [];
  if (mark.value?.point) items.push({ kind: "point", at: mark.value.point, colour: "#f0691e" });
  if (bridgeFrom.value) items.push({ kind: "point", at: bridgeFrom.value, colour: "#3fb8f2" });
  for (const hole of holes.value ?? []) {
    if (!chosenHoles.value.has(hole.hole)) continue;
    const points = Array.from(
      { length: hole.loop.length / 3 },
      (_, i) => [hole.loop[3 * i], hole.loop[3 * i + 1], hole.loop[3 * i + 2]] as [number, number, number],
    );
    items.push({ kind: "line", points, colour: "#ffc24a", closed: true });
  }
  return items;
}

function Repair() {
  useEffect(() => {
    hear.pick = (hit) => {
      if (tool.value === "navigate") markHit(hit);
      if (tool.value === "bridge") void bridgeAt(hit.point);
    };
    hear.smooth = (faces) => void smoothFaces(faces);
    const stops = [
      effect(() => currentViewport()?.setItems(markedItems())),
      effect(() => {
        hint.value = TOOL_HINTS.value;
      }),
    ];
    return () => {
      for (const stop of stops) stop();
      hear.pick = hear.smooth = () => {};
      hint.value = "";
      currentViewport()?.setItems([]);
    };
  }, []);
  const only = large.value;
  const tries = trial.value !== null || refusal.value !== null;
  if (sides.value)
    return (
      <div class="room">
        <Rail />
        <SidesView />
        <Inspector />
      </div>
    );
  return (
    <div class="room">
      <Rail />
      <div class={`views ${only ? `large-${only}` : ""}`}>
        {(!only || only === "surface") && <SurfacePane />}
        {only === "profile" && <ProfilePane />}
        {only === "picture" && <PicturePane />}
        {only === "grid" && <GridPane />}
        {!only && tries && (
          <>
            <TrialProfiles />
            <TrialPatch />
          </>
        )}
        {!only && !tries && (
          <>
            <div class="pair">
              <ProfilePane />
              <PicturePane />
            </div>
            <GridPane />
          </>
        )}
      </div>
      <Inspector />
    </div>
  );
}

export const repair: Room = {
  id: "repair",
  title: "Edit",
  needsScan: true,
  View: Repair,
  Status: LastEdit,
  commands: [
    ...commands,
    ...COLOUR_OPTIONS.map(([name, words]) => ({
      title: `Colours: ${words}`,
      group: "View",
      run: () => (colouring.value = name),
    })),
  ],
};
