"""What the light of a stripe itself tells, where the profiles beside do not say how its surface
lies.

On a surface that faces the camera a whole stripe is as wide as the sheet is thick, and as bright as
the best of its line. What cuts it takes width and light away, and what it lies on besides has less
light to send. A surface that turns away from the camera takes both, too; by the stripe alone nobody
can tell that from a cut.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats, Longs
from turnscan.points._cut import by_light, by_width, lacking
from turnscan.points._lit_points import LitPoints

_SURE, _SURE_ALONE, _SURE_STILL, _DIM = 0.15, 0.25, 0.7, 0.5
"""Part of its width, on a surface that faces the camera, that a stripe may lack for other reasons:
where the profiles beside do not agree, where none tells how the surface lies, and where no turn
moves a point; and the part of the usual light, for its width, below which …"""
_NONE = 0.05
"""Part of its width that speckle makes any stripe lack: where chords tell nothing, one that lacks
between this and `_SURE` is cut as probably as it lacks more."""
_DARK = 0.7
"""Part of a line's best light with less of which it is asked whether the slope explains it."""
_USUAL = 0.7
"""Part of how far an edge under the sheet may move a centre by which it usually does, where nothing
but chords of long steps says that there is one."""
_LIKE, _AS_BRIGHT = 0.1, (0.8, 1.35)
"""Part of its width by which a stripe may differ from what is due on the chord to one side, and
parts of the light due there from which to which it may have, to lie whole on a surface that goes on
as that chord does."""
_BY_CHANCE = 0.25
"""Part of its doubt that such a stripe keeps: one in sixteen is cut just so that it looks whole."""
_BENDS = 0.5
"""rad that chords of a surface without an edge bend by, at most: those of a cylinder about the axis
bend by one step, 0.26 at 24 a turn, and those of a surface that bends twice as much by two."""
GLOW_LIGHT = 0.35
"""Part of the usual brightness below which light may be what other surfaces throw."""
_BEST = 0.8
"""Quantile of the light of a line over the turn that is that of a whole stripe, and of the lines
that tell whether a line has one …"""
_BRIGHT = 0.85
"""… and part of it from which on a line is one of those that do."""
_OFTEN = 0.5
"""Part of the most profiles in which any line is seen, below which what all of a line's stripes are
like says nothing."""
_NARROWER = 0.08
"""Part of their width that the stripes of a line lack at least where all of them are cut alike."""
_LINES = 4
"""Lines to either side whose median says how wide and bright a line's stripes are."""
_APART, _SOME = 5, 64
"""Lines apart, of so many steps, that tell how far speckle makes the light of stripes differ; …"""
_LEAST, _MOST = 0.02, 0.5
"""… so much it is believed to be at least and at most."""


_SPENT, _HALF = 0.01, 0.5
"""Parts of the usual light and of the width on a surface that faces the camera, less than which of
both is left of no stripe that tells where the sheet's middle is."""
_STRAY, _ODD = 0.05, (0.5, 2.0)
"""Part of the usual peak below which light is asked whether it comes in stripes, and the parts of
the width on a surface that faces the camera from which to which a stripe is one."""

_AFORE, _NEXT = 4.0, 1.5
"""Thicknesses of the sheet that such light must stand in front of what both profiles beside show,
not to be a stripe, and usual steps up to which these are beside."""


class Own(NamedTuple):
    """Stripes, as wide and bright as they are about each."""

    width: Floats
    """(s, n) px."""
    bright: Floats
    """(s, n) grey levels."""
    walk: Floats
    """(2, s, n) mm, as `_wholeness_kernels.across` writes it."""


class Alone(NamedTuple):
    """Points of whose surface the profiles beside tell little."""

    lone: Bools
    """(s, n) True where none is linked, or one that ends there."""
    still: Bools
    """(s, n) True where no turn moves the point."""
    blind: Bools
    """(s, n) True where those beside are further off than the sheet reaches, and do not agree."""
    agree: Bools
    """(s, n) True where the chords to both lie alike to the light."""


