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
    off, most = np.empty((2, 2, *doubt.shape)), np.empty(doubt.shape)

    def leads(first: int, end: int) -> None:
        off[:, :, first:end] = np.nan
        places = light.points, light.along, light.arcs
        kernels.off_straight(*places, sure, about, light.closed, (first, end), off)

    def bound(first: int, end: int) -> None:
        most[first:end] = np.nan
        kernels.bounded(off, noise, asked, (_LINES, _FEWEST), (first, end), most)

    in_parts(leads, len(most))
    in_parts(bound, len(most))
    return np.asarray(np.fmin(doubt, most))
