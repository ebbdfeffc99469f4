"""Stripes that lie on two surfaces which meet under the sheet: how far their centres are off.

Each surface draws the sheet out to a width of its own, and sends as much of its light to the camera
as it faces it. The centre is pulled to the surface that is the wider and the brighter of the two.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats
from turnscan.points._cut import NOISE
from turnscan.threads import in_parts

REACH = 2.5
"""Thicknesses of the sheet beyond which a surface no longer adds to a stripe."""
STEPS = 6
"""Steps to either side that are looked at, at most."""
KNOWN = 0.3
"""Part of a step that the sheet reaches over from which on the profiles beside tell how the surface
lies. Over longer steps they may lie on other faces, and no centre is moved."""
MODEL = 0.5
"""Part of a centre's shift that is doubted: by the second laser's and the true surface."""
_CREASE = 0.4
"""Where a stripe lies on two surfaces half and half, its centre is off by this part of the
difference of the widths that it has on either, if both are as bright: 1/√(2π)."""
_SETTLED = 0.5
"""Part of the difference of the widths on either side of a crease that the next ones may differ by,
where the two are those of whole stripes."""
_BESIDE = 1.5
"""Thicknesses of the sheet beside a crease from which on a stripe lies on one surface alone."""
_UNLIKE = 5.0
"""A surface is so many times as bright as the other at most; beyond that it is no stripe."""
_TOGETHER = 64
"""Steps whose widths are judged at a time."""
_SHARP = 0.4
"""Part of how much the surface bends, a step, within what the sheet reaches, that it may bend
beyond it, to one side at least: a round one goes on to bend, a crease does not. In finer steps
more profiles say whether it is round."""


@dataclass(frozen=True)
class Widths:
    """Stripes, as wide and bright as they are about each, and how their surfaces lie."""

    width: Floats
    """(s, n) px."""
    bright: Floats
    """(s, n) grey levels."""
    walk: Floats
    """(2, s, n) and …"""
    side: Floats
    """… (2, s, n), as `_wholeness_kernels.across` writes them."""
    arcs: Floats
    """(s, n) mm: the way of each point from step to step."""


class Creased(NamedTuple):
    """What lying on two surfaces does to the centres of stripes."""

    shift: Floats
    """(s, n) px by which a centre is off; 0 where it is not known."""
    doubt: Floats
    """(s, n) px, one standard uncertainty."""
    settled: Bools
    """(s, n) True where the widths and the surfaces beside both tell the shift: what else the width
    may say of the point is told by it."""

    def some(self, rows: npt.NDArray[np.intp]) -> Creased:
        """Those of some steps."""
        return Creased(self.shift[rows], self.doubt[rows], self.settled[rows])


def creased(
    of: Widths,
    thickness: float,
    apart: Callable[[int], Floats],
    folded: Callable[[int, int, int], Floats],
) -> Creased | None:
    """How far stripes are off as they lie on two surfaces that meet under the sheet; None where the
    sheet's ``thickness``, mm, is not known.

    What lies on both has a width between the two (`_pulls`). How far it has come from the one to
    the other tells where they meet, and so do the surfaces beside if they go on flat: ``folded``
    gives what `_wholeness_kernels.folded` says of those so many steps off, for the steps from one
    to before another. The mean of both counts, and their difference is doubted. Where the surfaces
    beside are not known or go on to bend (`_sharp`), and over long steps (`KNOWN`), nothing is
    moved. The centre may be off by as much as 4 f (1 − f) of the most, f being that way. Profiles
    are looked at as far off as the sheet reaches, over what is linked. A surface that goes on flat
    changes its width, too, as the table turns it to the light: no more counts than ``apart`` (s, n)
    px says of the surfaces so many steps off, in the light of the point's own step. Where the
    surface ends before these, the nearest that are known count; and beyond what the sheet reaches
    no more than the chords to both sides of the point, ``apart`` of 0 steps: a crease that is not
    between the two profiles beside it is too far off.
    """
    if not thickness > 0:
        return None
    width, walk = of.width, of.walk
    usual = max(float(np.nanmedian(of.arcs)), 1e-9)
    most = max(min(int(np.ceil(REACH * thickness / usual)), STEPS), 1)
    clear = min(max(int(np.ceil(_BESIDE * thickness / usual)), 1), most)
    unsure, back = np.zeros_like(width), np.zeros((2, *width.shape))
    sides = [width.copy(), width.copy()]
    held = [np.ones(width.shape, np.bool_), np.ones(width.shape, np.bool_)]
    # What no turn moves has the same surface beside it in every profile.
    turned = ~np.isinf(walk).any(axis=0)
    chords = differ = apart(0)
    for far in range(1, most + 1):
        for way, sign in ((0, 1), (1, -1)):
            linked = ~np.isnan(np.roll(walk[way], -sign * (far - 1), axis=0))
            beside = np.roll(width, -sign * far, axis=0)
            held[way] &= linked & ~np.isnan(beside)
            sides[way] = np.where(held[way], beside, sides[way])
        there, beyond = apart(far), far * of.arcs > REACH * thickness
        differ = np.where(np.isnan(there), differ, there)
        differ = np.where(beyond, np.fmin(differ, chords), differ)
        _raise(unsure, width, sides, held, differ)
        if far == clear:
            fine = fineness(of.arcs, thickness)
            sure = _whole_beside(width, clear) & _sharp(walk, clear)
            known = (fine >= 1.0) | (fine >= KNOWN) & sure
            known &= held[0] & held[1] & turned
            back = _put_back(of, known, differ, clear, folded)
    shift, own = back
    settled = shift != 0.0
    return Creased(shift, np.where(settled, own, np.where(turned, unsure, 0.0)), settled)


def _put_back(
    of: Widths, known: Bools, apart: Floats, far: int, folded: Callable[[int, int, int], Floats]
) -> Floats:
    """(2, s, n) px that stripes are off, and that stays doubted, by the mean of what the widths
    and the planes ``far`` steps off tell; 0 where one of them tells nothing."""
    out = np.zeros((2, *of.width.shape))

    def part(a: int, b: int) -> None:
        planes = folded(far, a, b)
        at = np.nonzero(known[a:b] & ~np.isnan(planes[0]))
        rows = (at[0] + a, at[1])
        pulled = _pulls(of, far, rows, planes[:, at[0], at[1]], apart[rows])
        told = np.where(pulled != 0.0, planes[0][at], 0.0)
        out[0][rows] = shift = 0.5 * (pulled + told)
        out[1][rows] = np.hypot(MODEL * (pulled - told), MODEL * shift)

    in_parts(part, len(known), -(-len(known) // _TOGETHER))
    return out


def fineness(arcs: Floats, thickness: float) -> Floats:
    """(s, n) the part of a step that the sheet reaches over, 1 at most; 1 where the sheet's
    thickness is not known.

    A surface that begins further off than that adds nothing to a stripe.
    """
    if not thickness > 0:
        return np.ones_like(arcs)
    return np.asarray(np.nan_to_num(np.minimum(REACH * thickness / arcs, 1.0), nan=1.0))


def _whole_beside(width: Floats, far: int) -> Bools:
    """(s, n) True where stripes ``far`` steps before and after are about as wide as those next to
    them, for how much the two differ: each lies on one surface, not on its way to yet another."""
    one, beyond = np.roll(width, -far, axis=0), np.roll(width, -far - 1, axis=0)
    other, before = np.roll(width, far, axis=0), np.roll(width, far + 1, axis=0)
    with np.errstate(invalid="ignore"):
        most = _SETTLED * np.abs(one - other)
        return np.asarray(~((np.abs(beyond - one) > most) | (np.abs(before - other) > most)))


def _sharp(walk: Floats, far: int) -> Bools:
    """(s, n) True where the surface bends within ``far`` steps to both sides of a point, and goes
    on flat beyond them, to one side at least, as the ``walk`` of each point says."""
    with np.errstate(invalid="ignore", divide="ignore"):
        bend = np.log(walk[0] / walk[1])
        beyond = np.fmin(*(np.abs(np.roll(bend, k, axis=0)) for k in (far + 1, -far - 1)))
        here = np.abs(sum(np.roll(bend, k, axis=0) for k in range(-far, far + 1)))
        return np.asarray(~(beyond > _SHARP * here / (2 * far + 1)))


def _raise(
    out: Floats, width: Floats, sides: list[Floats], held: list[Bools], apart: Floats
) -> None:
    """Make ``out`` (s, n) at least what `_between` gives where both sides are held."""

    def part(a: int, b: int) -> None:
        f, differ = _between(width[a:b], sides[0][a:b], sides[1][a:b], apart[a:b])
        f = np.where(held[0][a:b] & held[1][a:b], f, 0.0)
        out[a:b] = np.maximum(out[a:b], 4.0 * f * (1.0 - f) * _CREASE * differ)

    in_parts(part, len(width), -(-len(width) // _TOGETHER))


def _between(width: Floats, one: Floats, other: Floats, apart: Floats) -> tuple[Floats, Floats]:
    """How far stripes so wide have come from the narrower of two surfaces of these widths to the
    wider, 0 to 1, and how much they differ, px. 0 where noise may be all of it."""
    with np.errstate(invalid="ignore", divide="ignore"):
        low, high = np.minimum(one, other), np.maximum(one, other)
        noise = 2.0 * NOISE * 0.5 * (low + high)
        differ = np.sqrt(np.maximum((high - low) ** 2 - noise**2, 0.0))
        differ = np.fmin(differ, apart)
        blind = np.minimum(0.5 * noise / (high - low), 0.4)
        f = np.clip(((width - low) / (high - low) - blind) / (1 - 2 * blind), 0.0, 1.0)
        return np.nan_to_num(f), np.nan_to_num(differ)


def _pulls(
    of: Widths, far: int, at: tuple[npt.NDArray[np.intp], ...], planes: Floats, apart: Floats
) -> Floats:
    """(m,) px that stripes are off which lie on the surfaces that the profiles ``far`` steps
    before and after show; 0 where they are not as wide as something between the two.

    ``at`` are the m places, ``planes`` (5, m) what `_wholeness_kernels.folded` says of them: how
    the table turns what is beside to the light. With the sheet in units of its thickness, surfaces
    of widths a below k and b above it, the latter v times as bright, have the light Φ(k) + v Φ(−k),
    the centre and the width of two lines that meet at k (`_wholeness_kernels.crease`). The k at
    which the width is the stripe's own is taken.
    """
    beside = [((at[0] + sign * far) % len(of.width), at[1]) for sign in (1, -1)]
    one, other = (of.width[k] for k in beside)
    from turnscan.points import _wholeness_kernels as kernels

    # Beside, and as the table turns it: what is true of one alone is chance.
    bent = _some(of.width[at], one, other, apart)
    one, other = one * planes[1], other * planes[2]
    bent &= _some(of.width[at], one, other, apart)
    out = np.zeros(len(bent))
    if not bent.any():
        return out
    lit = [
        (of.width[k] * of.bright[k] * more)[bent]
        for k, more in zip(beside, planes[3:], strict=True)
    ]
    one, other, own = one[bent], other[bent], of.width[at][bent]
    first = one > other
    side = np.where(first, of.side[0][at][bent], of.side[1][at][bent])
    with np.errstate(invalid="ignore", divide="ignore"):
        v = np.where(first, lit[0] / lit[1], lit[1] / lit[0])
    v = np.clip(np.nan_to_num(v, nan=1.0), 1.0 / _UNLIKE, _UNLIKE)
    off = kernels.told_by_width(np.minimum(one, other), np.maximum(one, other), v, own)
    out[bent] = np.nan_to_num(side) * off
    return out


def _some(width: Floats, one: Floats, other: Floats, apart: Floats) -> Bools:
    """(m,) True where stripes so wide have come some of the way of `_between`."""
    f, differ = _between(width, one, other, apart)
    return np.asarray((f > 0.0) & (f < 1.0) & (differ > 0.0))
