/** Points picked by hand in several poses of a part, by which they are joined. */
import { signal } from "@preact/signals";
import { useEffect, useState } from "preact/hooks";
import { getArrays } from "../link";
import type { MeshModel } from "../mesh/model";
import { residuals } from "../mesh/rigid";
import { modelOf, openScan } from "../part";
import type { MeshHeader, VerbEntry } from "../protocol";
import { complain, scans } from "../state";
import { Button, Section, SelectField, TextField } from "../ui/controls";
import type { Vec } from "../viewport/camera";
import type { Item } from "../viewport/overlay";
import { OwnView } from "./ownview";
import type { Values } from "./schema";
import { additions, formOf, sendTable } from "./state";

/** One point of the part: where it is in each pose, mm. */
export type Picked = ReadonlyMap<string, Vec>;

const NEEDED = 3;
const INK = "#f0691e";
const DIGITS = 3;
const picked = signal<readonly Picked[]>([]);
const shown = signal(false);

const nameOf = (scan: string) => scans.value.find((one) => one.scan === scan)?.name ?? "";
const posesOf = (values: Values) =>
  ((values.sources ?? []) as string[]).filter((file) => scans.value.some(({ scan }) => scan === file));

/** The points with a place more: it belongs to the first that has none in this pose. */
export function withPlace(points: readonly Picked[], pose: string, at: Vec): readonly Picked[] {
  const row = points.findIndex((one) => !one.has(pose));
  if (row < 0) return [...points, new Map([[pose, at]])];
  return points.map((one, k) => (k === row ? new Map(one).set(pose, at) : one));
}

/** Points that are known in two poses or more, as a table: `point,pose,x,y,z`. */
export function csvOf(points: readonly Picked[], poses: readonly (readonly [string, string])[]): string {
  const quoted = (text: string) => (/[",]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const rows = points.flatMap((one, k) => {
    const places = poses.flatMap(([pose, name]) => (one.has(pose) ? [[name, one.get(pose)!] as const] : []));
    if (places.length < 2) return [];
    return places.map(([name, at]) => [k + 1, quoted(name), ...at.map((x) => x.toFixed(DIGITS))].join(","));
  });
  return rows.length ? ["point,pose,x,y,z", ...rows, ""].join("\n") : "";
}

/** What the points become when the poses are joined: a table that is sent; null where it cannot be. */
async function withPoints(values: Values): Promise<Values | null> {
  const csv = csvOf(
    picked.value,
    posesOf(values).map((pose) => [pose, nameOf(pose)] as const),
  );
  if (!csv || values.points) return values;
  const points = await sendTable("picked points.csv", csv);
  return points === null ? null : { ...values, points };
}

/** Give picked points to each joining: once. */
export function startPoints(): void {
  additions.set("join", withPoints);
}

function Pose({ scan, choice }: { scan: string; choice: readonly string[] }) {
  const [mesh, set] = useState<MeshModel | null>(null);
  const [failed, say] = useState("");
  useEffect(() => {
    let left = false;
    set(null);
    say("");
    openScan(scan)
      .then(() => getArrays<MeshHeader>(`api/scans/${scan}/mesh`))
      .then(({ arrays }) => left || set(modelOf(arrays)))
      .catch((error: Error) => {
        if (left) return;
        say(error.message);
        complain(error);
      });
    return () => {
      left = true;
    };
  }, [scan]);
  const items = picked.value.flatMap((one, k): Item[] => {
    const at = one.get(scan);
    return at ? [{ kind: "point", at, colour: INK, label: String(k + 1) }] : [];
  });
  return (
    <div class="pane">
      <header>
        {choice.length > 1 ? (
          <SelectField
            bare
            label="Other pose"
            value={scan}
            options={choice.map((one) => [one, nameOf(one)] as const)}
            onChange={(one) => (other.value = one)}
          />
        ) : (
          <h2>{nameOf(scan)}</h2>
        )}
        <span class="about">{failed || (mesh ? `click point ${next(scan)}` : "Opening …")}</span>
      </header>
      <OwnView
        label={`Pose ${nameOf(scan)}`}
        mesh={mesh}
        items={items}
        onPick={(at) => (picked.value = withPlace(picked.value, scan, at))}
      />
    </div>
  );
}

/** Poses that are shown side by side at most. */
const SIDE_BY_SIDE = 4;
/** Which of the poses that have no place of their own is in the last one. */
const other = signal("");

/** The poses that are shown, and those among which the last of them is chosen: none where all are. */
export function sideBySide(poses: readonly string[], last: string): { shown: string[]; choice: string[] } {
  if (poses.length <= SIDE_BY_SIDE) return { shown: [...poses], choice: [] };
  const fixed = poses.slice(0, SIDE_BY_SIDE - 1);
  const choice = poses.slice(SIDE_BY_SIDE - 1);
  return { shown: [...fixed, choice.includes(last) ? last : choice[0]], choice };
}

function next(scan: string): number {
  const row = picked.value.findIndex((one) => !one.has(scan));
  return (row < 0 ? picked.value.length : row) + 1;
}

const written = (at: Vec | undefined) => at?.map((x) => x.toFixed(DIGITS)).join(", ") ?? "";

/** A place as it is typed: three numbers; null for anything else. */
export function readPlace(text: string): Vec | null {
  const numbers = text
    .split(/[\s,;]+/)
    .filter(Boolean)
    .map(Number);
  return numbers.length === 3 && numbers.every(Number.isFinite) ? (numbers as Vec) : null;
}

