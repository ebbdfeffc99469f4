"""What the skew of stripes tells: whether an edge cuts them.

An edge cuts the light on one side. What is left falls off at once there, and as slowly as ever on
the other; the same holds where the light lies on two surfaces that send unlike parts of it. The
skew tells that without knowing how thick the sheet is, or how the surface lies. What falls off
alike on both sides is cut by nothing, however narrow or faint it is.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.points._lit_points import LitPoints
from turnscan.points._own_light import GLOW_LIGHT, Own, due_on_facing
from turnscan.threads import in_parts

_LINES, _NEAR = 8, 2
"""Lines to either side on a profile whose skew is looked at together, for speckle skews each; and
where an edge that runs aslant to the lines cuts but a few of a profile."""
_END = 6
"""Lines from an end of a profile in which the skew excuses nothing: an edge along the lines cuts a
stripe there and leaves it alike on both sides."""
_CUT = 0.25
"""Skew from which on a stripe may be cut as far as its width and light say. A Gaussian that is cut
at its middle has 1.0, or 0.6 with the blur of pixels a third as wide; one that is cut twice its
width beside it has 0.2, and its centre is off by a twentieth of that. So a cut moves the centre
with the square of the skew that it makes."""
_LEAST = 0.12
"""Part of its doubt that a stripe keeps without any skew: cut alike on both sides, or cut on one
and lit on another surface on the other."""
_SURE = 3.0
"""Noises beyond which a stripe is lopsided."""
_NARROW = 0.6, 0.76
"""Parts of the width due on a surface that faces the camera from which to which a lopsided stripe
is one that an edge cuts, and is put back: what is wider lies on a second surface as well, and what
is narrower still may be seen on a slope."""
_MODEST = 0.4
"""Skew from which on it no longer tells how much is cut, for pixels blur the cut."""
_BACK, _UNSURE, _KEPT = 0.65, 0.5, 0.8
"""Widths by which a skew of one puts such a stripe back (of a Gaussian with the blur of pixels 0.3
to 0.7; what was measured on simulated parts, docs/decisions/0077-skew.md), widths that stay doubted
then, and the part of its own doubt that it keeps."""
_MOVES, _MOST = 0.5, 0.3
"""Widths, rms, by which a skew of one moves the centre of other lopsided stripes, as measured on
the same parts, and the skew from which on it moves them no further."""
_WIDE, _MOVES_WIDE = 1.15, 0.2
"""Part of that due width beyond which it moves them by so much: a slope spreads the light, and a
second surface adds little to it."""
_OF_MEDIAN, _OF_GAUSS = 1.4826, 1.2533
"""Of a Gaussian: sigma over the median of what is off, and that of a median over that of a mean."""


class BySkew(NamedTuple):
    """What skew makes of what widths and light say."""

    shift: Floats
    """(s, n) px, as `Wholeness.shift`."""
    doubt: Floats
    """(s, n) px, as `Wholeness.doubt`."""
    part: Floats
    """(s, n) 0 to 1: the part of any doubt for its width that a stripe may be off by."""


def by_skew(
    light: LitPoints,
    own: Own,
    judged: tuple[Floats, Floats],
    thickness: float,
    due_on: Callable[[Floats], Floats],
) -> BySkew:
    """What is ``judged`` by widths and light, shift and doubt (s, n) px, as far as the stripes are
    lopsided.

    What is alike on both sides was doubted, and put back, for nothing. What is surely lopsided is
    doubted by as much as that usually moves a centre, whatever its width says; and where it is
    narrow besides, it is cut, and put back. Nothing is excused where light is dim and wide: what
    other surfaces throw there is alike on both sides. ``due_on`` says how wide whole stripes of a
    sheet of this ``thickness``, mm, are, px; nothing is put back where it is not known, 0.
    """
    shift, doubt = judged
    found = ~np.isnan(light.points[..., 0]) & ~np.isnan(light.amplitude + light.width)
    if light.skew is None or np.isnan(light.skew[found]).all():
        return BySkew(shift, doubt, np.ones(shift.shape))
    skew = np.where(found, light.skew, np.nan)
    lop = _lopsided(skew, found & ((doubt > 0.0) | (shift != 0.0)))
    part, back = lop.part, lop.part * shift
    part[_dim_and_wide(light, found) | _ends(found)] = 1.0
    doubt = part * np.hypot(doubt, shift - back)
    with np.errstate(invalid="ignore"):
        at = np.nonzero((np.abs(lop.skew) > _SURE * lop.noise) & (back == 0.0))
    if thickness > 0 and len(at[0]):
        some, width = lop.skew[at], own.width[at]
        ratio = width / due_on_facing(light, at, thickness, due_on)
        back[at], moves = _cut(some, width, ratio)
        doubt[at] = np.maximum(np.where(back[at] != 0.0, _KEPT, 1.0) * doubt[at], moves)
    return BySkew(back, doubt, part)


def _cut(skew: Floats, width: Floats, ratio: Floats) -> tuple[Floats, Floats]:
    """(m,) px by which lopsided stripes of a ``width`` (m,) px are put back, those of a ``ratio``
    (m,) to their due that an edge leaves, and what stays doubted of all."""
    size = np.abs(skew)
    with np.errstate(invalid="ignore"):
        cut = (ratio > _NARROW[0]) & (ratio < _NARROW[1]) & (size < _MODEST)
        usual = np.where(ratio > _WIDE, _MOVES_WIDE, _MOVES)
    moves = np.where(cut, _UNSURE * size, usual * np.minimum(size, _MOST)) * width
    return np.nan_to_num(np.where(cut, _BACK * skew * width, 0.0)), np.nan_to_num(moves)


class _Lopsided(NamedTuple):
    """How lopsided stripes are, with those about them on their profiles."""

    skew: Floats
    """(s, n) how far beyond what is usual."""
    noise: Floats
    """(s, n) standard uncertainty of that."""
    part: Floats
    """(s, n) 0 to 1, as `BySkew.part`; 1 where nothing measured it."""


def _lopsided(skew: Floats, doubted: Bools) -> _Lopsided:
    """What skews (s, n) say of stripes that are ``doubted`` (s, n), and of the others.

    Doubted ones are looked at with each other: an edge cuts them all. What skews the others says
    nothing of an edge: a laser's own profile, what a surface does to it, speckle.
    """
    sound, asked = np.where(doubted, np.nan, skew), np.where(doubted, skew, np.nan)
    usual = _about(sound)
    there = ~np.isnan(sound)
    if not there.any():
        none = np.full(skew.shape, np.nan)
        return _Lopsided(none, none, np.ones(skew.shape))
    middle = float(np.median(usual[there]))
    common = _OF_MEDIAN * float(np.median(np.abs(usual[there] - middle)))
    single = _OF_GAUSS * _OF_MEDIAN * _about(np.abs(skew - _about(skew)))
    count = np.where(doubted, _lines_about(~np.isnan(asked)), _lines_about(there))
    noise = np.maximum(common, single / np.sqrt(np.maximum(count, 1)))
    far = np.where(doubted, _about(asked), usual) - middle
    near = np.where(doubted, _about(asked, _NEAR), _about(sound, _NEAR)) - middle
    chance = single**2 / (2 * _NEAR + 1)
    part = np.hypot(np.maximum(far**2 + noise**2, near**2 - chance) / _CUT**2, _LEAST)
    return _Lopsided(far, noise, np.minimum(np.nan_to_num(part, nan=1.0), 1.0))


def _dim_and_wide(light: LitPoints, found: Bools) -> Bools:
    """(s, n) True where light is far fainter than usual, and wider."""
    bright, wide = (float(np.median(v[found])) for v in (light.amplitude, light.width))
    with np.errstate(invalid="ignore"):
        return np.asarray((light.amplitude < GLOW_LIGHT * bright) & (light.width > wide))


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
