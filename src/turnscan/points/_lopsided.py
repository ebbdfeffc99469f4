"""Stripes that fall off alike on both sides: nothing cuts them, so little is doubted of them.

An edge cuts the light on one side. What is left falls off at once there, and as slowly as ever on
the other; the same holds where the light lies on two surfaces that send unlike parts of it. Its
skew tells that without knowing how thick the sheet is, or how the surface lies.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.points._lit_points import LitPoints
from turnscan.points._own_light import Own, due_on_facing
from turnscan.threads import in_parts

_LINES = 8
"""Lines to either side on a profile whose skew is looked at together: speckle skews each."""
_NEAR = 2
"""The same for what an edge aslant to the lines cuts, a few lines of each profile; and from an end
of a profile, where an edge along its line leaves what it cuts alike on both sides."""
_CUT = 0.25
"""Skew from which on a stripe may be cut as far as its width and light say. That of a Gaussian cut
at its middle is 1.0, with the blur of pixels a third as wide 0.6; cut twice its width beside it
0.2, and its centre is off by a twentieth of it. A cut moves the centre with the square of the skew
that it makes."""
_END = 6
_LEAST = 0.12
"""Part of its doubt that a stripe keeps without any skew: cut alike on both sides, or cut on one
and lit by another surface on the other."""
_SURE = 3.0
_MOST = 0.3
_TOO_NARROW, _AS_DUE = 0.6, 0.76
_MODEST = 0.4
_WIDE, _MOVES_WIDE = 1.15, 0.2
_SLIGHT, _MOVES, _LEFT, _PUT_BACK = 0.65, 0.5, 0.5, 0.8
_DIM = 0.35
_OF_MEDIAN, _OF_GAUSS = 1.4826, 1.2533
"""Of a Gaussian: sigma over the median of what is off, and that of a median over that of a mean."""


def by_skew(
    light: LitPoints,
    own: Own,
    judged: tuple[Floats, Floats],
    thickness: float,
    due_on: Callable[[Floats], Floats],
) -> tuple[Floats, Floats, Floats]:
    """Shift and doubt (s, n) px, as `Wholeness` has them, of what is ``judged`` so by its width and
    light, by its skew.
    """
    assert light.skew is not None
    shift, doubt = judged
    found = ~np.isnan(light.points[..., 0])
    skew = np.where(found, light.skew, np.nan)
    about, noise, part = _lopsided(skew, found & ((doubt > 0.0) | (shift != 0.0)))
    bright, wide = (np.nanmedian(v[found]) for v in (light.amplitude, light.width))
    with np.errstate(invalid="ignore"):
        part[(light.amplitude < _DIM * bright) & (light.width > wide)] = 1.0
    # What is not lopsided was not cut, and was put back for nothing.
    doubt, shift = np.hypot(doubt, (1.0 - part) * shift), part * shift
    part[_ends(found)] = 1.0
    doubt = part * doubt
    if not thickness > 0:
        return shift, doubt, part
    size = np.abs(about)
    with np.errstate(invalid="ignore"):
        sure = (size > _SURE * noise) & (shift == 0.0)
    at = np.nonzero(sure)
    if len(at[0]):
        sign, size, width = np.sign(about[at]), size[at], own.width[at]
        due = due_on_facing(light, at, thickness, due_on)
        ratio = width / due
        with np.errstate(invalid="ignore"):
            cut = (ratio > _TOO_NARROW) & (ratio < _AS_DUE) & (size < _MODEST)
        shift[at] = np.where(cut, np.nan_to_num(sign * _SLIGHT * size * width), 0.0)
        with np.errstate(invalid="ignore"):
            moves = np.where(ratio > _WIDE, _MOVES_WIDE, _MOVES)
        moves = np.where(cut, _LEFT * size, moves * np.minimum(size, _MOST)) * width
        doubt[at] = np.maximum(np.where(cut, _PUT_BACK, 1.0) * doubt[at], np.nan_to_num(moves))
    return shift, doubt, part


def _lopsided(skew: Floats, doubted: Bools) -> tuple[Floats, Floats, Floats]:
    """(s, n) how lopsided stripes of this ``skew`` (s, n) are with those about them on their
    profile, the noise of that, and 0 … 1: the part of their doubt that ``doubted`` (s, n) ones may
    be off by.

    What skews stripes that nothing doubts says nothing of an edge: a laser's own profile, what a
    surface does to it, speckle. NaN, NaN and 1 where nothing measured it.
    """
    sound = np.where(doubted, np.nan, skew)
    usual = _about(sound)
    there = ~np.isnan(sound)
    if not there.any():
        none = np.full(skew.shape, np.nan)
        return none, none, np.ones(skew.shape)
    middle = float(np.median(usual[there]))
    common = _OF_MEDIAN * float(np.median(np.abs(usual[there] - middle)))
    single = _OF_GAUSS * _OF_MEDIAN * _about(np.abs(skew - _about(skew)))
    masked = np.where(doubted, skew, np.nan)
    count = np.where(doubted, _lines_about(~np.isnan(masked)), _lines_about(~np.isnan(sound)))
    noise = np.maximum(common, single / np.sqrt(np.maximum(count, 1)))
    far = np.where(doubted, _about(masked), usual) - middle
    near = np.where(doubted, _about(masked, _NEAR), _about(sound, _NEAR)) - middle
    chance = single**2 / (2 * _NEAR + 1)
    part = np.hypot(np.maximum(far**2 + noise**2, near**2 - chance) / _CUT**2, _LEAST)
    return far, noise, np.asarray(np.minimum(np.nan_to_num(part, nan=1.0), 1.0))


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
