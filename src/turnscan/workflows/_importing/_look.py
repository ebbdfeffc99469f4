"""A look at samples of an import: is there a line, is it clipped, does the table turn as said?"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from turnscan.arrays import Floats, Image
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.remedy import Option, Remedy
from turnscan.rig import Rig
from turnscan.stripes import Orientation
from turnscan.workflows._options._import import EvenSteps

_CLIPPED = 0.3
"""Of the rows with a stripe: more clipped ones than this are worth a warning."""
_FORMED = 0.5
"""Of the rows with light: fewer in line with their neighbours form no line."""
_WIDE_PX, _WIDE = 5.0, 0.006
"""px, and part of the picture: a line of larger rms width is out of focus."""
_LIT = 0.02
"""Of the rows: light in fewer is noise."""
_BEND = 2.0  # px between a centre and the line through its neighbours, at most
_AGREE = math.radians(2.0)
"""rms of the angles about a motion that is theirs; half a step where that is more."""
_FEWEST = 4


def look_at_line(
    laser: str, pairs: Iterable[tuple[Image, Image | None]], orientation: Orientation
) -> tuple[float, list[Finding]]:
    """Share of the rows in which a stripe stands in line with its neighbours, and what is wrong.

    ``pairs`` are pictures (H, W) of laser light, and those without.
    """
    from turnscan.stripes import StripeFlag, StripeSettings, detect

    chosen = StripeSettings(orientation=orientation)
    rows = light = formed = clipped = 0
    widths = []
    across = 1
    for on, off in pairs:
        stripe = detect(on, off, chosen)
        seen = np.isfinite(stripe.position)
        rows += len(seen)
        light += int(seen.sum())
        clipped += int(np.count_nonzero(seen & (stripe.flags & StripeFlag.SATURATED > 0)))
        formed += int(np.count_nonzero(np.abs(np.diff(stripe.position, 2)) < _BEND))
        widths.append(stripe.width[seen])
        across = on.shape[1 if orientation == "vertical" else 0]
    out = []
    if light < _LIT * rows and formed <= _FORMED * light:
        out.append(
            no_stripe(laser, f"no line is seen in any of the {len(widths)} pictures looked at")
        )
    elif formed < _FORMED * light:
        out.append(
            Finding(
                "scan.no-line",
                "warning",
                f"light was found in {light / rows:.0%} of the rows, but only {formed / light:.0%} "
                "of it is continuous with the rows beside it: this is not a laser line",
                where=f"laser {laser}",
                remedy=Remedy(
                    "give the laser's ",
                    Option("colour"),
                    " (a difference of channels, "
                    "like 1,-1,0, where the room is lit), or pictures with it off: ",
                    Option("dark"),
                ),
            )
        )
    usual = float(np.median(np.concatenate(widths))) if light else 0.0
    if usual > max(_WIDE_PX, _WIDE * across):
        out.append(
            Finding(
                "scan.blurred",
                "warning",
                f"the line is {usual:.0f} px wide (rms): the laser or the camera is out of focus, "
                "or something moved",
                where=f"laser {laser}",
                remedy="focus the laser on the axis of the table and the camera on the line, and "
                "take the pictures again",
            )
        )
    if clipped > _CLIPPED * max(light, 1):
        out.append(
            Finding(
                "scan.overexposed",
                "warning",
                f"the line is clipped in {clipped / light:.0%} of the rows in which it is seen: "
                "its centre is uncertain there",
                where=f"laser {laser}",
                remedy="take the pictures again with a shorter exposure, without moving the part",
            )
        )
    return formed / max(rows, 1), out


def no_stripe(laser: str, why: str) -> Finding:
    """That the laser is in none of the pictures."""
    return Finding(
        "scan.no-stripe",
        "warning",
        why,
        where=f"laser {laser}",
        remedy=Remedy(
            "was the laser on and in the picture? otherwise give ",
            Option("dark"),
            ", or a lower ",
            Option("threshold"),
        ),
    )


def check_turn(
    source: EvenSteps, rig: Rig, seen: Sequence[tuple[int, str, Image]], every: int
) -> list[Finding]:
    """Raise InputError where markers in some pictures say that the table turned another way.

    A finding where they stand beside their places.

    ``seen`` are step, name and picture. Nothing is said where fewer than four show a marker.
    """
    from turnscan.calibrate import moved_platter, platter_seen

    shown = [(step, platter_seen(picture, rig)) for step, _, picture in seen]
    moved = moved_platter(rig, [platter.off for _, platter in shown])
    found = [(step, platter.angle) for step, platter in shown]
    k = np.array([step for step, angle in found if angle is not None], dtype=np.float64)
    if len(k) < _FEWEST:
        return moved
    angles = np.array([angle.angle for _, angle in found if angle is not None])
    step = math.radians(source.step_deg) * every
    if _fit(k, angles, step):
        return moved
    tries = np.linspace(-np.pi, np.pi, 40001)
    best = float(tries[np.argmax([_coherence(k, angles, t) for t in tries])])
    if not _fit(k, angles, best):
        raise InputError(
            "the markers in the pictures do not agree with even steps",
            hint=Remedy("take each angle from the markers: ", Option("angles", "markers")),
            option=Option("angles", str(source)),
        )
    right = EvenSteps(round(math.degrees(best) / every, 2))
    other_way = abs(math.degrees(best) / every + source.step_deg) < 0.05 * abs(source.step_deg)
    what = "turns the other way" if other_way else "makes other steps"
    raise InputError(
        f"the table {what}: the markers say {right.step_deg:+g}° for each step",
        hint=Remedy("give ", Option("angles", str(right)), ", or ", Option("angles", "markers")),
        option=Option("angles", str(source)),
    )


def _fit(k: Floats, angles: Floats, step: float) -> bool:
    """Whether angles (n,) are those of even steps, but for a step or two that was lost."""
    away = np.exp(1j * (angles - step * k))
    off = np.angle(away * np.conj(away.mean()))
    return bool(np.sqrt(np.mean(off**2)) < max(_AGREE, abs(step) / 2))


def _coherence(k: Floats, angles: Floats, step: float) -> float:
    """Mean resultant length of angles (n,) about even steps: 1 where all agree."""
    return float(np.abs(np.mean(np.exp(1j * (angles - step * k)))))
