"""What ``turnscan calibrate`` prints of a calibration."""

from __future__ import annotations

import json
import math
from dataclasses import asdict

from turnscan import workflows
from turnscan.cli._words import with_flags
from turnscan.findings import record


def body(done: workflows.CalibratedRig) -> str:
    """Figures, advice and findings as JSON."""
    held = {} if done.figures is None else asdict(done.figures)
    figures = {k: None if v != v else v for k, v in held.items()}  # JSON has no NaN
    found = [record(with_flags(f)) for f in done.findings]
    report = {"figures": figures or None, "advice": asdict(done.advice), "findings": found}
    return json.dumps(report, indent=1, ensure_ascii=False)


def lines(done: workflows.CalibratedRig) -> list[str]:
    """Figures, findings, and what is still open."""
    return [
        *_figures(done),
        *(str(with_flags(f)) for f in done.findings),
        *(f"not calibrated yet: {missing}" for missing in done.advice.undetermined),
        f"would help most: {done.advice.text}",
        f"wrote {done.path}",
    ]


def _figures(done: workflows.CalibratedRig) -> list[str]:
    f, c = done.figures, done.calibration
    if f is None or c is None:
        return ["by ruler alone; no picture was looked at"]
    out = []
    if not math.isnan(f.camera_rms_px):
        out.append(f"camera   {f.camera_rms_px:.3f} px rms over {f.camera_views} board views")
    for laser, views in f.sheet_views.items():
        rms = f"{f.sheet_rms_mm[laser]:.3f} mm rms, {f.sheet_rms_px[laser]:.3f} px"
        out.append(f"sheet    {rms}, over {views} stripes ({laser})")
    if c.network.table:
        out.append(f"table    {f.table_rms_px:.3f} px rms over {len(c.network.table)} pictures")
    if c.stages.held:
        out.append(f"held     {', '.join(c.stages.held)}, by the uncertainty known before")
    for place, u in f.radius_k2_mm.items():
        height = f"height ± {f.height_k2_mm[place]:.2f} mm (k = 2)"
        out.append(f"at radius / height {place} mm: radius ± {u:.2f} mm, {height}")
    return out
