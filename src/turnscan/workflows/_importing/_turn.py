"""Does the part itself agree with the steps that an import was given?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from turnscan.arrays import Floats
from turnscan.errors import Degenerate, InputError
from turnscan.findings import Finding
from turnscan.points import working_volume
from turnscan.remedy import Option, Remedy
from turnscan.rig import Rig
from turnscan.scan import read_picture
from turnscan.workflows._importing._series import Series
from turnscan.workflows._importing._signal import Signal, grey_of
from turnscan.workflows._options._import import EvenSteps, ImportOptions

if TYPE_CHECKING:
    from turnscan.calibrate import Outline

_SAMPLES = 72
"""Pictures of each laser that are looked at."""


def check_outline(
    source: EvenSteps,
    series: Sequence[Series],
    signals: Sequence[Signal],
    rig: Rig,
    options: ImportOptions,
) -> list[Finding]:
    """Raise InputError where two lasers see the part turn another way, or by other steps.

    One laser only tells whether a whole turn closes: what nothing in the pictures could tell is
    among the findings. Nothing is said of a part that is round about the axis.
    """
    from turnscan.calibrate import contradicted_step, outlines_of

    known = {s.name for s in rig.sheets}
    both = [(s, g) for s, g in zip(series, signals, strict=True) if s.laser in known]
    seen = [_passing(one, signal, rig, options) for one, signal in both[:2]]
    step = math.radians(source.step_deg) * options.every
    outlines = outlines_of(seen)
    if len(both) == 1 and outlines:
        count = both[0][0].shots[-1].step - both[0][0].shots[0].step + 1
        return [_one_laser(both[0][0].laser, outlines[0], step, count)]
    right = contradicted_step(outlines, step)
    if not right:
        return []
    what = "turns the other way" if right[0] == -step else "makes other steps"
    message = f"the table {what}: with these steps the two lasers see different parts"
    if len(right) > 1:
        raise InputError(
            message,
            hint="count the steps of a whole turn; the part is alike from several sides, so that "
            "it does not tell the right ones",
            option=Option("angles", str(source)),
        )
    better = EvenSteps(round(math.degrees(right[0]) / options.every, 2))
    raise InputError(
        f"{message}, with {better.step_deg:+g}° for each step the same one",
        hint=Remedy("give ", Option("angles", str(better)), ", or a list of angles"),
        option=Option("angles", str(source)),
    )


def _one_laser(laser: str, outline: Outline, step: float, count: int) -> Finding:
    """What the outline that one laser saw says of the steps."""
    off = outline.open_seam(step, count)
    turned = math.degrees(abs(step) * count)
    if off:
        return Finding(
            "scan.seam-open",
            "warning",
            f"{count} steps make {turned:.0f}°, but the part does not close: the same place is "
            f"{off:.1f} mm off when it is seen again",
            where=f"laser {laser}",
            remedy=Remedy("check the step (", Option("angles"), "), that all pictures are there, "
                          "and that the part did not move"),
        )  # fmt: skip
    size = "the size of the step is borne out by the seam, its sense by nothing"
    return Finding(
        "scan.sense-unchecked",
        "note",
        (size if off is not None else "nothing in the pictures could tell step and sense")
        + ": one laser and no markers; with the wrong sense the part is a mirror image",
        where=f"laser {laser}",
        remedy="look whether the table turns counter-clockwise seen from above, or hold the part "
        "beside its surface",
    )


def _passing(
    series: Series, signal: Signal, rig: Rig, options: ImportOptions
) -> tuple[Floats, list[Floats]]:
    """Steps (s,) of some pictures, and the points (n, 3) mm in each, table frame at rest."""
    from turnscan.stripes import StripeSettings, detect

    chosen = StripeSettings(orientation=options.orientation)
    count = len(series.shots)
    some = np.unique(np.linspace(0, count - 1, min(_SAMPLES, count)).round().astype(int))
    try:
        volume = working_volume(rig, series.laser)
    except Degenerate:  # nothing of the part can be seen, so it says nothing
        return np.zeros(0), []
    steps, points = [], []
    for shot, picture in series.pictures([series.shots[i] for i in some]):
        path = series.dark_of(shot)
        dark = signal.background if path is None else read_picture(path)
        stripe = detect(grey_of(picture, signal.weights), grey_of(dark, signal.weights), chosen)
        rays = rig.camera.rays(stripe.pixels[stripe.found])
        at = rig.T_camera_table.inverse().apply(rig.sheet(series.laser).intersect(rays))
        steps.append(float(shot.step))
        points.append(at[np.isfinite(at).all(axis=1) & volume.contains(at)])
    return np.array(steps), points
