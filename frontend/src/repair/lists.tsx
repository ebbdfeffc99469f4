/** Holes and defects. */
import { useSignal, useSignalEffect } from "@preact/signals";
import { defects, type Hole, holeCount, holes, listDefects, listHoles, listsAreOld, opened } from "../part";
import { Button, count, mm, NumberField, Section, SelectField } from "../ui/controls";
import { currentViewport } from "../viewport/place";
import { apply, bridgeValue, chosenHoleList, FILL_HOW, type FillHow, fillValue, show } from "./edits";
import { chosenHoles, markPlace, preview } from "./state";

function zoomTo(hole: Hole): void {
  chosenHoles.value = new Set([hole.hole]);
  currentViewport()?.lookAt(hole.centre, Math.max(hole.size, 4));
}

function toggle(hole: Hole, on: boolean): void {
  const next = new Set(chosenHoles.value);
  if (on) next.add(hole.hole);
  else next.delete(hole.hole);
  chosenHoles.value = next;
}

export function HolesPanel() {
  const how = useSignal<FillHow>("auto");
  const below = useSignal<number | null>(10);
  useSignalEffect(() => {
    if (!opened.value || !listsAreOld.value) return;
    listsAreOld.value = false;
    void listHoles();
    void listDefects();
  });
  const list = holes.value;
  const chosen = chosenHoleList();
  return (
    <>
      <Section title="Holes" count={list ? count(holeCount.value) : "…"}>
        {list?.length === 0 && <p class="quiet">The surface is closed.</p>}
        <ul class="list" aria-label="Holes, the largest first">
          {list?.map((hole) => (
            <li key={hole.hole} class={chosenHoles.value.has(hole.hole) ? "current" : ""}>
              <input
                type="checkbox"
                aria-label={`Choose hole ${hole.hole + 1}`}
                checked={chosenHoles.value.has(hole.hole)}
                onChange={(event) => toggle(hole, event.currentTarget.checked)}
              />
              <button type="button" class="button plain grow" title="Zoom to this hole" onClick={() => zoomTo(hole)}>
                <span class="num">{mm(hole.size)}</span>
                <span class="quiet">{hole.cause_text}</span>
              </button>
            </li>
          ))}
        </ul>
        {list && list.length < holeCount.value && (
          <>
            <p class="quiet">
              The {count(list.length)} largest are listed; “All up to a size of” also takes those that are not.
            </p>
            <Button onClick={() => void listHoles(true)}>List more</Button>
          </>
        )}
        <SelectField label="Fill" value={how.value} options={FILL_HOW} onChange={(value) => (how.value = value)} />
        <div class="grid-2">
          <Button disabled={!chosen.length} onClick={() => void show(fillValue(chosen, how.value, null))}>
            Preview
          </Button>
          <Button
            kind={preview.value?.of === "fill" ? "primary" : undefined}
            disabled={!chosen.length}
            onClick={() => void apply(fillValue(chosen, how.value, null))}
          >
            {chosen.length > 1 ? `Fill ${chosen.length} holes` : "Fill"}
          </Button>
        </div>
        {chosen.length === 2 && (
          <Button
            label="Join the boundaries of the two chosen holes by a bridge"
            onClick={() => void apply(bridgeValue(chosen, how.value))}
          >
            Bridge the two
          </Button>
        )}
        <NumberField
          label="All up to a size of"
          value={below.value}
          unit="mm"
          min={0.01}
          placeholder="any"
          onChange={(value) => (below.value = value)}
        />
        <div class="grid-2">
          <Button disabled={!list?.length} onClick={() => void show(fillValue(null, how.value, below.value))}>
            Preview all
          </Button>
          <Button disabled={!list?.length} onClick={() => void apply(fillValue(null, how.value, below.value))}>
            Fill all
          </Button>
        </div>
        {preview.value && (
          <Button kind="plain" onClick={() => (preview.value = null)}>
            Discard the preview
          </Button>
        )}
      </Section>
      <DefectsPanel />
    </>
  );
}

const SEVERITY = { error: 0, warning: 1, note: 2 };

function DefectsPanel() {
  const list = defects.value?.toSorted((a, b) => SEVERITY[a.remark.severity] - SEVERITY[b.remark.severity]);
  return (
    <Section title="Findings" count={list?.length ?? "…"}>
      {list?.length === 0 && <p class="quiet">No findings.</p>}
      <ul class="list" aria-label="Findings on the scan">
        {list?.map(({ remark, place, grid, step, line }, i) => (
          <li key={i}>
            <span
              class={`dot ${remark.severity === "error" ? "bad" : remark.severity === "warning" ? "busy" : ""}`}
              title={remark.severity}
            />
            <button
              type="button"
              class="button plain grow"
              title={remark.remedy}
              onClick={() => {
                if (place) currentViewport()?.lookAt(place, 20);
                if (grid !== null && step !== null) void markPlace(grid, step, line ?? 0, !place);
              }}
            >
              <span>
                {remark.text}
                {remark.remedy && <span class="quiet"> {remark.remedy}</span>}
              </span>
            </button>
          </li>
        ))}
      </ul>
    </Section>
  );
}
