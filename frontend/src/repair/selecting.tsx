/** The panel of the selection: what is selected, and selecting by what is known of the faces. */
import { useState } from "preact/hooks";
import { FLAGS, type Grid } from "../grid/data";
import { figures, grids, lasers, loadGrid, mesh, opened, shape } from "../part";
import { level } from "../state";
import { Button, Check, count, NumberField, Section, SelectField } from "../ui/controls";
import { angleLimit, brushRadius, currentViewport, selected, tool, visibleOnly } from "../viewport/place";
import { deleteSelected } from "./edits";
import { gridOf } from "./state";

export function SelectionPanel() {
  void shape.value;
  const view = currentViewport();
  const none = selected.value === 0;
  return (
    <Section title="Selection">
      <div class="row apart selected">
        <span aria-live="polite">
          <span class="big" data-testid="selected">
            {count(selected.value)}
          </span>{" "}
          <span class="quiet">of {count(figures.value?.faces ?? 0)} triangles</span>
        </span>
        <Button
          kind="danger"
          icon="trash"
          keys="Del"
          label="Delete what is selected"
          disabled={none}
          onClick={() => void deleteSelected()}
        >
          Delete
        </Button>
      </div>
      <div class="grid-3">
        <Button small label="Add one row of triangles" keys="+" disabled={none} onClick={() => view?.grow()}>
          Grow
        </Button>
        <Button small label="Remove one row of triangles" keys="-" disabled={none} onClick={() => view?.shrink()}>
          Shrink
        </Button>
        <Button small label="What is not selected" keys="Ctrl+I" onClick={() => view?.invert()}>
          Invert
        </Button>
        <Button small label="Everything" keys="Ctrl+A" onClick={() => view?.selectAll()}>
          All
        </Button>
        <Button small label="Nothing" keys="Esc" disabled={none} onClick={() => view?.clearSelection()}>
          None
        </Button>
        <Button small label="See the selection" keys="F" disabled={none} onClick={() => view?.fit(true)}>
          Zoom
        </Button>
      </div>
      <Check
        label="Visible surface only"
        keys="N"
        checked={visibleOnly.value}
        onChange={(on) => (visibleOnly.value = on)}
      />
      {(tool.value === "brush" || tool.value === "smooth") && (
        <NumberField
          label="Brush"
          value={brushRadius.value}
          unit="px"
          min={3}
          max={300}
          onChange={(value) => (brushRadius.value = value ?? 24)}
        />
      )}
      {tool.value === "angle" && (
        <NumberField
          label="Up to an edge of"
          value={angleLimit.value}
          unit="°"
          min={1}
          max={180}
          onChange={(value) => (angleLimit.value = value ?? 20)}
        />
      )}
    </Section>
  );
}

type By = "laser" | "steps" | "sigma" | "quality" | "cause" | "measured";
const BY: readonly (readonly [By, string])[] = [
  ["laser", "laser"],
  ["steps", "steps"],
  ["sigma", "uncertainty"],
  ["quality", "quality mark"],
  ["cause", "cause of a gap"],
  ["measured", "not measured"],
];