function setPlace(row: number, pose: string, text: string): void {
  const at = readPlace(text);
  picked.value = picked.value.map((one, k) => {
    if (k !== row || (text && !at)) return one;
    const changed = new Map(one);
    if (at) changed.set(pose, at);
    else changed.delete(pose);
    return changed;
  });
}

/** mm: how far each point is off in two poses when one is moved onto the other, by the row. */
export function misfits(points: readonly Picked[], one: string, other: string): ReadonlyMap<number, number> {
  const rows = points.flatMap((point, row) => (point.has(one) && point.has(other) ? [row] : []));
  if (rows.length < NEEDED) return new Map();
  const off = residuals(
    rows.map((row) => points[row].get(one)!),
    rows.map((row) => points[row].get(other)!),
  );
  return new Map(rows.map((row, k) => [row, off[k]]));
}

/** Of each pose that shares enough points with one before it: that one, and how far each is off. */
export function fitsOf(points: readonly Picked[], poses: readonly string[]): readonly FitOf[] {
  return poses.flatMap((pose, k) => {
    for (const to of poses.slice(0, k)) {
      const off = misfits(points, to, pose);
      if (off.size) return [{ pose, to, off }];
    }
    return [];
  });
}

interface FitOf {
  pose: string;
  /** The first one that it shares enough points with. */
  to: string;
  /** mm by the row */
  off: ReadonlyMap<number, number>;
}

function PointRows({ poses }: { poses: readonly string[] }) {
  const fits = fitsOf(picked.value, poses);
  return (
    <ul class="list whole points" aria-label="Picked points">
      {picked.value.map((one, row) => (
        <li key={row}>
          <strong class="num">{row + 1}</strong>
          {fits.map(
            ({ pose, off }) =>
              off.has(row) && (
                <span key={pose} class="num" title="Distance between the two places when the poses are moved together">
                  {poses.length > 2 && `${nameOf(pose)} `}off {off.get(row)!.toFixed(2)} mm
                </span>
              ),
          )}
          {poses.map((pose) => (
            <TextField
              key={pose}
              label={nameOf(pose)}
              value={written(one.get(pose))}
              unit="mm"
              placeholder="x, y, z"
              onChange={(text) => setPlace(row, pose, text)}
            />
          ))}
          <Button
            kind="plain"
            small
            icon="trash"
            label={`Delete point ${row + 1}`}
            onClick={() => (picked.value = picked.value.filter((_, k) => k !== row))}
          />
        </li>
      ))}
    </ul>
  );
}

/** How well the picked points fit, before anything is joined: of each pose to one before it. */
function Fit({ poses }: { poses: readonly string[] }) {
  const fits = fitsOf(picked.value, poses).map(({ pose, to, off }) => {
    const all = [...off];
    const rms = Math.sqrt(all.reduce((sum, [, one]) => sum + one * one, 0) / all.length);
    return { pose, to, rms, worst: all.reduce((a, b) => (b[1] > a[1] ? b : a)) };
  });
  if (!fits.length) return null;
  return (
    <div role="status" aria-label="Fit of the picked points">
      {fits.map(({ pose, to, rms, worst: [row, most] }) => (
        <p key={pose} class="num">
          {poses.length > 2 ? `${nameOf(pose)} on ${nameOf(to)}: the` : "The"} points fit to {rms.toFixed(2)} mm (rms);
          the worst is point {row + 1}, {most.toFixed(2)} mm.
        </p>
      ))}
    </div>
  );
}

/** The poses side by side, in which the same points are clicked. */
export function PickPoints({ verb }: { verb: VerbEntry }) {
  const { values } = formOf(verb);
  const poses = posesOf(values);
  if (poses.length < 2) return null;
  const both = poses.length === 2;
  const views = sideBySide(poses, other.value);
  const whole = picked.value.filter((one) => poses.filter((pose) => one.has(pose)).length > 1).length;
  return (
    <Section title="Picked points" count={whole}>
      <p class="quiet">
        {whole
          ? `Joined by ${whole} picked ${whole === 1 ? "point" : "points"}${whole < NEEDED ? `; at least ${NEEDED} are needed` : ""}, then by shape.`
          : `Joined by shape alone. Where that fails, pick ${NEEDED} points or more that can be seen in ${both ? "both poses" : "two poses or more"}.`}
      </p>
      {values.points ? (
        <p class="remark warning">A table of points is chosen above: it is used, and what is picked here is not.</p>
      ) : null}
      {shown.value ? (
        <>
          <div class="poses">
            {views.shown.map((pose, k) => (
              <Pose key={k} scan={pose} choice={k === SIDE_BY_SIDE - 1 ? views.choice : []} />
            ))}
          </div>
          <Fit poses={poses} />
          <PointRows poses={poses} />
          <span class="row">
            <Button onClick={() => (picked.value = [...picked.value, new Map()])}>Type in a point</Button>
            <Button disabled={!picked.value.length} onClick={() => (picked.value = [])}>
              Delete all points
            </Button>
          </span>
        </>
      ) : (
        <Button onClick={() => (shown.value = true)}>
          {both ? "Pick points in both poses" : "Pick points in the poses"}
        </Button>
      )}
    </Section>
  );
}
