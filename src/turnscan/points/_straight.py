"""Points that lie where the profiles beside lead straight on: doubted no more than they are off."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.points._lit_points import LitPoints
from turnscan.threads import in_parts

_SURE = 1.5
"""Usual noises that a point is doubted by at most which tells where its surface leads."""
_WORTH = 0.3
"""Usual noises that it is doubted by at least where that is asked: less adds nothing to sigma."""
_LINES, _FEWEST = 8, 7
"""Lines to either side that tell together how far a profile lies off such a way, and how many of
them at least."""
_TOGETHER = 64
"""Steps whose points are looked at at a time."""


def straight_on(light: LitPoints, doubt: Floats, shift: Floats) -> Floats:
    """(s, n) px: the ``doubt`` (s, n) px of each centre, but no more than it can be off where
    profiles beside lead straight on to it.

    What cuts a stripe, or shows two surfaces at once, moves its point off the face that it is taken
    for. Where a stretch of a profile goes on as profiles do that are in no doubt, and were not put
    back (``shift`` (s, n) px), its points are off by no more than they differ from that way, and
    scatter about it.
    """
    from scipy.ndimage import maximum_filter1d

    from turnscan.points import _straight_kernels as kernels

    noise = light.noise / np.linalg.norm(light.along, axis=-1)
    with np.errstate(invalid="ignore"):
        sure = (doubt <= _SURE * noise) & (shift == 0.0)
        asked = (doubt > _WORTH * noise) & (shift == 0.0)
    about = maximum_filter1d(asked.astype(np.uint8), 2 * _LINES + 1, axis=1) > 0
    places, most = (light.points, light.along, light.arcs), np.full(doubt.shape, np.nan)

    def part(first: int, end: int) -> None:
        span, off = (first, end), np.full((3, 2, end - first, doubt.shape[1]), np.nan)
        kernels.off_straight(*places, sure, about, light.closed, span, off)
        kernels.bounded(off, noise, asked, (_LINES, _FEWEST), span, most)

    in_parts(part, len(most), -(-len(most) // _TOGETHER))
    return np.asarray(np.fmin(doubt, most))
