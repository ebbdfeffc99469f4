/** The marked point: what was measured there, what else it could be, and the profile it is in. */
import { useSignal } from "@preact/signals";
import { flagWords } from "../grid/data";
import { mark, profile } from "../part";
import { level } from "../state";
import { Button, Check, mm, NumberField, Section, SelectField } from "../ui/controls";
import { deletePoints, detectAgain, pickCandidate, placePoint, switchProfilesOff } from "./edits";
import { gridShown, lines, markedGrid, range, stepMark, wholePiece } from "./state";

const NUDGE = 0.25;

export function PointPanel() {
  const at = mark.value;
  if (!at) {
    return (
      <Section title="Point">
        <p class="quiet">
          Click a point on the surface, in the profile, in the picture or in the scan grid: all views show it.
        </p>
      </Section>
    );
  }
  return (
    <>
      <Section title="Point">
        <Facts />
        {at.step >= 0 && (
          <div class="grid-2">
            <Button small icon="left" label="Profile before" keys="PgUp" onClick={() => void stepMark(-1, 0)}>
              Step −1
            </Button>
            <Button small icon="right" label="Profile after" keys="PgDn" onClick={() => void stepMark(1, 0)}>
              Step +1
            </Button>
            <Button small label="Line above" keys="Up" onClick={() => void stepMark(0, -1)}>
              Line −1
            </Button>
            <Button small label="Line below" keys="Down" onClick={() => void stepMark(0, 1)}>
              Line +1
            </Button>
          </div>
        )}
      </Section>
      {at.step >= 0 && <Candidates />}
      {at.step >= 0 && <ProfilePanel />}
      {at.step >= 0 && <DetectPanel key={`${at.grid}`} />}
    </>
  );
}

function Facts() {
  const at = mark.value!;
  const grid = markedGrid.value;
  const row = grid ? grid.row(at.step) : -1;
  const i = grid && row >= 0 ? row * grid.lines + at.line : -1;
  const point = (i >= 0 && grid ? grid.point(row, at.line) : null) ?? at.point;
  return (
    <dl class="facts">
      {point && (
        <>
          <dt>x · y · z, mm</dt>
          <dd>{point.map((x) => x.toFixed(2)).join(" · ")}</dd>
          <dt>Radius</dt>
          <dd>{mm(Math.hypot(point[0], point[1]))}</dd>
        </>
      )}
      {at.step < 0 && (
        <>
          <dt>Measured</dt>
          <dd>no: this face closes a gap</dd>
        </>
      )}
      {grid && i >= 0 && (
        <>
          <dt>Laser, step, line</dt>
          <dd data-testid="place">
            {grid.header.laser}, {at.step}, {at.line}
          </dd>
          <dt>Std. uncertainty</dt>
          <dd>{Number.isNaN(grid.sigma[i]) ? "–" : `${(1000 * grid.sigma[i]).toFixed(1)} µm`}</dd>
          <dt>Stripe brightness</dt>
          <dd>{Number.isNaN(grid.amplitude[i]) ? "–" : grid.amplitude[i].toFixed(0)}</dd>
          <dt>Quality</dt>
          <dd>{flagWords(grid.flags[i]) || "good"}</dd>
          {grid.cause[i] > 0 && (
            <>
              <dt>Missing because</dt>
              <dd>{grid.header.causes[grid.cause[i]]}</dd>
            </>
          )}
        </>
      )}
    </dl>
  );
}

