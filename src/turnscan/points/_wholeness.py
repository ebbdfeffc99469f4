"""How whole the light of each point was: cut at an edge, on two surfaces, or as it should be.

A stripe is as wide as its sheet is thick on the surface that it lies on. Where it is narrower,
something cuts it off; where it is wider, it lies on more than one surface. Either way its centre
is off the surface, and by more than noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.points._creased import (
    KNOWN,
    MODEL,
    REACH,
    STEPS,
    Creased,
    Widths,
    creased,
    fineness,
)
from turnscan.points._cut import NOISE, by_light, by_width, lacking
from turnscan.points._due_width import SMOOTH, due_width
from turnscan.points._lit_points import LitPoints
from turnscan.points._lopsided import by_skew
from turnscan.points._own_light import (
    GLOW_LIGHT,
    Alone,
    Own,
    afore,
    by_own_light,
    runs_of,
    spent,
    strays,
)
from turnscan.points._width_share import share_by_width
from turnscan.threads import in_parts

_SURE = 0.15
"""Difference of a width and its due, as a part beyond `NOISE`, up to which the stripe is whole:
noise of the points, through the planes that they make, and curvature make as much of it."""
_SURE_END = 0.09
"""The same where what is seen ends: there something is known to be that may cut it."""
_LONG = 0.6
"""Part of a step that the sheet reaches over, below which a point that is off tilts its chord by so
little that what is due on that is believed of a wide stripe where the surface ends."""
_CUT = 0.85
"""A stripe where what is seen ends is cut when it is narrower than this part of its due …"""
_HALF = 0.6
"""… and not narrower than this: a cut at the very middle leaves so much."""
_FAINT, _AS_BRIGHT = 0.6, 0.95
"""A stripe there is a tail when it is fainter than this part of the one beside it; the second where
it is narrower than any cut makes it."""
_ALIKE = 1.35
"""Bends of three profiles in a row that differ by no more than this factor are one round surface.
A crease bends one profile, or two unlike."""
_TORN = 0.5
"""Part of the larger of two biases that counts, where the profiles on either side say two."""
_USUAL = 0.5
"""Part of how far a cut or a second surface may move a centre by which it usually does, where the
surface goes on to both sides."""
_PINCHED = 0.8
"""A stripe narrower than this part of those beside it, and fainter, is cut off."""
_GLOW_WIDTH, _GLOW_FLUX = 3.0, 0.5
"""Light of other surfaces, without a stripe in it, is so many times as wide as a stripe is due
there, and all of its light is such a part of the usual stripe's at most; its brightness is
`GLOW_LIGHT` of it. The first and that are those by which a picture drops it beside stripes
(`stripes._choice.drop_glow`)."""
_ABOUT, _FAR_ABOUT = 12.0, 40.0
"""Thicknesses of the sheet to either side in which the usual width of a profile is that of whole
stripes: most veils are shorter than the first; in a pocket a whole stretch of a profile is one …"""
_SURE_FAR = 0.2
"""… and so far off, stripes that are fainter as well are cut where they differ by more."""
_DIPS, _DIM = 2, 0.5
"""Lines to either side that tell how much light there is beside a stripe, and the part of it with
less of which the stripe is taken for one that lies on none of the surfaces there."""
_FEWEST_LINES, _MOST_LINES = 4, 200
"""Lines that such a stretch is long to either side, at least and at most."""
_FAINT_BETWEEN, _SURE_BETWEEN = 0.75, 0.25
"""Part of the light that profiles on either side have, with less of which narrow stripes are
doubted, and by how much of their width these differ then."""
_REACHED = 4.0
"""Thicknesses, rms, of the sheet that are all of it: over longer steps no profile lies between two
that see the one and the other side of an edge."""
_TILTED = 4.0
"""Noises that a neighbour lies off at least, so that it tells how the surface lies."""
_TOGETHER = 64
"""Steps whose widths are judged at a time."""
_STRETCH = 0.6
"""Part of what the lines beside one are doubted or put back by that it is doubted by."""


@dataclass(frozen=True)
class Wholeness:
    """What the light of each point says of it."""

    shift: Floats
    """(s, n) px by which the centre of a cut stripe, or of one on two surfaces, lies off that of a
    whole one; 0 elsewhere."""
    doubt: Floats
    """(s, n) px: standard uncertainty of the centre because of what cuts or bends the stripe."""
    tail: Bools
    """(s, n) True where the sheet's middle passes beside the surface: its tail alone is seen."""
    glow: Bools
    """(s, n) True where no stripe is seen, but light that other surfaces throw there."""
    slide: Floats
    """(s, n) the share of a turn's movement that leads off the surface, 0 to 1; 1 where it is not
    known how the surface lies."""
    near: Bools
    """(s, n) True where the sheet, as thick as widths say or else the rig, reaches over a step:
    what cuts the stripes of profiles on both sides there cuts those between them."""
    thickness: float
    """mm rms of the sheet, as the stripes' widths say; 0 where no slopes tell it from a blur, or
    where something else makes them."""
    share: Floats
    """(s, n) `share_by_width`."""


