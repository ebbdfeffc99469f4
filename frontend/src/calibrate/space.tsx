/** Where the board was held, seen from above and from the side: what is covered of the space before the camera. */
import type { CalibrationView } from "../protocol";
import { progress } from "./state";

const WIDTH = 220;
const HEIGHT = 130;
const MARGIN = 8;
const STAGES: readonly (readonly [CalibrationView["stage"], string])[] = [
  ["camera", "board"],
  ["laser", "board with a stripe"],
];

interface Placed {
  /** Four numbers each: x, y, z mm and the number of the view. */
  corners: Float32Array;
  reach: readonly number[];
  /** Its middle and its direction; empty where it is not known. */
  axis: readonly number[];
}

/** Nearest and farthest corner, mm; null where there is none. */
export function depths(corners: Float32Array): readonly [number, number] | null {
  let [near, far] = [Infinity, 0];
  for (let k = 2; k < corners.length; k += 4) {
    near = Math.min(near, corners[k]);
    far = Math.max(far, corners[k]);
  }
  return far > 0 ? [near, far] : null;
}

/** The corners of some views as dots of a path: distance to the right, `across` (0: x, 1: y) downwards. */
export function dots(corners: Float32Array, across: 0 | 1, of: ReadonlySet<number>, scale: number): string {
  let path = "";
  for (let k = 0; k < corners.length; k += 4) {
    if (!of.has(corners[k + 3])) continue;
    const [x, y] = [corners[k + 2] * scale, corners[k + across] * scale];
    path += `M${x.toFixed(1)} ${y.toFixed(1)}h0`;
  }
  return path;
}

function Side({
  title,
  across,
  placed,
  views,
}: {
  title: string;
  across: 0 | 1;
  placed: Placed;
  views: readonly CalibrationView[];
}) {
  const { corners, reach, axis } = placed;
  const range = depths(corners)!;
  const beyond = 1.15 * Math.max(range[1], axis.length ? axis[2] : 0);
  const half = reach[across] * beyond;
  // Both ways to one scale, as it is in space.
  const scale = Math.min((WIDTH - 2 * MARGIN) / beyond, (HEIGHT / 2 - MARGIN) / half);
  const end = beyond * scale;
  const open = half * scale;
  const along = axis.length ? [axis[5], axis[3 + across]] : [];
  const seen = `boards from ${range[0].toFixed(0)} to ${range[1].toFixed(0)} mm before the camera`;
  return (
    <figure class="space">
      <svg viewBox={`${-MARGIN} ${-HEIGHT / 2} ${WIDTH} ${HEIGHT}`} role="img" aria-label={`${title}: ${seen}`}>
        <path class="sight" d={`M${end} ${-open}L0 0L${end} ${open}`} />
        <rect class="eye" x={-6} y={-4} width={8} height={8} />
        {STAGES.map(([stage]) => {
          const own = new Set(views.filter((view) => view.stage === stage).map(({ view }) => view));
          return <path key={stage} class={`seen ${stage}`} d={dots(corners, across, own, scale)} />;
        })}
        {axis.length > 0 && (
          <path
            class="axis"
            d={`M${axis[2] * scale} ${axis[across] * scale}l${along[0] * 60 * scale} ${along[1] * 60 * scale}`}
          />
        )}
        {axis.length > 0 && <circle class="axis" cx={axis[2] * scale} cy={axis[across] * scale} r={4} />}
      </svg>
      <figcaption>{title}</figcaption>
    </figure>
  );
}

/** Both sides of it, once an adjustment says where the boards were. */
export function SpacePane() {
  const now = progress.value;
  const range = now && depths(now.placed);
  if (!now || !range || now.header.reach.length < 2) return null;
  const placed = { corners: now.placed, reach: now.header.reach, axis: now.header.axis };
  return (
    <div class="spaces">
      <Side title="From above" across={0} placed={placed} views={now.header.views} />
      <Side title="From the side" across={1} placed={placed} views={now.header.views} />
      <div class="about-space">
        <p>
          Boards were {range[0].toFixed(0)} to {range[1].toFixed(0)} mm before the camera.
        </p>
        {STAGES.map(([stage, words]) => (
          <span key={stage}>
            <span class={`swatch ${stage}`} />
            {words}
          </span>
        ))}
        {placed.axis.length > 0 && (
          <span>
            <span class="swatch axis" />
            axis of the table
          </span>
        )}
      </div>
    </div>
  );
}
