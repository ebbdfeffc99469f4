/** Profile, picture and grid: canvases in thin wrappers. */
import { useSignalEffect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { FLAGS, flagWords } from "../grid/data";
import { GRID_COLOURINGS, GridView } from "../grid/view";
import { css } from "../mesh/colours";
import { grids, loadGrid, mark, opened, pictureOf, profile } from "../part";
import { PictureView } from "../profile/picture";
import { ProfilePlot } from "../profile/plot";
import { theme } from "../state";
import { Button, SelectField } from "../ui/controls";
import { pickCandidate, placePoint } from "./edits";
import { Pane } from "./pane";
import { gridColouring, gridShown, lines, markedGrid, markPlace, pictureTool, range, stepMark } from "./state";

/** The views that are on the page. */
export const onPage: { picture: PictureView | null; grid: GridView | null } = { picture: null, grid: null };

interface View {
  dispose(): void;
  redraw(): void;
}

/** A canvas with a framework-free view on it, for as long as it is on the page. */
function useView<V extends View>(make: (canvas: HTMLCanvasElement) => V, update: (view: V) => void) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const view = useRef<V | null>(null);
  useEffect(() => {
    view.current = make(canvas.current!);
    update(view.current);
    return () => {
      view.current?.dispose();
      view.current = null;
    };
  }, []);
  useSignalEffect(() => {
    void theme.value;
    if (view.current) {
      update(view.current);
      view.current.redraw();
    } else update({ show() {} } as never);
  });
  return canvas;
}

export function ProfilePane() {
  const canvas = useView(
    (element) =>
      new ProfilePlot(element, {
        mark: (line) => mark.value && void markPlace(mark.value.grid, mark.value.step, line),
        range: (found) => (lines.value = found),
      }),
    (plot) => plot.show(markedGrid.value, mark.value?.step ?? -1, profile.value, mark.value?.line ?? -1, lines.value),
  );
  const at = mark.value;
  const shown = profile.value;
  return (
    <Pane
      name="profile"
      title="Profile"
      about={
        at &&
        at.step >= 0 &&
        `step ${at.step}${shown?.step === at.step ? ` · ${shown.header.angle_deg.toFixed(2)}°` : ""}`
      }
      tools={
        <>
          <Button
            kind="plain"
            small
            icon="left"
            label="Profile before"
            keys="PgUp"
            disabled={!at || at.step < 0}
            onClick={() => void stepMark(-1, 0)}
          />
          <Button
            kind="plain"
            small
            icon="right"
            label="Profile after"
            keys="PgDn"
            disabled={!at || at.step < 0}
            onClick={() => void stepMark(1, 0)}
          />
        </>
      }
    >
      <canvas ref={canvas} tabIndex={0} role="img" aria-label="Profile: radius against height" />
      {(!at || at.step < 0) && <Nothing />}
      {at && at.step >= 0 && markedGrid.value && markedGrid.value.row(at.step) < 0 && (
        <div class="empty">This profile is disabled. Undo, or disable that edit in the history.</div>
      )}
    </Pane>
  );
}

const PICTURE_TOOLS = [
  ["mark", "point", "Mark the line"],
  ["candidate", "peak", "Pick the candidate at a click"],
  ["place", "move", "Move or add: put the stripe of a line here"],
] as const;

export function PicturePane() {
  const canvas = useView(
    (element) =>
      new PictureView(element, {
        mark: (line) => mark.value && void markPlace(mark.value.grid, mark.value.step, line),
        candidate: (line, position) => void pickCandidate(line, position),
        place: (line, position) => void placePoint(line, position),
      }),
    (view) => {
      view.tool = pictureTool.value;
      const shown = profile.value;
      view.show(shown, shown ? pictureOf(shown) : "", mark.value?.line ?? -1);
      onPage.picture = view;
    },
  );
  const at = mark.value;
  return (
    <Pane
      name="picture"
      title="Picture"
      about={at && at.line >= 0 && `line ${at.line}`}
      tools={
        <>
          {PICTURE_TOOLS.map(([name, icon, label]) => (
            <Button
              key={name}
              kind="plain"
              small
              icon={icon}
              label={label}
              pressed={pictureTool.value === name}
              onClick={() => (pictureTool.value = name)}
            />
          ))}
          <Button
            kind="plain"
            small
            icon="search"
            label="Zoom to the marked line"
            keys="Z"
            onClick={() => onPage.picture?.zoomToMark()}
          />
        </>
      }
    >
      <canvas ref={canvas} tabIndex={0} role="img" aria-label="Camera picture with the stripe" />
      {(!at || at.step < 0) && <Nothing />}
    </Pane>
  );
}

const GRID_WORDS = {
  quality: "quality",
  sigma: "uncertainty",
  amplitude: "brightness",
  cause: "cause of gaps",
  edits: "edits",
};
const GRID_OPTIONS = GRID_COLOURINGS.map((name) => [name, GRID_WORDS[name]] as const);

export function GridPane() {
  const canvas = useView(
    (element) =>
      new GridView(element, {
        mark: (step, line) => void markPlace(gridShown.value, step, line, true),
        range: (found) => (range.value = found),
      }),
    (view) => {
      onPage.grid = view;
      const at = mark.value?.grid === gridShown.value ? mark.value : null;
      view.show(grids.value[gridShown.value] ?? null, gridColouring.value, at?.step ?? -1, at?.line ?? -1, range.value);
    },
  );
  useSignalEffect(() => {
    if (opened.value) void loadGrid(gridShown.value);
  });
  const grid = grids.value[gridShown.value];
  const at = mark.value;
  const row = grid && at ? grid.row(at.step) : -1;
  const flags = grid && at && row >= 0 ? grid.flags[row * grid.lines + at.line] : 0;
  const all = opened.value?.grids ?? [];
  return (
    <Pane
      name="grid"
      title="Scan grid"
      about={
        grid &&
        (at && row >= 0
          ? `step ${at.step} · line ${at.line}${flags ? ` · ${flagWords(flags)}` : ""}`
          : `${grid.steps.length} steps × ${grid.lines} lines`)
      }
      foot={
        grid && (
          <div class="key">
            {GridView.key(grid, gridColouring.value).map(({ colour, text }, i) => (
              <span key={i}>
                <span class="swatch" style={{ background: css(colour) }} />
                {text}
              </span>
            ))}
          </div>
        )
      }
      tools={
        <>
          {all.length > 1 && (
            <SelectField
              bare
              label="Laser and turn"
              value={String(gridShown.value)}
              options={all.map((one) => [String(one.grid), `${one.laser} ${one.first_step}–${one.last_step}`] as const)}
              onChange={(value) => (gridShown.value = Number(value))}
            />
          )}
          <SelectField
            bare
            label="Colours of the grid"
            value={gridColouring.value}
            options={GRID_OPTIONS}
            onChange={(value) => (gridColouring.value = value)}
          />
        </>
      }
    >
      <canvas
        ref={canvas}
        tabIndex={0}
        role="img"
        aria-label={`Scan grid: steps across, lines down; quality marks are ${FLAGS.map(([, word]) => word).join(", ")}`}
      />
    </Pane>
  );
}

function Nothing() {
  return <div class="empty">Click a point on the surface or in the scan grid</div>;
}
