"""Stripes that fall off alike on both sides: nothing cuts them, so little is doubted of them.

An edge cuts the light on one side. What is left falls off at once there, and as slowly as ever on
the other; the same holds where the light lies on two surfaces that send unlike parts of it. Its
skew tells that without knowing how thick the sheet is, or how the surface lies.
"""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.threads import in_parts

_LINES = 8
"""Lines to either side on a profile whose skew is looked at together: speckle skews each."""
_NEAR = 2
"""The same for what an edge aslant to the lines cuts, a few lines of each profile; and from an end
of a profile, where an edge along its line leaves what it cuts alike on both sides."""
_CUT = 0.2
"""Skew from which on a stripe may be cut as far as its width and light say. That of a Gaussian cut
at its middle is 1.0, with the blur of pixels a third as wide 0.6; cut twice its width beside it
0.2, and its centre is off by a twentieth of it. A cut moves the centre with the square of the skew
that it makes."""
_END = 4
_LEAST = 0.12
"""Part of its doubt that a stripe keeps without any skew: cut alike on both sides, or cut on one
and lit by another surface on the other."""
_OF_MEDIAN, _OF_GAUSS = 1.4826, 1.2533
"""Of a Gaussian: sigma over the median of what is off, and that of a median over that of a mean."""


def lopsided(skew: Floats, doubted: Bools) -> Floats:
    """(s, n) 0 … 1: the part of their doubt that ``doubted`` (s, n) stripes of this ``skew`` (s, n)
    may be off by; 1 where nothing measured it.

    What skews stripes that nothing doubts says nothing of an edge: a laser's own profile, what a
    surface does to it, speckle.
    """
    sound = np.where(doubted, np.nan, skew)
    usual = _about(sound)
    there = ~np.isnan(sound)
    if not there.any():
        return np.ones(skew.shape)
    middle = float(np.median(usual[there]))
    common = _OF_MEDIAN * float(np.median(np.abs(usual[there] - middle)))
    single = _OF_MEDIAN * float(np.median(np.abs(sound[there] - usual[there])))
    asked = np.where(doubted, skew, np.nan)
    count = np.maximum(_lines_about(~np.isnan(asked)), 1)
    noise = np.maximum(common**2, (_OF_GAUSS * single) ** 2 / count)
    chance = (_OF_GAUSS * single) ** 2 / (2 * _NEAR + 1)
    far, near = ((_about(asked, lines) - middle) ** 2 for lines in (_LINES, _NEAR))
    part = np.hypot(np.maximum(far + noise, near - chance) / _CUT**2, _LEAST)
    part[_ends(~np.isnan(skew))] = 1.0
    return np.asarray(np.minimum(np.nan_to_num(part, nan=1.0), 1.0))


def _about(skew: Floats, lines: int = _LINES) -> Floats:
    """(s, n) the median of those that there are up to so many lines to either side."""
    from turnscan.points import _wholeness_kernels as kernels

    return np.concatenate(in_parts(lambda a, b: kernels.usual(skew[a:b], lines), len(skew)))


def _ends(there: Bools) -> Bools:
    """(s, n) True up to `_END` lines from where a profile ends."""
    from scipy.ndimage import minimum_filter1d

    return np.asarray(minimum_filter1d(there, 2 * _END + 1, 1, mode="constant", cval=0) == 0)


def _lines_about(there: Bools) -> Floats:
    """(s, n) how many of those up to `_LINES` to either side are ``there``."""
    from scipy.ndimage import uniform_filter1d

    size = 2 * _LINES + 1
    return np.asarray(size * uniform_filter1d(there.astype(np.float64), size, 1, mode="constant"))
