/** What a live picture says of focus, exposure and the stripe. */
import { signal } from "@preact/signals";
import { devices } from "../state";
import { type LivePicture, picture } from "./live";

/** The sharpest picture since live view was started: focus is judged against it. */
const best = signal(0);

/** Forget the sharpest picture: another scene, or another lens setting. */
export function forgetSharpest(): void {
  best.value = 0;
}

const [WIDE, HIGH] = [240, 56];

function polygon(values: ArrayLike<number>, top: number): string {
  const points = Array.from(values, (v, k) => `${(k * WIDE) / (values.length - 1)},${HIGH - (HIGH * v) / top}`);
  return `0,${HIGH} ${points.join(" ")} ${WIDE},${HIGH}`;
}

/** Means of the values in so many parts of the stripe; NaN where a part has none. */
export function alongStripe(values: Float32Array, parts: number): number[] {
  return Array.from({ length: parts }, (_, k) => {
    const from = Math.floor((k * values.length) / parts);
    const some = values.subarray(from, Math.max(from + 1, Math.floor(((k + 1) * values.length) / parts)));
    const there = some.filter((v) => !Number.isNaN(v));
    return there.length ? there.reduce((sum, v) => sum + v, 0) / there.length : Number.NaN;
  });
}

function Along({ title, values, unit }: { title: string; values: Float32Array; unit: string }) {
  const shown = alongStripe(values, 80);
  const there = shown.filter((v) => !Number.isNaN(v));
  if (!there.length) return null;
  const top = 1.1 * Math.max(...there);
  const middle = [...there].sort((a, b) => a - b)[Math.floor(there.length / 2)];
  return (
    <figure class="meter">
      <figcaption class="row apart">
        {title}
        <span class="num">
          {middle.toFixed(1)} {unit}
        </span>
      </figcaption>
      <svg
        viewBox={`0 0 ${WIDE} ${HIGH}`}
        role="img"
        aria-label={`${title}: ${middle.toFixed(1)} ${unit} in the middle`}
      >
        {shown.map(
          (v, k) =>
            !Number.isNaN(v) && (
              <rect
                key={k}
                x={(k * WIDE) / 80}
                width={WIDE / 80}
                y={HIGH - (HIGH * v) / top}
                height={(HIGH * v) / top}
              />
            ),
        )}
      </svg>
    </figure>
  );
}

function Histogram({ now }: { now: LivePicture }) {
  // Most pixels of a laser picture are black: the root shows the others, too.
  const roots = Array.from(now.histogram, (n) => Math.sqrt(n));
  const clipped = 100 * now.header.clipped;
  const words = clipped < 0.05 ? "nothing clipped" : `${clipped.toFixed(1)} % of the picture clipped`;
  return (
    <figure class="meter">
      <figcaption class="row apart">
        Exposure
        <span>{words}</span>
      </figcaption>
      <svg viewBox={`0 0 ${WIDE} ${HIGH}`} role="img" aria-label={`Histogram of grey levels, black to white: ${words}`}>
        <polygon points={polygon(roots, Math.max(...roots, 1))} />
      </svg>
    </figure>
  );
}

export function Meters() {
  const now = picture.value;
  if (!now || !devices.value?.looking) return null;
  const { sharpness, lit, saturated } = now.header;
  const angle = devices.value.angle_deg;
  if (sharpness > best.peek()) best.value = sharpness;
  const share = best.value > 0 ? sharpness / best.value : 0;
  return (
    <div class="meters" aria-label="What the live picture says" role="group">
      <figure class="meter">
        <figcaption class="row apart">
          Focus
          <span class="num">{Math.round(100 * share)} % of the sharpest seen</span>
        </figcaption>
        <meter min={0} max={1} low={0.6} high={0.9} optimum={1} value={share} aria-label="Focus" />
      </figure>
      <Histogram now={now} />
      <dl class="facts">
        {lit.length > 0 && (
          <>
            <dt>Stripe clipped</dt>
            <dd>{(100 * saturated).toFixed(0)} % of its lines</dd>
          </>
        )}
        <dt>Table angle</dt>
        <dd>{angle === null ? "not known" : `${angle.toFixed(2)}°`}</dd>
      </dl>
      {lit.length > 0 && <Along title="Stripe width (rms)" values={now.width} unit="px" />}
      {lit.length > 0 && <Along title="Stripe signal" values={now.signal} unit="grey levels" />}
    </div>
  );
}