function Candidates() {
  const at = mark.value!;
  const shown = profile.value?.step === at.step && profile.value.grid === at.grid ? profile.value : null;
  if (!shown || at.line < 0) return null;
  const list = shown.of(at.line);
  const position = shown.position[at.line];
  const own = shown.chosen[at.line] === -2;
  return (
    <Section title="Candidates in this line" count={list.length}>
      {list.length === 0 && (
        <p class="quiet">
          Nothing above the threshold. A point can be added in the picture (the tool with four arrows).
        </p>
      )}
      <ul class="list" aria-label="Candidates in this line">
        {list.map((candidate) => (
          <li key={candidate.position} class={candidate.chosen && !own ? "current" : ""}>
            <button
              type="button"
              class="button plain grow"
              aria-pressed={candidate.chosen && !own}
              title={candidate.chosen ? "In use" : "Use this one"}
              onClick={() => void pickCandidate(at.line, candidate.position)}
            >
              <span class="num">
                {candidate.position.toFixed(2)} px · {candidate.amplitude.toFixed(0)}
                {candidate.point && (
                  <span class="quiet"> · r {Math.hypot(candidate.point[0], candidate.point[1]).toFixed(2)} mm</span>
                )}
              </span>
            </button>
          </li>
        ))}
      </ul>
      {list.length > 1 && (
        <Check label="The whole stripe segment" checked={wholePiece.value} onChange={(on) => (wholePiece.value = on)} />
      )}
      {own && <p class="quiet">In use: a place set by hand, {position.toFixed(2)} px.</p>}
      {!Number.isNaN(position) && (
        <>
          <NumberField
            label="Place in the picture"
            value={position}
            unit="px"
            min={0}
            onChange={(value) => value !== null && void placePoint(at.line, value)}
          />
          <div class="grid-2">
            <Button small keys="Shift+Left" label={`${NUDGE} px to the left`} onClick={() => nudge(-1)}>
              ← {NUDGE} px
            </Button>
            <Button small keys="Shift+Right" label={`${NUDGE} px to the right`} onClick={() => nudge(1)}>
              {NUDGE} px →
            </Button>
          </div>
        </>
      )}
    </Section>
  );
}

/** Move the marked point a little across the stripe. */
export function nudge(sign: number): void {
  const at = mark.value;
  const position = at && profile.value ? profile.value.position[at.line] : NaN;
  if (at && !Number.isNaN(position)) void placePoint(at.line, position + sign * NUDGE);
}

function ProfilePanel() {
  const at = mark.value!;
  const n = lines.value.length;
  const steps = range.value && gridShown.value === at.grid ? range.value.steps : ([at.step, at.step] as const);
  const many = steps[1] !== steps[0];
  return (
    <Section title="Profile">
      <div class="grid-2">
        <Button
          icon="trash"
          kind="danger"
          label={n ? "Delete the points chosen in the profile" : "Delete this point"}
          onClick={() => void deletePoints()}
        >
          {n ? `${n} points` : "Point"}
        </Button>
        <Button
          label="Disable the profile, or all steps selected in the grid"
          onClick={() => void switchProfilesOff(steps)}
        >
          {many ? `Steps ${steps[0]}–${steps[1]} off` : "Profile off"}
        </Button>
      </div>
      <p class="quiet">Drag a box in the profile to choose points, in the grid to choose steps and lines.</p>
    </Section>
  );
}

const STRATEGIES = ["window", "maximum", "centroid", "median", "parabola", "gauss3", "squared", "blais-rioux"];
const CHOICES = [
  ["", "as before"],
  ["brightest", "brightest"],
  ["first", "leftmost or topmost"],
  ["last", "rightmost or lowest"],
  ["nearest", "nearest to the adjacent lines"],
] as const;
const asOptions = (names: readonly string[]) => [
  ["", "as before"] as const,
  ...names.map((name) => [name, name] as const),
];

/** Seek the stripe again in a part of the grid. */
function DetectPanel() {
  const at = mark.value!;
  const threshold = useSignal<number | null>(null);
  const strategy = useSignal("");
  const choose = useSignal("");
  const grid = markedGrid.value;
  const chosen = range.value && gridShown.value === at.grid ? range.value : null;
  const steps = chosen?.steps ?? ([at.step, at.step] as const);
  const inLines = chosen?.lines ?? ([0, (grid?.lines ?? 1) - 1] as const);
  return (
    <Section title="Detect again" open={level.value === "expert"}>
      <p class="quiet num">
        Steps {steps[0]}–{steps[1]}, lines {inLines[0]}–{inLines[1]}
        {chosen ? "" : ": the whole profile"}
      </p>
      <NumberField
        label="Threshold"
        value={threshold.value}
        min={0.1}
        max={65535}
        placeholder="as before"
        onChange={(value) => (threshold.value = value)}
      />
      <SelectField
        label="Strategy"
        value={strategy.value}
        options={asOptions(STRATEGIES)}
        onChange={(value) => (strategy.value = value)}
      />
      <SelectField
        label="If several stripes"
        value={choose.value}
        options={CHOICES}
        onChange={(value) => (choose.value = value)}
      />
      <Button
        onClick={() =>
          void detectAgain({
            steps,
            lines: inLines,
            threshold: threshold.value,
            strategy: strategy.value || null,
            choose: choose.value || null,
          })
        }
      >
        Detect again
      </Button>
    </Section>
  );
}
