/** The views of the Rig and Scan rooms. */
import { effect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { css } from "../mesh/colours";
import { DISTINCT } from "../palette";
import { devices, theme } from "../state";
import { count } from "../ui/controls";
import { CloudView } from "./cloud";
import { cloud, cloudSize, isScanning, picture } from "./live";
import { LiveView } from "./picture";

export function LivePane({ empty }: { empty: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const view = new LiveView(canvas.current!);
    const off = effect(() => {
      void theme.value;
      view.show(picture.value);
    });
    return () => {
      off();
      view.dispose();
    };
  }, []);
  const now = picture.value;
  const failed = [devices.value?.camera, devices.value?.table].find((device) => device?.state === "failed");
  const seen = now ? now.stripe.reduce((n, at) => n + Number(!Number.isNaN(at)), 0) : 0;
  return (
    <section class="pane live" aria-label="Camera">
      <header>
        <h2>Camera</h2>
        {now && (
          <span class="about">
            {!devices.value?.looking && !isScanning() && "last picture · "}
            {now.header.width} × {now.header.height}
            {now.header.step !== null && ` · step ${now.header.step}`}
            {now.header.lit.length
              ? ` · ${now.header.lit.join(" + ")} lit · stripe in ${count(seen)} lines`
              : " · lasers dark"}
            {now.header.saturated > 0.02 && ` · ${Math.round(100 * now.header.saturated)} % clipped: expose shorter`}
          </span>
        )}
      </header>
      <div class="stage">
        <canvas ref={canvas} aria-label="Live picture with the stripe that was found" role="img" />
        {failed ? <Failed text={failed.text} /> : !now && <div class="empty">{empty}</div>}
      </div>
    </section>
  );
}

/** A device that is gone, over the last picture it gave. */
function Failed({ text }: { text: string }) {
  return (
    <div class="empty failed" role="alert">
      <strong>{text}</strong>
      <span>The lasers were switched off. Check cable and power, then connect again.</span>
    </div>
  );
}

export function CloudPane() {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const view = new CloudView(canvas.current!);
    const off = effect(() => {
      void cloudSize.value;
      view.show(cloud.value);
    });
    return () => {
      off();
      view.dispose();
    };
  }, []);
  const n = cloudSize.value;
  return (
    <section class="pane cloud" aria-label="Points">
      <header>
        <h2>Points</h2>
        <span class="about">{n > 0 && count(n)}</span>
      </header>
      <div class="stage">
        <canvas ref={canvas} tabIndex={0} aria-label="Points so far; the arrow keys turn them" role="img" />
        {n === 0 && <div class="empty">Points appear here while the scan runs.</div>}
      </div>
      {n > 0 && (
        <div class="key">
          {cloud.value.lasers.map((laser, k) => (
            <span key={laser}>
              <span class="swatch" style={{ background: css(DISTINCT[k % DISTINCT.length]) }} />
              {laser}
            </span>
          ))}
        </div>
      )}
    </section>
  );
}