def by_own_light(
    light: LitPoints,
    own: Own,
    doubt: Floats,
    alone: Alone,
    thickness: float,
    due_on: Callable[[Floats], Floats],
) -> Floats:
    """The ``doubt`` (s, n) px of stripes with what their own light says; as it is where the sheet's
    ``thickness``, mm, is not known.

    A face that is narrower than the sheet, as the edge of a plate, is lit by a part of it that may
    lie far off its middle. Its stripe is narrower than one on a surface that faces the camera, and
    so is a whole one only on a surface that the camera grazes; or there is less light in it. Where
    chords of long steps do not agree, an edge lies between them, and may lie under the sheet: then
    both must allow it, width and light, unless both are as on a surface that lies between the two
    chords. A quarter is left of that doubt where both are as on a surface that goes on as one of
    the chords (`_on_one`). On any surface that makes a stripe narrow as much light is left as it
    faces the camera; what has less is cut, unless the chords agree and it is as wide as is due on
    them: then it is dark. And where a stripe is no wider than one on a surface that faces the
    camera, nothing moves its centre further than the light allows that is left of a whole one's.
    """
    whole = own.width * own.bright
    best = _best(whole)
    alike = np.zeros(len(best), dtype=np.bool_)
    due_of = partial(_due, thickness=thickness, due_on=due_on)
    if thickness > 0:
        best, alike = _of_whole(best, own.width, light, due_of)
    asked = alone.lone | alone.still | alone.blind | (doubt > 0) | (whole < _DARK * best) | alike
    at = np.nonzero(asked & (own.width > 0))
    if not (thickness > 0 and len(at[0])):
        return doubt
    width, noise = own.width[at], _noise(whole)
    facing, lean = _facing(light, at)
    due = due_of(facing)
    ratio, left = np.minimum(width / due, 1.0), whole[at] / best[at[1]]
    with np.errstate(invalid="ignore", divide="ignore"):
        between = np.sqrt(own.walk[0][at] * own.walk[1][at])
        fits = np.abs(np.log(width / due_of(between))) <= _SURE
    off = by_light(left, 1.0 - noise)
    blind = alone.blind[at] & ~(fits & _round(own.walk[:, at[0], at[1]], (facing, lean), left))
    found = np.where(blind, _USUAL * np.minimum(by_width(ratio, _SURE), off) * due, 0.0)
    cut = np.clip((1 - ratio - _NONE) / (_SURE - _NONE), 0.0, 1.0)
    cut = np.where(blind, np.sqrt(cut), ratio < 1 - _SURE) * ~(fits & alone.agree[at])
    # Where all of a line is cut alike, no slope explains that light is missing, nor does paint: the
    # cut is known, and all that it moves a centre of a whole stripe counts.
    all_alike = alike[at[1]]
    of_slope = left / np.cos(np.arctan((1 - 1 / ratio) / lean))
    found = np.maximum(found, cut * lacking(of_slope) * width)
    found = np.where(all_alike, np.maximum(found, lacking(left, 1.0) * due), found)
    # What is wider lies on surfaces behind each other, and may have all of its light; more light
    # than a whole stripe has comes from elsewhere.
    told = (width <= (1 + _SURE) * due) & (left <= 1.0 + 2.0 * noise)
    most = np.where(told, off * np.maximum(due, width), np.inf)
    found = np.minimum(np.maximum(doubt[at], found), most)
    usual = whole[at] / (np.nanmedian(whole) * ratio)
    alone_by = _nothing_beside(ratio, usual, alone.lone[at], alone.still[at])
    found = np.maximum(found, alone_by * due)
    out, sure = doubt.copy(), alone.blind[at] & ~all_alike
    if sure.any():
        steady = _Steady(_about_each(own.width)[at], _about_each(whole / best)[at])
        sure &= _on_one(own.walk[:, at[0], at[1]], (facing, lean), steady, due_of)
    out[at] = np.where(sure, _BY_CHANCE, 1.0) * np.nan_to_num(found)
    return out


class _Steady(NamedTuple):
    """What stripes are like with those beside them on their profile."""

    width: Floats
    """(m,) px."""
    left: Floats
    """(m,) the part of a whole stripe's light."""


