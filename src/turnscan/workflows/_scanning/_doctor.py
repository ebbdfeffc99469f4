"""Doctor: camera, lasers and table are looked over, with a part on it."""

from __future__ import annotations

import json
import math
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from turnscan.findings import findings_json
from turnscan.progress import Progress, no_progress
from turnscan.rig import Rig
from turnscan.scanner import Diagnosis, Opened, examine, verification_findings
from turnscan.workflows._files._reading import read_rig_file
from turnscan.workflows._options._device import DeviceOptions
from turnscan.workflows._options._doctor import DoctorOptions
from turnscan.workflows._scanning._scan import opened_devices

_LOOKS = 30
"""About so many pictures are taken; their number depends on the lasers."""


def doctor(
    devices: DeviceOptions | Opened | None = None,
    options: DoctorOptions | None = None,
    *,
    history: str | Path | None = None,
    rig: Rig | str | Path | None = None,
    progress: Progress = no_progress,
) -> Diagnosis:
    """Take dark pictures and one of each laser, then turn the table once.

    Parameters
    ----------
    devices
        Their addresses, or devices that are open; None takes a simulated rig.
    options
        How they are looked over; None takes the usual exposure.
    history
        The history of `verify`, to say also how old the last verification is.
    rig
        The calibrated rig, or its file: its markers on the platter say whether the table has moved
        since. Without one, the next step is to calibrate; a simulated rig needs none.
    progress
        Told how far it is; it may cancel.

    Returns
    -------
    Diagnosis
        What was measured, what is wrong, the verdict, and the one step to take next.

    Raises
    ------
    FormatError
        Where the history is none, or the rig.
    DeviceError, SafetyError
        As the devices do; the lasers are dark then.
    """
    o = options or DoctorOptions()
    past = []
    if history is not None:
        past = verification_findings(Path(history), time.time(), o.verified_within)
    known = read_rig_file(rig) if isinstance(rig, str | Path) else rig
    tick = progress.counter(_LOOKS, "looking")
    with opened_devices(devices) as bench:
        seen = examine(bench, o.exposure, o.gain, still=o.still, rig=known, tick=tick)
    calibrated = seen.calibrated or known is not None
    return replace(seen, findings=(*seen.findings, *past), calibrated=calibrated)


def diagnosis_json(seen: Diagnosis) -> dict[str, Any]:
    """A diagnosis as a JSON object; NaN is null."""
    return {
        "camera": _plain(asdict(seen.camera)),
        "lasers": [_plain(asdict(laser)) for laser in seen.lasers],
        "table": None if seen.table is None else asdict(seen.table),
        "findings": json.loads(findings_json(seen.findings)),
        "verdict": seen.verdict,
        "next_step": seen.next_step,
    }


def diagnosis_lines(seen: Diagnosis) -> list[str]:
    """What was measured, in words, one line each."""
    camera, table = seen.camera, seen.table
    lines = [
        f"camera: {camera.width}×{camera.height}, exposure {camera.seconds:g} s, gain "
        f"{camera.gain:g}, dark level {100 * camera.level:.1f} %, noise {camera.noise:.2f} grey "
        f"levels, flicker {100 * camera.flicker:.2f} %"
    ]
    lines += [
        f"laser {x.name}: stripe in {100 * x.found:.0f} % of the lines, at {x.column:.0f} px, "
        f"{x.width:.1f} px wide (rms), {100 * x.peak:.0f} % of the scale, "
        f"{100 * x.saturated:.0f} % clipped"
        for x in seen.lasers
    ]
    if table is not None:
        way = {True: "counter-clockwise", False: "clockwise", None: "direction not observed"}
        turn = table.degrees_per_turn
        lines.append(
            f"table: {way[table.counter_clockwise]}, "
            + ("full turn not observed" if turn is None else f"a turn is {turn:g}° (± 2°)")
        )
    return lines


def _plain(facts: dict[str, Any]) -> dict[str, Any]:
    return {k: None if isinstance(v, float) and math.isnan(v) else v for k, v in facts.items()}
