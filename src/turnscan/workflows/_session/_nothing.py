"""Why settings make no surface: a sentence, and the setting it is about."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from turnscan.findings import Finding
from turnscan.points import RangeGrid
from turnscan.remedy import Option, Remedy
from turnscan.workflows._options._reconstruct import ReconstructOptions

_STRIPES = ("threshold", "radius", "z_min", "z_max", "strategy", "choose", "refine")
"""What stripes depend on; what takes most away stands first."""
_PROFILES = ("every", "spacing_between")
_POINTS = ("outliers", "largest_sigma", "edge", "radius", "z_min", "z_max", "denoise", *_PROFILES)
_FACES = ("voxel", *_PROFILES, "spacing", "merge", "edge", "outliers", "largest_sigma")


@dataclass(frozen=True)
class Left:
    """What is left of the frames of a scan or of a part of it, from stage to stage."""

    frames: int
    stripes: int
    """Frames in which something was found."""
    profiles: int
    """With a point, of the laser that has most of them."""
    points: int

    @classmethod
    def of(cls, frames: int, stripes: int, grids: Sequence[RangeGrid]) -> Left:
        """What grids hold of ``frames`` pictures, ``stripes`` of which show a stripe."""
        found = [g.found for g in grids]
        profiles = max((int(np.count_nonzero(f.any(axis=1))) for f in found), default=0)
        return cls(frames, stripes, profiles, sum(int(np.count_nonzero(f)) for f in found))


def nothing_made(left: Left, now: ReconstructOptions, wanted: ReconstructOptions) -> Finding:
    """Why ``wanted`` leaves no face; ``now`` is what is in use.

    Its remedy names the option to correct: of those on which the stage depends that left nothing,
    the first that is not as it is in use.
    """
    pictures = f"{left.frames} picture{'s' * (left.frames != 1)}"
    if not left.stripes:
        text = f"no stripe above the threshold and inside the working volume in {pictures}"
        return _finding(text, _STRIPES, now, wanted)
    if not left.points:
        text = f"no point is left of the stripes in {pictures}"
        return _finding(text, _POINTS, now, wanted)
    if left.profiles < 2:
        text = "1 profile is left, and a surface needs two beside each other"
        return _finding(text, _PROFILES, now, wanted)
    text = f"the {left.points} points that are left, in {left.profiles} profiles, form no surface"
    return _finding(text, _FACES, now, wanted)


def _finding(
    text: str, bearing: Sequence[str], now: ReconstructOptions, wanted: ReconstructOptions
) -> Finding:
    candidates = (*bearing, *wanted.changed(), *now.changed())
    name = next((n for n in candidates if getattr(now, n) != getattr(wanted, n)), None)
    remedy: Remedy | str = "choose another point on the part"
    if name is not None:
        used = getattr(now, name)
        remedy = Remedy("in use is ", Option(name, used))
        if used is None:
            remedy = Remedy("leave ", Option(name), " empty, as it is in use")
    return Finding("settings.nothing", "error", text, "", remedy)