def wholeness(light: LitPoints) -> Wholeness:
    """Compare each stripe's width with what is due on a surface that lies like its own.

    How the surface lies is known by the profiles before and after. What is narrower and fainter
    than both is doubted (`_pinched`); what lies on a crease is put back as far as both sides of it
    tell, and doubted (`creased`). Where both are there, the one that explains the width better
    counts, and the other as far as `_TORN` and the sheet's reach over the step; where the surface
    is round, what lies between them. Where one of them is missing, what ends the surface there cuts
    the stripe, too: the light that is left is a Gaussian cut off on that side, which tells how far
    its centre is off. In steps longer than a few thicknesses of the sheet that is doubt alone, and
    no centre is moved. A stripe that is much fainter there than on the surface beside is the tail
    of one whose middle passes by.
    What is narrower near any end than the stripes further in is doubted, too (`_ended`), what is
    narrower than most of its profile about it (`_narrow`), and what is much fainter than the lines
    (`_dips`) or narrower and fainter than the profiles on either side (`_faint_between`). No edge
    cuts what is alike on both sides (`by_skew`): that excuses what the profiles beside and the
    stripe's own light say, and what is faint between others, but is bright. By chance
    one line of a doubted stretch looks well, or one of a stretch that is put back stays; it is
    doubted by a part of what those about it are, or are put back by.
    """
    found = ~np.isnan(light.points[..., 0])
    width = _steady(np.where(found, light.width, np.nan))
    bright = _steady(np.where(found, light.amplitude, np.nan))
    arcs = light.arcs
    own, thickness, still, cut = _lying(light, found, width, bright, arcs)
    sizes = apart_along(light.points), thickness
    more = np.maximum(_ended(light, width, arcs, still, sizes), _narrow(width, bright, sizes))
    more = np.maximum(more, _dips(light.width * light.amplitude, width))
    faint = _faint_between(width, width * bright, arcs, thickness, light.closed)
    more = np.maximum(more, np.where(_bright(bright), cut, 1.0) * faint)
    doubt = np.maximum(own.doubt, more - np.abs(own.shift))
    about = np.fmax(_steady(np.where(found, doubt, np.nan)), _otherwise(own.shift, found))
    return replace(own, doubt=np.fmax(doubt, _STRETCH * about))


def _bright(light: Floats) -> Bools:
    """(s, n) True where there is no less than half of the usual light."""
    known = light[~np.isnan(light)]
    with np.errstate(invalid="ignore"):
        return np.asarray(light >= _DIM * (float(np.median(known)) if len(known) else 0.0))


def _otherwise(shift: Floats, found: Bools) -> Floats:
    """(s, n) px: by how much at most one of the two lines to either side of one that stays where it
    is was put back."""
    moved = np.pad(np.where(found, np.abs(shift), 0.0), ((0, 0), (2, 2)))
    n = shift.shape[1]
    beside = np.max([moved[:, k : k + n] for k in (0, 1, 3, 4)], axis=0)
    return np.where(shift == 0.0, beside, 0.0)