def _on_one(
    walk: Floats, seen: tuple[Floats, Floats], own: _Steady, due: Callable[[Floats], Floats]
) -> Bools:
    """(m,) True where a stripe is as wide, and as bright, as is due on a surface that lies like the
    chord to one side, ``walk`` (2, m).

    What is cut has either by chance alone, and both on a whole stretch of its profile hardly ever.
    ``seen`` is of `_facing`.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        send = np.cos(np.arctan((1 - walk / seen[0]) / seen[1]))
        wide = np.abs(np.log(own.width / np.stack([due(w) for w in walk]))) <= _LIKE
        bright = (own.left >= _AS_BRIGHT[0] * send) & (own.left <= _AS_BRIGHT[1] * send)
    return np.asarray((wide & bright).any(axis=0))


def _about_each(values: Floats) -> Floats:
    """(s, n) the median of each with up to `_LINES` to either side that its profile has."""
    out = values.copy()
    for row in out:
        have = np.flatnonzero(~np.isnan(row))
        if len(have):
            row[have] = _median_about(row[have], _LINES)
    return out


def _nothing_beside(ratio: Floats, usual: Floats, lone: Bools, still: Bools) -> Floats:
    """(m,) whole widths that stripes may be off, of this part of their due width and of the usual
    light for it, which are ``lone``, or ``still`` as the table turns; 0 for others."""
    narrow = np.where(lone, by_width(ratio, _SURE_ALONE), by_width(ratio, _SURE_STILL))
    dim = np.where(usual < _DIM, lacking(usual), 0.0)
    return np.asarray(np.maximum(narrow, dim) * (lone | still))


def _facing(light: LitPoints, at: tuple[Longs, ...]) -> tuple[Floats, Floats]:
    """(m,) mm by which a pixel leads away from the sheet on surfaces that face the camera, and the
    tangent of the angle between ray and sheet there."""
    ray, move = light.points[at] - light.eyes[at[0]], light.moves[at]
    sheet = light.sheets[at]
    size = np.sum(ray * ray, axis=1)
    away = move - ray * (np.sum(ray * move, axis=1) / size)[:, None]
    facing = np.abs(np.sum(sheet * away, axis=1))
    sine = np.abs(np.sum(sheet * ray, axis=1)) / np.sqrt(size)
    return facing, sine / np.sqrt(np.maximum(1.0 - sine**2, 1e-12))


def _round(walk: Floats, seen: tuple[Floats, Floats], left: Floats) -> Bools:
    """(m,) True where chords that lie so (2, m) to the light bend as those of a round part, and so
    much light is ``left`` as a surface sends that lies between them; ``seen`` is of `_facing`."""
    turned = np.arctan((1 - walk / seen[0]) / seen[1])
    with np.errstate(invalid="ignore"):
        one = np.abs(turned[0] - turned[1]) <= _BENDS
        return np.asarray(one & (left >= (1 - _SURE) * np.cos(turned.mean(axis=0))))


def due_on_facing(
    light: LitPoints,
    at: tuple[Longs, ...],
    thickness: float,
    due_on: Callable[[Floats], Floats],
) -> Floats:
    """(m,) px: how wide whole stripes are at those places on surfaces that face the camera."""
    return _due(_facing(light, at)[0], thickness, due_on)


def _due(walk: Floats, thickness: float, due_on: Callable[[Floats], Floats]) -> Floats:
    """(m,) px: how wide whole stripes are on surfaces that lie so to the light."""
    due = due_on(np.tile(walk, (2, 1, 1)))[0, 0]
    return np.asarray(np.where(np.isnan(due), thickness / walk, due))


def _noise(whole: Floats) -> float:
    """How far light (s, n) usually differs by chance, as a part of it."""
    some = whole[:: -(-len(whole) // _SOME)]
    with np.errstate(invalid="ignore", divide="ignore"):
        differ = np.abs(np.log(some[:, _APART:] / some[:, :-_APART]))
    known = differ[np.isfinite(differ)]
    # Of a Gaussian half lies within 0.6745, and two of them differ by the root of two.
    usual = float(np.median(known)) / (0.6745 * np.sqrt(2.0)) if len(known) else _MOST
    return min(max(usual, _LEAST), _MOST)


def _best(whole: Floats) -> Floats:
    """(n,) the light of a whole stripe in each line, of all (s, n) that there are; NaN for none."""
    have = np.sort(whole, axis=0)  # NaN last
    count = (~np.isnan(whole)).sum(axis=0)
    best = have[np.maximum(np.ceil(_BEST * count).astype(np.intp) - 1, 0), np.arange(len(count))]
    return np.asarray(best)


def _of_whole(
    best: Floats, width: Floats, light: LitPoints, due_on: Callable[[Floats], Floats]
) -> tuple[Floats, Bools]:
    """The ``best`` light (n,) of lines, that of bright ones about them where no stripe is whole,
    and True for those.

    Where every profile falls on the same place of a part that repeats, as the gaps of a gear, the
    best stripe of a line is cut as all of them are. Its stripes are narrower then than those of
    other lines, as those of the hub, and have much less light. What is dark is as wide as the rest.
    ``width`` (s, n) px; ``due_on`` says how wide whole stripes are, px.
    """
    some = np.zeros(width.shape, dtype=np.bool_)
    every = -(-len(width) // _SOME)
    some[::every] = width[::every] > 0
    at = np.nonzero(some)
    part = np.full(width.shape, np.nan)
    part[at] = width[at] / due_on(_facing(light, at)[0])
    seen = some.sum(axis=0)
    known = np.flatnonzero((seen >= max(1.0, _OFTEN * seen.max(initial=0))) & ~np.isnan(best))
    out, alike = best.copy(), np.zeros(len(best), dtype=np.bool_)
    if not len(known):
        return out, alike
    wide, usual = (np.nanmedian(v[::every, known], axis=0) for v in (part, width * light.amplitude))
    # A surface that the sheet grazes is lit in a wide stripe, and all of that is more light.
    bright = wide <= 1 + _SURE
    if not bright.any():
        return out, alike
    bright &= best[known] >= _BRIGHT * np.quantile(best[known][bright], _BEST)
    as_light, about = (
        np.interp(known, known[bright], values[bright]) for values in (usual, best[known])
    )
    # Speckle makes a line by itself as wide, or as bright, as others are cut.
    wide, less, least = (
        _median_about(values, _LINES) for values in (wide, usual / as_light, best[known] / about)
    )
    cut = (wide < (1 - _NARROWER) * np.median(wide[bright])) & (less < _DARK) & (least < _BRIGHT)
    cut &= ~bright
    out[known[cut]], alike[known[cut]] = about[cut], True
    return out, alike


def _median_about(values: Floats, reach: int) -> Floats:
    """(n,) the median of each with up to ``reach`` to either side."""
    from scipy.ndimage import median_filter

    return np.asarray(median_filter(values, 2 * reach + 1, mode="nearest"))


def spent(
    light: LitPoints, own: Own, thickness: float, due_on: Callable[[Floats], Floats]
) -> Bools:
    """(s, n) True where no more than a hundredth is left of the usual light, in a stripe half as
    wide as a whole one, or less.

    A Gaussian that is cut so lies more than two of its widths beside its middle, and its sigma no
    longer says by how much. Most are peaks of noise in the light that other surfaces throw. What is
    painted as dark is as wide as the rest, and stays.
    """
    whole = own.width * own.bright
    out = np.zeros(whole.shape, dtype=np.bool_)
    have = whole[whole > 0]
    if not (thickness > 0 and len(have)):
        return out
    with np.errstate(invalid="ignore"):
        at = np.nonzero(whole < _SPENT * float(np.median(have)))
    if len(at[0]):
        due = _due(_facing(light, at)[0], thickness, due_on)
        out[at] = own.width[at] < _HALF * due
    return out


def strays(light: LitPoints, thickness: float, due_on: Callable[[Floats], Floats]) -> Bools:
    """(s, n) True in stretches of profiles with a twentieth of the usual peak at most, where most
    stripes are far narrower or far wider than a whole one on a surface that faces the camera.

    Where the sheet passes between the teeth of a gear, nothing is lit but what they throw on each
    other: a wide glow, and peaks of noise in it. In coarse steps no profile beside says how wide a
    stripe is due there. What is painted as dark is as wide as the rest, and stays.
    """
    out = np.zeros(light.width.shape, dtype=np.bool_)
    have = light.amplitude[light.width > 0]
    if not (thickness > 0 and len(have)):
        return out
    with np.errstate(invalid="ignore"):
        faint = (light.width > 0) & (light.amplitude < _STRAY * float(np.median(have)))
    at = np.nonzero(faint)
    if len(at[0]):
        part = light.width[at] / _due(_facing(light, at)[0], thickness, due_on)
        out[at] = (part < _ODD[0]) | (part > _ODD[1])
    return runs_of(out, faint)


def afore(light: LitPoints, thickness: float) -> Bools:
    """(s, n) True where no more than a twentieth is left of the peaks on the same line of both
    profiles beside, and the point stands in front of both.

    No edge between them cuts its stripe so much and leaves it there: it is what they throw on
    something else. What is painted as dark lies between them, and in a hole behind them.
    """
    out = np.zeros(light.width.shape, dtype=np.bool_)
    if not thickness > 0:
        return out
    bright, size = light.amplitude, len(out)
    with np.errstate(invalid="ignore"):
        lit = np.minimum(np.roll(bright, 1, axis=0), np.roll(bright, -1, axis=0))
        faint = bright < _STRAY * lit
    if not light.closed:
        faint[[0, -1]] = False
    turn = np.abs(np.angle(np.exp(1j * (np.roll(light.angles, -1) - light.angles))))
    far = turn > _NEXT * np.median(turn)
    faint[far | np.roll(far, 1)] = False  # frames are missing there
    step, line = np.nonzero(faint)
    X = light.points[step, line]
    sight = light.eyes[step] - X
    sight /= np.linalg.norm(sight, axis=1, keepdims=True)
    front = [
        np.einsum("ki,ki->k", X - light.points[(step + way) % size, line], sight) for way in (-1, 1)
    ]
    out[step, line] = np.minimum(*front) > _AFORE * thickness
    return out


def runs_of(glow: Bools, dim: Bools) -> Bools:
    """(s, n) True for the runs of ``dim`` points along profiles most of which ``glow``.

    Where little of such light is left it is narrow, too; and a few wide stripes among many that are
    dim are chance, on a surface that light grazes.
    """
    start = dim & ~np.pad(dim, ((0, 0), (1, 0)))[:, :-1]
    run = np.where(dim, np.cumsum(start.ravel()).reshape(dim.shape), 0)
    most = 2 * np.bincount(run[glow & dim], minlength=int(run.max()) + 1) > np.bincount(run.ravel())
    return np.asarray(dim & most[run])
