/** A plane: its direction as two angles, how far the part reaches along it, and the fields of it. */
import { mesh } from "../part";
import type { Vec } from "../viewport/camera";
import type { CutPlane } from "../viewport/surface";
import { NumberField } from "./controls";

const DEGREE = Math.PI / 180;

/** The direction of the normal: azimuth about z from x, and height above the horizontal. */
function angles(n: Vec): [number, number] {
  return [Math.atan2(n[1], n[0]) / DEGREE, Math.atan2(n[2], Math.hypot(n[0], n[1])) / DEGREE];
}

function normalOf(azimuth: number, height: number): Vec {
  const c = Math.cos(height * DEGREE);
  return [c * Math.cos(azimuth * DEGREE), c * Math.sin(azimuth * DEGREE), Math.sin(height * DEGREE)];
}

/** How far the part reaches along a direction, mm from the origin. */
export function reach(normal: Vec): [number, number] {
  const box = mesh.value?.bounds();
  if (!box) return [0, 0];
  const ends = normal.map((n, i) => [n * box.low[i], n * box.high[i]]);
  const low = ends.reduce((sum, [a, b]) => sum + Math.min(a, b), 0);
  const high = ends.reduce((sum, [a, b]) => sum + Math.max(a, b), 0);
  return [low, high];
}

/** A plane across a direction, at a share of the part above its lowest place in it. */
export function across(normal: Vec, share: number): CutPlane {
  const [low, high] = reach(normal);
  return { normal, offset: low + share * (high - low) };
}

/** A plane by numbers: its distance from the origin, and the direction of its normal. */
export function PlaneFields({ at, onChange }: { at: CutPlane; onChange: (plane: CutPlane) => void }) {
  const [azimuth, height] = angles(at.normal);
  const turned = (a: number, h: number) => onChange({ ...at, normal: normalOf(a, h) });
  return (
    <>
      <NumberField
        label="Distance from the origin"
        value={at.offset}
        unit="mm"
        onChange={(mm) => onChange({ ...at, offset: mm ?? 0 })}
      />
      <NumberField
        label="Azimuth of its normal"
        value={azimuth}
        unit="°"
        min={-180}
        max={360}
        onChange={(a) => turned(a ?? 0, height)}
      />
      <NumberField
        label="Height of its normal"
        value={height}
        unit="°"
        min={-90}
        max={90}
        onChange={(h) => turned(azimuth, h ?? 0)}
      />
    </>
  );
}