def _lying(
    light: LitPoints, found: Bools, width: Floats, bright: Floats, arcs: Floats
) -> tuple[Wholeness, float, Bools, Floats]:
    """What the surface's slopes say of the stripes, as wide (s, n) px and bright (s, n) grey levels
    as they are about each; the sheet's thickness, mm, or what is taken for it; True (s, n) for
    points that no turn moves; and which part (s, n) of a doubt for its width or light each may be
    off by (`BySkew.part`)."""
    from turnscan.points import _wholeness_kernels as kernels

    walk, slide, side = _along_steps(kernels.across, light, arcs, (3, 2, *found.shape))
    slide = np.where(np.isnan(slide).all(axis=0), 1.0, np.fmax(slide[0], slide[1]))
    side = side.copy()  # not a part of all three, which would be kept with it
    walk = np.stack([_steady(w) for w in walk])
    due_on = due_width(walk, width, light.stated)
    thickness = due_on.thickness
    flat = _along_steps(kernels.further_in, light, arcs, walk.shape, 1)
    flat = np.stack([_steady(w) for w in flat])
    bent = creased(
        Widths(width, bright, walk, side, arcs),
        thickness,
        lambda far: _apart(light, arcs, due_on, far) if far else _differ(due_on(walk)),
        lambda far, first, end: _folded(light, arcs, (thickness, far), (first, end)),
    )
    fine = fineness(arcs, thickness)
    goes_on = _going_on(light, arcs)
    dim = _dim(width, bright, found)
    glow = np.zeros_like(found)
    shift, doubt = np.empty(width.shape), np.empty(width.shape)
    tail = np.empty(width.shape, dtype=np.bool_)
    size = len(width)

    def part(a: int, b: int) -> None:
        rows = np.arange(a - 1, b + 1) % size  # those before and after are looked at as well
        beyond = not light.closed and a == 0, not light.closed and b == size
        wide = np.arange(a - 1 - STEPS, b + 1 + STEPS) % size
        curved = _round(walk[:, wide], arcs[wide], thickness)[STEPS:-STEPS]
        some = _Band(
            width[rows],
            walk[:, rows],
            flat[:, rows],
            curved,
            side[:, rows],
            bright[rows],
            found[rows],
            fine[rows],
            goes_on[rows],
            beyond,
        )
        *own, ratio = _judged(some, due_on, bent if bent is None else bent.some(rows))
        shift[a:b], doubt[a:b], tail[a:b] = (v[1:-1] for v in own)
        with np.errstate(invalid="ignore"):
            glow[a:b] = dim[a:b] & (np.fmin(*ratio)[1:-1] > _GLOW_WIDTH)

    in_parts(part, size, -(-size // _TOGETHER))
    lit = Own(width, bright, walk)
    glow = runs_of(glow, dim) | spent(light, lit, thickness, due_on)
    glow |= strays(light, thickness, due_on) | afore(light, thickness)
    still = np.isinf(walk).any(axis=0)
    ends = np.isnan(walk[::-1]) & ~np.isnan(walk)
    lone = (np.isnan(walk).all(axis=0) | (ends & np.isnan(flat)).any(axis=0)) & ~still
    agree = _agree(walk)
    blind = (fine < KNOWN) & (~agree | (doubt > 0)) & ~still
    alone = Alone(lone, still, blind, agree)
    doubt = by_own_light(light, lit, doubt, alone, thickness, due_on)
    shift, doubt, cut = by_skew(light, lit, (shift, doubt), thickness, due_on)
    seen = thickness if due_on.told else 0.0
    # Where widths do not tell how far the light reaches over an edge, what the rig says counts.
    reach = seen or light.stated
    near = (fineness(arcs, reach) >= 1.0) & (reach > 0)
    leaning = share_by_width(light, due_on.walk_of(width))
    own = Wholeness(shift, doubt, tail, glow, slide, near, seen, leaning)
    return own, thickness, still, cut


def _going_on(light: LitPoints, arcs: Floats) -> Bools:
    """What the kernel `straight_beyond` writes of all steps, in parts."""
    from turnscan.points import _wholeness_kernels as kernels

    out = np.zeros(arcs.shape, dtype=np.bool_)
    places = light.points, arcs, light.closed
    in_parts(lambda a, b: kernels.straight_beyond(*places, (a, b), out), len(out))
    return out


def _dim(width: Floats, light: Floats, found: Bools) -> Bools:
    """(s, n) True where there is much less light than usual, at its peak and in all."""
    some = found & (width > 0)
    if not some.any():
        return np.zeros_like(found)
    whole = width * light
    with np.errstate(invalid="ignore"):
        faint = light < GLOW_LIGHT * float(np.median(light[some]))
        return np.asarray(faint & (whole < _GLOW_FLUX * float(np.median(whole[some]))))


class _Band(NamedTuple):
    """Some steps of a grid, with the one before and the one after."""

    width: Floats
    walk: Floats
    flat: Floats
    """(2, s, n) mm: the walk on a surface that goes on flat from further in."""
    curved: Bools
    """(s, n) True on a round surface (`_round`)."""
    side: Floats
    light: Floats
    found: Bools
    fine: Floats
    """(s, n) how much of a step the sheet reaches over (`fineness`)."""
    goes_on: Bools
    """(s, n) True where the surface leads straight on beyond a long step (`straight_beyond`)."""
    beyond: tuple[bool, bool]
    """Whether the grid ends with them, so that there is no step before, or after."""


def _judged(
    some: _Band, due_on: Callable[[Floats], Floats], bent: Creased | None
) -> tuple[Floats, Floats, Bools, Floats]:
    """Shift, doubt and tail, as `Wholeness` has them, of a band, and (2, s, n) which part of its
    due each width is; not of its first and last step."""
    width, walk = some.width, some.walk
    due = due_on(walk)
    curved = some.curved
    due = np.where(curved, np.sqrt(due[0] * due[1]), due)
    # What cuts a stripe moves its point, and so tilts the plane through it and the one beside. The
    # surface may go on flat, or turn with the table as round parts do: what lies between is taken.
    # Over a step that is long beside the sheet the point tilts its plane little.
    ends = np.isnan(walk[::-1]) & ~np.isnan(walk)
    turned = np.stack([np.roll(walk[0], -1, axis=0), np.roll(walk[1], 1, axis=0)])
    inner = np.stack([due_on(some.flat), due_on(turned)])
    known = some.fine >= KNOWN
    share = np.where(known, 1.0, some.fine)
    inner = np.exp((1 - share) * np.log(due) + share * np.log(inner).mean(axis=0))
    own = width / due
    due = np.where(ends & ~np.isnan(inner), inner, due)
    ratio = width / due
    # A cut makes none wider: one that is as wide as is due on its chord lies as that does, where
    # the line leads straight on, or the step is long.
    alike = (some.goes_on | (some.fine < _LONG)) & (ratio > 1.0) & (np.abs(own - 1.0) <= SMOOTH)
    ratio, due = np.where(alike, own, ratio), np.where(alike, width / own, due)
    border = np.isnan(walk[0]) != np.isnan(walk[1])
    border &= some.found & ~np.isnan(ratio).all(axis=0)
    bias = by_width(ratio, np.where(border, _SURE_END, _SURE))
    # Over a long step the chord that says what is due may run on to another face: what is wider
    # than that lies on two surfaces as probably as the sheet reaches over the step, and the rms of
    # what is so with a probability goes with its root.
    sure = np.sqrt(some.fine)
    bias = np.where(border & (ratio > 1.0), sure * bias, bias)
    doubt = np.nan_to_num(np.hypot(np.fmin(*bias), _TORN * some.fine * np.fmax(*bias)) * width)
    doubt = np.where(border, doubt, _USUAL * doubt)
    pulled = np.zeros(width.shape)
    if bent is not None:
        pulled = np.where(curved, 0.0, bent.shift)
        doubt = np.where(bent.settled & ~curved, 0.0, doubt)
        doubt = np.maximum(doubt, ~curved * bent.doubt)
    first, narrow = np.isnan(walk[1]), np.fmin(*ratio)
    beside = np.where(first, np.roll(some.light, -1, 0), np.roll(some.light, 1, 0))
    with np.errstate(invalid="ignore"):
        faint = some.light < np.where(narrow < _HALF, _AS_BRIGHT, _FAINT) * beside
        cut = border & ~faint & (narrow < _CUT) & (narrow >= _HALF)
    left = _left(width * some.light, first)
    off, unsure = _cut_off(bias, due * some.side, left, cut, (first, known))
    doubt = np.where(cut, unsure, doubt)
    shift = np.where(cut, np.where(known, off, 0.0), pulled)
    # As wide as it is due on one side: that it is narrow is told already, as far as that is known.
    fits = (np.abs(ratio - 1.0) <= SMOOTH).any(axis=0)
    pinched = _pinched(width, some.light, some.beyond)
    doubt = np.maximum(doubt, np.where(fits, sure, 1.0) * pinched)
    wide = width / np.clip(np.nan_to_num(narrow, nan=1.0), _HALF, 1.0)
    # Where other surfaces throw light beside it, or a second one is grazed, a cut stripe is as wide
    # as a whole one. Over a long step the profile beside may lie on another face, otherwise to the
    # light; and where a stripe has no known width, nothing is told by its light.
    less = some.fine * border * lacking(left) * wide
    doubt = np.maximum(doubt, np.nan_to_num(less) - np.abs(off))
    return shift, doubt, border & faint, ratio


def _left(flux: Floats, first: Bools) -> Floats:
    """(s, n) how much light a stripe has of what the profile beside has, that after it where it is
    the ``first``."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(flux / np.where(first, np.roll(flux, -1, 0), np.roll(flux, 1, 0)))


def _cut_off(
    bias: Floats, due: Floats, left: Floats, cut: Bools, which: tuple[Bools, Bools]
) -> tuple[Floats, Floats]:
    """(s, n) px by which ``cut`` stripes are off, and that stays doubted of it; 0 for the others.

    A Gaussian that is cut is narrower and has less light, and each tells how much is gone: the
    width as ``bias`` (2, s, n), in due widths, says, the light by what is ``left`` (s, n) of that
    beside. Noise makes either wrong by itself, and by more, the narrower the stripe; so the mean
    counts. ``due`` (2, s, n) px are the due widths, to the side where the surface goes on.
    ``which`` says where the surface goes on with the next profile, and where the profiles beside
    are near enough to tell how bright it is; over longer steps the width alone counts.
    """
    first, near = which
    of_width = np.where(first, bias[0], bias[1])
    of_light = np.where(near & ~np.isnan(left), by_light(left), of_width)
    scale = np.where(cut, np.where(first, due[0], due[1]), 0.0)
    off = np.nan_to_num(scale * 0.5 * (of_width + of_light))
    apart = np.nan_to_num(scale * (of_width - of_light))
    return off, MODEL * np.maximum(np.abs(off), np.abs(apart))


def _steady(width: Floats) -> Floats:
    """The kernel of that name, in parts."""
    from turnscan.points import _wholeness_kernels as kernels

    return np.concatenate(in_parts(lambda a, b: kernels.steady(width[a:b]), len(width)))


def _along_steps(
    kernel: Callable[..., None],
    light: LitPoints,
    arcs: Floats,
    shape: tuple[int, ...],
    *more: int,
) -> Floats:
    """What `across` or `further_in` writes of all steps, in parts."""
    out, least = np.empty(shape), _TILTED * light.noise

    def part(first: int, end: int) -> None:
        span = (first, end)
        out[..., first:end, :] = np.nan
        places = light.points, light.eyes, light.moves, light.sheets, arcs
        kernel(*places, least, light.closed, span, out, *more)

    in_parts(part, len(light.points))
    return out


def _ended(
    light: LitPoints, steadied: Floats, arcs: Floats, still: Bools, sizes: tuple[float, float]
) -> Floats:
    """(s, n) px that stripes may be off which are narrower, near an end of what is seen, than those
    further in: something cuts them there.

    Where that goes on from profile to profile, the cut stripes make a surface of their own, which
    runs along the rays to the edge, and their width is due on it. Stripes further in know better.
    Where no turn moves a point (``still`` (s, n)), those of other profiles are the same place,
    turned otherwise to the light. ``sizes`` mm: how far points of a profile usually are from each
    other, and how thick the sheet.
    """
    from turnscan.points import _end_kernels as kernels

    if not min(sizes) > 0:
        return np.zeros_like(steadied)
    out = np.empty((2, *light.width.shape))

    def part(first: int, end: int) -> None:
        places = light.points, light.eyes, light.sheets, arcs
        span = first, end
        out[:, first:end] = np.nan
        kernels.whole_widths(places, (light.width, steadied), still, sizes, light.closed, span, out)

    in_parts(part, len(steadied))
    return np.asarray(np.nan_to_num(by_width(np.minimum(out[0] / out[1], 1.0), _SURE_END) * out[1]))


def _narrow(steadied: Floats, light: Floats, sizes: tuple[float, float]) -> Floats:
    """(s, n) px that stripes may be off which are narrower than most of their profile about them.

    A veil, the stripes that an edge cuts from line to line on the way from a near surface to one
    behind it, runs along the rays, and stripes are due to be as narrow as they are on it. Nothing
    ends there either. A surface that is so steep is rare, and is known no better. Where the veil is
    longer than what is looked at, a longer stretch tells: what lies more squarely to the light
    there is narrower, but brighter (``light`` (s, n) grey levels), and what is cut is fainter.
    ``sizes`` as those of `_ended`.
    """
    from turnscan.points import _wholeness_kernels as kernels

    if not min(sizes) > 0:
        return np.zeros_like(steadied)
    near, far = (
        int(np.clip(about * sizes[1] / sizes[0], _FEWEST_LINES, _MOST_LINES))
        for about in (_ABOUT, _FAR_ABOUT)
    )

    def part(first: int, end: int) -> Floats:
        own, bright = steadied[first:end], light[first:end]
        out = np.zeros_like(own)
        for usual, sure, some in (
            (kernels.usual(own, near), _SURE_END, True),
            (kernels.usual(own, far), _SURE_FAR, bright < _FAINT * kernels.usual(bright, far)),
        ):
            off = by_width(np.minimum(own / usual, 1.0), sure) * usual
            out = np.maximum(out, np.nan_to_num(off) * some)
        return out

    return np.concatenate(in_parts(part, len(steadied), -(-len(steadied) // _TOGETHER)))


def _faint_between(
    width: Floats, flux: Floats, arcs: Floats, thickness: float, closed: bool
) -> Floats:
    """(s, n) px that stripes may be off which are narrower than those of the profiles on either
    side, and have less light (``flux`` (s, n)): each than the median of a stretch of profiles.

    Where the sheet passes an edge before something further behind, it lights both for some steps,
    and the centre goes from the one to the other through the air. Chords along that way say of each
    of these stripes that it is as narrow as is due. Faces so narrow, and seen so badly, are rare.
    Nothing of the kind where a step (``arcs`` (s, n) mm) leads out of the sheet.
    """
    from turnscan.points import _wholeness_kernels as kernels

    size, lines = width.shape
    usual = float(np.median(arcs[arcs > 0])) if (arcs > 0).any() else 0.0
    if not min(usual, thickness) > 0 or size < 4:
        return np.zeros_like(width)
    far = int(np.clip(_ABOUT * thickness / usual, _FEWEST_LINES, _MOST_LINES))
    far = min(far, size // 4)
    rows = np.arange(-far, size + far)
    beyond = np.zeros(len(rows), dtype=np.bool_) if closed else (rows < 0) | (rows >= size)

    def beside(value: Floats) -> Floats:
        some = value[rows % size]
        some[beyond] = np.nan
        return kernels.usual_beside(np.ascontiguousarray(some.T), far).T[far : far + size]

    def part(first: int, end: int) -> Floats:
        own, light = width[:, first:end], flux[:, first:end]
        due = beside(own)
        with np.errstate(invalid="ignore"):
            faint = light < _FAINT_BETWEEN * beside(light)
            faint &= arcs[:, first:end] < _REACHED * thickness
            off = by_width(np.minimum(own / due, 1.0), _SURE_BETWEEN) * due
        return np.asarray(np.nan_to_num(off) * faint)

    return np.concatenate(in_parts(part, lines, -(-lines // _TOGETHER)), axis=1)


def _dips(flux: Floats, steadied: Floats) -> Floats:
    """(s, n) px that stripes may be off which have less than half of the light (s, n) that there is
    on either side of them in their profile.

    A line of pixels that an edge across the profile crosses sees some of the light of a near
    surface and some of that behind it; its centre lies in the air between. Nothing is narrow there.
    """
    sides = np.full((2, *flux.shape), np.nan)
    for far in range(1, _DIPS + 1):
        sides[0, :, far:] = np.fmax(sides[0, :, far:], flux[:, :-far])
        sides[1, :, :-far] = np.fmax(sides[1, :, :-far], flux[:, far:])
    with np.errstate(invalid="ignore", divide="ignore"):
        left = flux / np.minimum(*sides)
        return np.where(left < _DIM, lacking(left) * steadied, 0.0)


def apart_along(points: Floats) -> float:
    """mm: how far points of a profile (s, n, 3) usually lie apart; 0 where there are none."""
    parts = -(-len(points) // _TOGETHER)
    gaps = np.concatenate(in_parts(lambda a, b: _gaps(points[a:b]), len(points), parts))
    return float(np.median(gaps)) if len(gaps) else 0.0


def _gaps(points: Floats) -> Floats:
    """(m,) mm between neighbours along their profiles (s, n, 3), those that there are."""
    gaps = np.linalg.norm(np.diff(points, axis=1), axis=-1)
    return np.asarray(gaps[~np.isnan(gaps)])


def _agree(walk: Floats) -> Bools:
    """(s, n) True where chords to the profiles before and after lie alike to the light, as far as a
    coarse turn about a round part leaves them alike."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.abs(np.log(walk[0] / walk[1])) <= 2 * SMOOTH)


def _round(walk: Floats, arcs: Floats, thickness: float) -> Bools:
    """(s, n) True where the profiles about a point bend alike, and one way: it is on no crease.

    In coarse steps the chords before and after lie unlike there, and neither as the surface does.
    A crease bends all profiles in whose sheet it lies, and by chance alike: more must.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        bend = np.log(walk[0] / walk[1])
        reach = np.nan_to_num(REACH * thickness / arcs)
    sign, size = np.sign(bend), np.abs(bend)
    least, most, one_way = size, size, ~np.isnan(bend)
    for far in range(1, STEPS + 1):
        # Beside one, and beyond those that the sheet at the point reaches.
        asked = reach > far - 1 if far > 1 else np.ones_like(one_way)
        if not asked.any():
            break
        for way in (far, -far):
            one_way = one_way & (~asked | (np.roll(sign, way, axis=0) == sign))
            beside = np.where(asked, np.roll(size, way, axis=0), size)
            least, most = np.minimum(least, beside), np.maximum(most, beside)
    with np.errstate(invalid="ignore"):
        return np.asarray(one_way & (sign != 0) & (most <= _ALIKE * least))


def _pinched(width: Floats, amplitude: Floats, beyond: tuple[bool, bool]) -> Floats:
    """(s, n) px that stripes may be off which are narrower than those of the profiles before and
    after, and fainter: something cuts them off, on both sides or on one. The first and the last
    step are those beside a band, and not there where the grid ends.

    What lies more squarely to the light is narrower, too, but brighter. Where the middle of the
    light falls is not known then but for its width.
    """
    about = [np.stack([np.roll(v, 1, axis=0), np.roll(v, -1, axis=0)]) for v in (width, amplitude)]
    for v in about:
        if beyond[0]:
            v[0, 1] = np.nan
        if beyond[1]:
            v[1, -2] = np.nan
    with np.errstate(invalid="ignore"):
        narrow = width < _PINCHED * np.minimum(*about[0])
        dark = amplitude < _PINCHED * np.maximum(*about[1])
        return np.nan_to_num(np.where(narrow & dark, np.maximum(*about[0]), 0.0))


def _folded(
    light: LitPoints, arcs: Floats, sheet: tuple[float, int], span: tuple[int, int]
) -> Floats:
    """What the kernel of that name writes of a span of steps."""
    from turnscan.points import _wholeness_kernels as kernels

    out = np.full((5, span[1] - span[0], arcs.shape[1]), np.nan)
    places = light.points, light.eyes, light.moves, light.sheets, arcs
    kernels.folded(*places, _TILTED * light.noise, light.closed, span, out, sheet)
    return out


def _apart(light: LitPoints, arcs: Floats, due_on: Callable[[Floats], Floats], far: int) -> Floats:
    """(s, n) px: how much wider a stripe is due on the one of two surfaces than on the other, those
    that lie ``far`` steps before and after; NaN where one is not known."""
    from turnscan.points import _wholeness_kernels as kernels

    walk = _along_steps(kernels.further_in, light, arcs, (2, *light.width.shape), far)
    out = np.empty(light.width.shape)

    def part(a: int, b: int) -> None:
        out[a:b] = _differ(due_on(np.stack([kernels.steady(w[a:b]) for w in walk])))

    in_parts(part, len(out), -(-len(out) // _TOGETHER))
    return out


def _differ(due: Floats) -> Floats:
    """(s, n) px: by how much more than noise two widths (2, s, n) px differ."""
    with np.errstate(invalid="ignore"):
        noise = NOISE * (due[0] + due[1])
        return np.asarray(np.sqrt(np.maximum((due[0] - due[1]) ** 2 - noise**2, 0.0)))