/** Selecting by provenance: for people who know what the words mean. */
export function SelectByPanel() {
  const [by, setBy] = useState<By>("sigma");
  const [laser, setLaser] = useState(0);
  const [from, setFrom] = useState(0);
  const [to, setTo] = useState(10);
  const [sigma, setSigma] = useState(0.1);
  const [flag, setFlag] = useState("16");
  const [cause, setCause] = useState("1");
  if (level.value === "beginner") return null;
  const causes = grids.value.find((grid) => grid)?.header.causes ?? [];
  const select = async () => {
    if (by === "quality" || by === "cause")
      await Promise.all((opened.value?.grids ?? []).map(({ grid }) => loadGrid(grid)));
    selectBy(by, { laser, from, to, sigma, flag: Number(flag), cause: Number(cause) });
  };
  return (
    <Section title="Select by …" open={false}>
      <SelectField label="By" value={by} options={BY} onChange={setBy} />
      {by === "laser" && (
        <SelectField
          label="Laser"
          value={String(laser)}
          options={lasers.value.map((name, i) => [String(i), name] as const)}
          onChange={(value) => setLaser(Number(value))}
        />
      )}
      {by === "steps" && (
        <>
          <NumberField label="From step" value={from} min={0} step={1} onChange={(value) => setFrom(value ?? 0)} />
          <NumberField label="To step" value={to} min={0} step={1} onChange={(value) => setTo(value ?? 0)} />
        </>
      )}
      {by === "sigma" && (
        <NumberField
          label="Std. uncertainty above"
          value={sigma}
          unit="mm"
          min={0}
          onChange={(value) => setSigma(value ?? 0)}
        />
      )}
      {by === "quality" && (
        <SelectField
          label="Mark"
          value={flag}
          options={FLAGS.map(([bit, word]) => [String(bit), word] as const)}
          onChange={setFlag}
        />
      )}
      {by === "cause" && (
        <SelectField
          label="Beside a gap"
          value={cause}
          options={causes.map((word, i) => [String(i), word] as const).slice(1)}
          onChange={setCause}
        />
      )}
      <Button onClick={() => void select()}>Select</Button>
    </Section>
  );
}

interface Chosen {
  laser: number;
  from: number;
  to: number;
  sigma: number;
  flag: number;
  cause: number;
}

function selectBy(by: By, chosen: Chosen): void {
  const view = currentViewport();
  const model = mesh.value;
  if (!view || !model) return;
  if (by === "measured") {
    view.selectWhere((face) => !model.measured[face], "replace");
    return;
  }
  const takes = vertexRule(by, chosen);
  // A face is taken where most of its corners are.
  view.selectWhere((_, a, b, c) => Number(takes(a)) + Number(takes(b)) + Number(takes(c)) >= 2, "replace");
}

function vertexRule(by: By, chosen: Chosen): (vertex: number) => boolean {
  const model = mesh.value!;
  switch (by) {
    case "laser":
      return (v) => model.laser[v] === chosen.laser;
    case "steps":
      return (v) => model.step[v] >= chosen.from && model.step[v] <= chosen.to;
    case "sigma":
      return (v) => model.sigma[v] > chosen.sigma;
    case "quality":
      return inGrid((grid, row, line) => (grid.flags[row * grid.lines + line] & chosen.flag) !== 0);
    case "cause":
      return inGrid((grid, row, line) => besideGap(grid, row, line, chosen.cause));
    case "measured":
      return () => false;
  }
}

/** A rule over the places of the grids, as one over vertices. */
function inGrid(rule: (grid: Grid, row: number, line: number) => boolean): (vertex: number) => boolean {
  const model = mesh.value!;
  const places = new Map<string, { grid: Grid; row: number } | null>();
  return (v) => {
    if (model.step[v] < 0) return false;
    const key = `${model.laser[v]}/${model.step[v]}`;
    let place = places.get(key);
    if (place === undefined) {
      const grid = grids.value[gridOf(lasers.value[model.laser[v]], model.step[v])];
      place = grid ? { grid, row: grid.row(model.step[v]) } : null;
      places.set(key, place);
    }
    return place !== null && place.row >= 0 && rule(place.grid, place.row, model.line[v]);
  };
}

function besideGap(grid: Grid, row: number, line: number, cause: number): boolean {
  const s = grid.steps.length;
  for (let dr = -1; dr <= 1; dr++) {
    for (let dl = -1; dl <= 1; dl++) {
      const r = grid.header.closed ? (row + dr + s) % s : row + dr;
      const l = line + dl;
      if (r >= 0 && r < s && l >= 0 && l < grid.lines && grid.cause[r * grid.lines + l] === cause) return true;
    }
  }
  return false;
}
