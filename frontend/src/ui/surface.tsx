/** The surface, for every room that shows it. */
import { useSignalEffect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { Command } from "../commands";
import { css, mapOf, TOUCHES, UNMEASURED } from "../mesh/colours";
import { DISTINCT } from "../palette";
import { type FirstLook, firstSurface, lasers, loading, mesh } from "../part";
import { jobs, place, theme } from "../state";
import { VIEWS, type ViewName } from "../viewport/camera";
import { colouring, currentViewport, drawable, legend, showIn } from "../viewport/place";
import { figure } from "./controls";
import { left } from "./frame";

const KEYS: Record<ViewName, string> = {
  front: "1",
  back: "2",
  left: "3",
  right: "4",
  top: "5",
  bottom: "6",
  corner: "7",
};

/** Ways to look at the surface, for every room that shows it. */
export const viewCommands: readonly Command[] = [
  { title: "See the selection", group: "View", keys: "F", run: () => currentViewport()?.fit(true) },
  { title: "See everything", group: "View", keys: "Shift+F", run: () => currentViewport()?.fit() },
  ...(Object.keys(VIEWS) as ViewName[]).map((name) => ({
    title: `Look from the ${name}`,
    group: "View",
    keys: KEYS[name],
    run: () => currentViewport()?.view(name),
  })),
  { title: "Perspective or parallel", group: "View", keys: "O", run: () => currentViewport()?.toggleOrthographic() },
];

export function SurfaceView() {
  const ref = useRef<HTMLDivElement>(null);
  useEffect(() => {
    showIn(ref.current!);
  }, []);
  useSignalEffect(() => {
    void theme.value;
    requestAnimationFrame(() => currentViewport()?.restyle());
  });
  return (
    <div class="stage" ref={ref} style={{ height: "100%" }}>
      {drawable.value === false && <NoWebGL />}
      <Legend />
      <Busy />
    </div>
  );
}

/** A clear word where the browser cannot draw 3-D; everything else goes on working. */
export function NoWebGL() {
  return (
    <div class="empty" role="alert" style={{ pointerEvents: "auto" }}>
      <strong>This browser cannot draw in 3-D (no WebGL 2).</strong>
      <span>
        Switch hardware acceleration on in the browser's settings, or use a current Chrome, Edge, Firefox or Safari.
        <br />
        Profile, picture, scan grid, lists and history work all the same.
      </span>
    </div>
  );
}

function Legend() {
  const by = colouring.value;
  const range = legend.value;
  if (by === "plain" || by === "shapes" || !mesh.value) return null;
  if (range) {
    const ramp = `linear-gradient(90deg, ${[0, 0.17, 0.33, 0.5, 0.67, 0.83, 1].map((t) => css(mapOf(by)(t))).join(",")})`;
    return (
      <div class="legend">
        {by === "sigma" ? "uncertainty" : by} {figure(range.low, 3)}
        <span class="ramp" style={{ background: ramp }} />
        {figure(range.high, 3)} {range.unit}
      </div>
    );
  }
  if (by === "edits") {
    return (
      <div class="legend">
        {TOUCHES.map(([colour, word]) => (
          <span key={word} class="row">
            <span class="swatch" style={{ background: css(colour) }} />
            {word}
          </span>
        ))}
      </div>
    );
  }
  const names = by === "laser" ? lasers.value : ["measured"];
  return (
    <div class="legend">
      {names.map((name, i) => (
        <span key={name} class="row">
          <span
            class="swatch"
            style={{ background: by === "laser" ? css(DISTINCT[i % DISTINCT.length]) : "#b2bbc7" }}
          />
          {name}
        </span>
      ))}
      <span class="row">
        <span class="swatch" style={{ background: css(UNMEASURED) }} />
        not measured
      </span>
    </div>
  );
}

function Busy() {
  if (!loading.value) return null;
  // How far the opening is stands in the status line.
  if (firstSurface.value)
    return (
      <p class="first-look" role="status">
        {firstWords(firstSurface.value)}
      </p>
    );
  const job = [...jobs.value.values()].find(
    ({ what, scan, state }) => what === "open" && scan === place.value.scan && state === "running",
  );
  return (
    <div class="busy-veil" role="status">
      <span class="spinner" />
      {job ? job.title : loading.value}
      {job?.total && <progress max={job.total} value={job.done} aria-label={job.title} />}
      {job && job.seconds_left !== null && <span class="quiet num">{left(job.seconds_left)}</span>}
    </div>
  );
}

function firstWords({ every, edits }: FirstLook): string {
  const some = every === 1 ? "Preview, as scanned" : `Preview of one profile in ${every}, as scanned`;
  if (!edits) return `${some}; the whole surface follows.`;
  return `${some}; the whole surface and ${edits === 1 ? "its repair" : `its ${edits} repairs`} follow.`;
}
