"""What profiles have in common is the part's shape, however it looks along each: collars, a thread.

Centres scatter along a stripe by noise, and by all shape that is finer than the lines between those
that are compared. Noise is another one in each picture; the shape of a turned part is the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from turnscan.arrays import Floats
from turnscan.stripes import Stripe, StripeFlag

OF_MEDIAN = 2.5
"""Uncertainty of a variance from the median of n squares, as a part, times √n."""
_SURELY = 2.0
"""Of those by which profiles scatter less against those beside them than each along itself …"""
_FAR, _COMMON = np.pi / 8, 0.35
"""… and the turn, rad, over which less than this part of it must differ, so that it is the shape of
a turned part that they have in common: adjacent profiles may share their light, or a print."""
_BLURRED = 0.4
"""Part of what centres further apart scatter with less of which adjacent ones do where a picture is
blurred along the stripe, by its lens, its colours or JPEG. That rounds off what is turned alike in
all profiles: what they have in common is no shape alone then."""


class Scatters(NamedTuple):
    """What `Stripe.scatters` says, of many pictures."""

    values: Floats
    """(s, 3) px² for each px of width, from centres 1, 2 and 4 lines apart."""
    counts: Floats
    """(s, 3) from how many differences; 0 where they are too few to tell."""


def without_shape(
    stripes: Sequence[Stripe], own: Scatters, about: Callable[[Scatters], Scatters],
    photons: Floats, turns: Floats, closed: bool,
) -> tuple[Scatters, Floats]:  # fmt: skip
    """What ``about`` makes of the ``own`` scatters of pictures, without the shape that profiles
    have in common; and (s,) px² for each px of width what each picture says by itself, NaN where it
    has no such shape.

    ``photons`` (s,) is what photons explain, ``turns`` (s,) rad where the table stood, ``closed``
    that the last profile neighbours the first.
    """
    step = float(np.median(np.abs(np.diff(np.unwrap(turns))))) if len(turns) > 1 else _FAR
    some = _differences(stripes)
    beside = _still(*(_apart(some, len(stripes), closed, k) for k in (1, 2)))
    far = _apart(some, len(stripes), closed, max(round(_FAR / max(step, 1e-9)), 1))
    # Of pictures that can be held against those beside them, and of no others.
    paired = Scatters(own.values, np.where(beside.counts > 0, own.counts, 0.0))
    alone, whole, near, across = about(own), about(paired), about(beside), about(far)
    counts = np.maximum(np.stack([whole.counts, near.counts]), 1.0)
    unsure = _SURELY * OF_MEDIAN * np.sqrt((1.0 / counts).sum(axis=0))
    less = whole.values - near.values
    common = (near.counts > 0) & (whole.counts > 0) & (across.counts > 0)
    common &= less > unsure * (np.maximum(whole.values, 0.0) + photons[:, None])
    common &= across.values - near.values < _COMMON * less
    common &= not _blurred(near, photons)
    told = common & (beside.counts > 0)
    itself = np.where(told, beside.values, own.values).max(axis=1)
    values = np.where(common, near.values, alone.values)
    return Scatters(values, alone.counts), np.where(told.any(axis=1), itself, np.nan)


def _still(one: Scatters, two: Scatters) -> Scatters:
    """What would be left between profiles no step apart, from that between profiles one and two
    steps apart: what a thread rises on the way counts with the square of it."""
    more = np.where(two.counts > 0, np.maximum(two.values - one.values, 0.0) / 3.0, 0.0)
    return Scatters(one.values - more, one.counts)


def _blurred(near: Scatters, photons: Floats) -> bool:
    """Whether adjacent lines err alike, beside what ``photons`` (s,) explain."""
    told = near.counts[:, 0] > 0
    if not told.any():
        return True
    scatter, known = np.maximum(near.values[told], 0.0), photons[told]
    whole = known + scatter.max(axis=1)
    shown = (known + scatter[:, 0])[whole > 0] / whole[whole > 0]
    return bool(len(shown) and np.median(shown) < _BLURRED)


class _Differences(NamedTuple):
    """Third differences along stripes, NaN across a gap or a line that does not count, and the same
    sums of what explains them; (s, m) each."""

    third: Floats
    """px."""
    explained: Floats
    """px², by sigma."""
    wide: Floats
    """px, of the widths."""


def _differences(stripes: Sequence[Stripe]) -> list[_Differences]:
    """Of centres 1, 2 and 4 lines apart, as `stripes._choice.unexplained` takes them."""
    from turnscan.stripes._choice import LAGS, THIRD

    clean = np.uint16(StripeFlag.MULTI | StripeFlag.HALO)
    tables = np.stack([s.alone() for s in stripes])
    tables[:, 0][(np.stack([s.flags for s in stripes]) & ~clean) != 0] = np.nan
    lines = np.flatnonzero(~np.isnan(tables[:, 0]).all(axis=0))
    about = slice(int(lines[0]), int(lines[-1]) + 1) if len(lines) else slice(0)
    place, sigma, _, width = tables[:, :4, about].swapaxes(0, 1)
    gaps = np.cumsum(np.pad(np.isnan(place), ((0, 0), (1, 0))), axis=1)
    squares = tuple(factor**2 for factor in THIRD)
    out = list[_Differences]()
    for lag in LAGS:
        if place.shape[1] <= 3 * lag:
            break
        third = _summed(place, lag, THIRD)
        third[gaps[:, 3 * lag + 1 :] > gaps[:, : -3 * lag - 1]] = np.nan
        own = (_summed(v, lag, squares) for v in (sigma**2, width))
        out.append(_Differences(third, *own))
    return out


def _summed(values: Floats, lag: int, factors: tuple[float, ...]) -> Floats:
    """(s, n - 3 lag) the sum of four values (s, n) so many lines apart, by ``factors``."""
    n = values.shape[1] - 3 * lag
    parts = (f * values[:, (3 - k) * lag :][:, :n] for k, f in enumerate(factors))
    return np.asarray(sum(parts))


def _apart(differences: Sequence[_Differences], size: int, closed: bool, far: int) -> Scatters:
    """Of what each profile does not have in common with those ``far`` steps before and after it."""
    from turnscan.stripes._choice import ENOUGH_LINES, LAGS, MEDIAN_SQUARE

    values, counts = np.zeros((2, size, len(LAGS)))
    if size < 2 * far + 1:
        return Scatters(values, counts)
    for i, own in enumerate(differences):
        after = _Differences(*(np.roll(v, -far, axis=0) for v in own))
        asked = (own.third - after.third) ** 2 / MEDIAN_SQUARE - own.explained - after.explained
        asked /= own.wide + after.wide
        if not closed:
            asked[-far:] = np.nan
        count = (~np.isnan(asked)).sum(axis=1)
        count[count < ENOUGH_LINES] = 0
        found = np.zeros(size)
        found[count > 0] = np.nanmedian(asked[count > 0], axis=1)
        both = count + np.roll(count, far)
        total = count * found + np.roll(count * found, far)
        values[:, i], counts[:, i] = total / np.maximum(both, 1), both / 2.0
    return Scatters(values, counts)
