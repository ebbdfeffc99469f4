"""Does the part itself agree with the steps that an import was told?"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from turnscan.arrays import Floats
from turnscan.errors import InputError
from turnscan.remedy import Option, Remedy
from turnscan.rig import Rig
from turnscan.scan import read_picture
from turnscan.workflows._import_options import EvenSteps, ImportOptions
from turnscan.workflows._series import Series
from turnscan.workflows._signal import Signal, grey_of

_SAMPLES = 72
"""Pictures of each laser that are looked at."""


def check_outline(
    source: EvenSteps,
    series: Sequence[Series],
    signals: Sequence[Signal],
    rig: Rig,
    options: ImportOptions,
) -> None:
    """Raise InputError where two lasers see the part turn another way, or by other steps.

    Nothing is said of one laser, or of a part that is round about the axis.
    """
    from turnscan.calibrate import contradicted_step, outlines_of

    known = {s.name for s in rig.sheets}
    both = [(s, g) for s, g in zip(series, signals, strict=True) if s.laser in known]
    if len(both) < 2:
        return
    seen = [_passing(one, signal, rig, options) for one, signal in both[:2]]
    step = math.radians(source.step_deg) * options.every
    right = contradicted_step(outlines_of(seen), step)
    if not right:
        return
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


def _passing(
    series: Series, signal: Signal, rig: Rig, options: ImportOptions
) -> tuple[Floats, list[Floats]]:
    """Steps (s,) of some pictures, and the points (n, 3) mm in each, table frame at rest."""
    from turnscan.stripes import StripeSettings, detect

    chosen = StripeSettings(orientation=options.orientation)
    count = len(series.shots)
    some = np.unique(np.linspace(0, count - 1, min(_SAMPLES, count)).round().astype(int))
    steps, points = [], []
    for shot, picture in series.pictures([series.shots[i] for i in some]):
        path = series.dark_of(shot)
        dark = signal.background if path is None else read_picture(path)
        stripe = detect(grey_of(picture, signal.weights), grey_of(dark, signal.weights), chosen)
        rays = rig.camera.rays(stripe.pixels[stripe.found])
        at = rig.T_camera_table.inverse().apply(rig.sheet(series.laser).intersect(rays))
        steps.append(float(shot.step))
        points.append(at[np.isfinite(at).all(axis=1) & (at[:, 2] > 0.0)])
    return np.array(steps), points
