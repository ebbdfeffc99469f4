"""How a surface lies at each point, as the width of the stripe tells by itself."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.points._lit_points import LitPoints
from turnscan.threads import in_parts

_WIDER = 1.1
"""Times that a stripe is wider than its surface alone makes it, at most."""
_LEAST = 0.5
"""Cosine below which none is believed: the flatter a surface is seen, the less its width tells."""
_TOGETHER = 64
"""Steps that are done at a time."""


def share_by_width(light: LitPoints, walk: Floats) -> Floats:
    """(s, n) cosine between the way along which the error of a stripe's centre moves its point and
    the surface's normal, if a pixel leads ``walk`` (s, n) mm away from the sheet on it.

    That, and the profile, leave two surfaces, one turned to either side; the larger cosine of both
    is given, also if something else makes the stripe a little wider, and `_LEAST` at least. NaN
    where nothing is known, at the ends of runs, and where the profile jumps. The sheet, of
    thickness σ, lights a band of the surface that is σ wide across the sheet, and the camera sees
    it from aside: what is w pixels wide leads σ/w mm away from the sheet with each.
    """
    from turnscan.points import _normal_kernels as kernels

    out = np.empty(walk.shape)
    places = light.points, light.eyes, light.moves, light.sheets

    def part(first: int, end: int) -> None:
        kernels.by_width(places, walk, _WIDER, (first, end), out)

    in_parts(part, len(out), -(-len(out) // _TOGETHER))
    return np.maximum(out, _LEAST)
