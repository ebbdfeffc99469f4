/** The key of a map of distances: its colours, what it ends at, and what has none. */
import { css, mapOf } from "../mesh/colours";
import { figure } from "../ui/controls";

const STOPS = [0, 0.17, 0.33, 0.5, 0.67, 0.83, 1];

/** `end` is in mm, `from` what the distances are from. */
export function MapKey({ end, from }: { end: number; from: string }) {
  const ramp = `linear-gradient(90deg, ${STOPS.map((t) => css(mapOf("deviation")(t))).join(",")})`;
  return (
    <>
      <span>
        −{figure(end, 3)} mm{" "}
        <span class="ramp" style={{ background: ramp, display: "inline-block", width: "90px", height: "9px" }} /> +
        {figure(end, 3)} mm
      </span>
      <span>from {from}; violet: nothing there</span>
    </>
  );
}
