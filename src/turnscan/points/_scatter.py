"""How far the centres of a laser scatter for their width, from several pictures together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from turnscan.arrays import Bools, Flags, Floats
from turnscan.stripes import Stripe, StripeFlag

_FRAMES, _TURN = 8, np.pi / 4
"""Pictures before and after, at most, and the turn, rad, within which speckle is alike."""
_OF_MEDIAN = 2.5
"""Uncertainty of a variance from the median of n squares, as a part, times √n."""
_ASSUMED = 0.25
"""Part of a stripe's width (rms) that its sigma is where nothing tells how centres scatter: speckle
makes 0.07 to 0.22 of it on the rigs that were tried."""
_CHANCE = 0.85
"""Part of what the largest of three shows that adjacent lines show, though they share nothing."""
_MOST_ALIKE = 0.9
"""Correlation of adjacent lines at most: lines further apart tell no better how long it is."""
_TWICE = 2.0
"""Of those by which centres further apart scatter more than nearer ones, so that these share it."""
_DIFFERS = 3.0
"""Of those by which the scatter of one picture must differ from the others' to be its own."""
_LESS = 2.0
"""Of those by which profiles must scatter less against those beside them than each along itself …"""
_FAR, _COMMON = np.pi / 8, 0.5
"""… and the turn, rad, over which less than this part must differ, so that what they have in common
is the shape of a turned part: adjacent profiles may share their light, or a print."""


def pooled_sigma(
    stripes: Sequence[Stripe], sigma: Floats, width: Floats, flags: Flags, turns: Floats,
    closed: bool,
) -> tuple[Floats, float]:  # fmt: skip
    """(s, n) px: the sigmas of stripes with the scatter of several pictures for that of each one;
    and the correlation of what moves centres on adjacent lines, 0 to 1.

    ``sigma`` (s, n) px, ``width`` (s, n) px and ``flags`` (s, n) are those of ``stripes``, or of
    some of their lines, in scan order at angles ``turns`` (s,) rad; a ``closed`` turn goes on
    at its first. A single picture knows its scatter to a sixth or worse (`Stripe.scatter`), and
    takes the largest of three. It has that of those about it instead (`_together`), where its own
    does not surely differ; else the nearest value that its own allows. Where none about it has
    lines enough to tell, it has that of all lines of all pictures (`of_few_lines`). What was set
    by hand, or refined, stays. What profiles beside each other have in common is no scatter but the
    part's shape: collars, a thread (`_beside`).
    """
    own = np.array([s.scatter for s in stripes])
    if not (np.isnan(own) | (own > 0)).any():
        return sigma, 0.0
    clean = ((flags & ~np.uint16(StripeFlag.MULTI)) == 0) & (width > 0)
    count = np.array([s.found.sum() for s in stripes])
    weight = np.where(np.isnan(own), 0.0, count)
    own = np.nan_to_num(own)
    share = np.where(clean, sigma**2 / np.where(clean, width, 1.0), 0.0)
    whole = share.sum(axis=1) / np.maximum(clean.sum(axis=1), 1)
    photons = np.maximum(whole - own, 0.0)
    mean, told, alike, shape = _together(stripes, photons, turns, closed)
    own = np.maximum(own - shape, 0.0)
    if not told.all():
        mean = np.where(told, mean, of_few_lines(stripes))
    unsure = _DIFFERS * _OF_MEDIAN / np.sqrt(np.maximum(count, 1))
    least = np.maximum((photons + own) / (1 + unsure) - photons, 0.0)
    most = np.where(unsure < 1, (photons + own) / np.maximum(1 - unsure, 1e-9) - photons, np.inf)
    more = np.where(weight > 0, np.clip(mean, least, most), mean) - (own + shape)
    single = (flags & (StripeFlag.HAND | StripeFlag.REFINED)) == 0
    with np.errstate(invalid="ignore"):
        raised = np.sqrt(np.maximum(sigma**2 + more[:, None] * width, 0.0))
    return np.where(single & (width > 0), raised, sigma), alike


def of_few_lines(stripes: Sequence[Stripe]) -> float:
    """px² for each px of width: the scatter of those pictures that have no lines enough to tell.

    That of all their lines, or of all there are; where these are too few as well, what makes sigma
    a part of the usual width that is not too small.
    """
    for some in ([s for s in stripes if np.isnan(s.scatter)], stripes):
        found = Stripe.scatter_together(some) if some else np.nan
        if not np.isnan(found):
            return found
    width = np.concatenate([s.width[s.found] for s in stripes])
    return _ASSUMED**2 * float(np.median(width)) if len(width) else 0.0


def _together(
    stripes: Sequence[Stripe], photons: Floats, turns: Floats, closed: bool
) -> tuple[Floats, Bools, float, Floats]:
    """(s,) the scatter of each picture and those about it, from centres as far apart as shows it:
    further than adjacent ones where that is surely more, beside what ``photons`` (s,) explain; and
    (s,) False where none of these has lines enough to tell. Then the correlation of adjacent lines:
    a third difference of independent ones has 20 of their variances, 30 correlations less. And (s,)
    what of each picture's own is the part's shape."""
    values, counts = (np.stack(some) for some in zip(*(s.scatters() for s in stripes), strict=True))
    # A variance is known as well as all that makes it is small: where photons decide, as in light
    # from the bottom of a gap, a picture says little of what its centres scatter besides. Where
    # they explain all in most pictures, there is nothing to be known better.
    usual = float(np.median(values[:, 0]))
    beside, pairs = _beside(stripes, closed, 1)
    step = float(np.median(np.abs(np.diff(np.unwrap(turns))))) if len(turns) > 1 else _FAR
    far, far_pairs = _beside(stripes, closed, max(round(_FAR / max(step, 1e-9)), 1))
    if usual > 0:
        less = 1.0 / (1.0 + photons / usual)[:, None] ** 2
        counts, pairs, far_pairs = counts * less, pairs * less, far_pairs * less
    best, told = np.zeros(len(stripes)), np.zeros(len(stripes), np.bool_)
    shape, first = np.zeros(len(stripes)), np.zeros(len(stripes))
    for i in range(values.shape[1]):
        mean, count = _about(values[:, i], counts[:, i], turns, closed)
        other, among = _about(beside[:, i], pairs[:, i], turns, closed)
        across, so_many = _about(far[:, i], far_pairs[:, i], turns, closed)
        unsure = _LESS * _OF_MEDIAN * np.sqrt(1 / np.maximum(count, 1) + 1 / np.maximum(among, 1))
        common = mean - other > unsure * (np.maximum(mean, 0.0) + photons)
        common &= (among > 0) & (so_many > 0) & (across < _COMMON * mean)
        shape = np.where(common, np.maximum(shape, values[:, i] - beside[:, i]), shape)
        mean = np.where(common, other, mean)
        unsure = _TWICE * _OF_MEDIAN / np.sqrt(np.maximum(count, 1.0))
        surely = mean > best + unsure * (np.maximum(best, 0.0) + photons)
        best = np.where((count > 0) & (surely | (i == 0)), mean, best)
        first = mean if i == 0 else first
        told |= count > 0
    best = np.maximum(best, 0.0)
    near = (counts[:, 0] > 0) & (photons + best > 0)
    if not near.any():
        return best, told, 0.0, shape
    shown = (photons + first)[near] / (photons + best)[near]
    alike = float(np.clip((_CHANCE - np.median(shown)) / 1.5, 0.0, _MOST_ALIKE))
    return best, told, alike, shape


def _beside(stripes: Sequence[Stripe], closed: bool, far: int) -> tuple[Floats, Floats]:
    """(s, 3) px² for each px of width, as `Stripe.scatters`, and from how many differences, of what
    each profile does not have in common with those ``far`` steps before and after it."""
    from turnscan.stripes import _choice as k

    clean = np.uint16(StripeFlag.MULTI | StripeFlag.HALO)
    tables = np.stack([s.alone() for s in stripes])
    dirty = (np.stack([s.flags for s in stripes]) & ~clean) != 0
    tables[:, 0][dirty] = np.nan
    lines = np.flatnonzero(~np.isnan(tables[:, 0]).all(axis=0))
    values, counts = np.zeros((2, len(stripes), len(k.LAGS)))
    if not len(lines) or len(stripes) < 2 * far + 1:
        return values, counts
    place, sigma, _, width = tables[:, :4, lines[0] : lines[-1] + 1].swapaxes(0, 1)
    for i, lag in enumerate(k.LAGS):
        if place.shape[1] <= 3 * lag:
            break
        difference = _third(place, lag, k.THIRD)
        squares = tuple(factor**2 for factor in k.THIRD)
        explained, wide = _third(sigma**2, lag, squares), _third(width, lag, squares)
        gaps = np.cumsum(np.pad(np.isnan(place), ((0, 0), (1, 0))), axis=1)
        difference[gaps[:, 3 * lag + 1 :] > gaps[:, : -3 * lag - 1]] = np.nan
        after = [np.roll(v, -far, axis=0) for v in (difference, explained, wide)]
        if not closed:
            after[0][-far:] = np.nan
        whole = (difference - after[0]) ** 2 / k.MEDIAN_SQUARE - explained - after[1]
        whole /= wide + after[2]
        count = (~np.isnan(whole)).sum(axis=1)
        enough = count >= k.ENOUGH_LINES
        found = np.zeros(len(stripes))
        found[enough] = np.nanmedian(whole[enough], axis=1)
        count = np.where(enough, count, 0)
        both = count + np.roll(count, far)
        total = count * found + np.roll(count * found, far)
        values[:, i], counts[:, i] = total / np.maximum(both, 1), both / 2.0
    return values, counts


def _third(values: Floats, lag: int, factors: tuple[float, ...]) -> Floats:
    """(s, n - 3 lag) the sum of four values (s, n) so many lines apart, by ``factors``."""
    n = values.shape[1] - 3 * lag
    parts = (factor * values[:, 3 * lag - k * lag :][:, :n] for k, factor in enumerate(factors))
    return np.asarray(sum(parts))


def _about(own: Floats, weight: Floats, turns: Floats, closed: bool) -> tuple[Floats, Floats]:
    """(s,) the mean of the values (s,) of each picture and those about it, by their weight, its own
    where none has any; and (s,) the sum of the weights."""
    size = len(own)
    total, weights = np.zeros(size), np.zeros(size)
    index = np.arange(size)
    for far in range(-min(_FRAMES, (size - 1) // 2), min(_FRAMES, (size - 1) // 2) + 1):
        beside = index + far
        there = np.ones(size, np.bool_) if closed else (beside >= 0) & (beside < size)
        beside = beside % size
        apart = np.abs(np.mod(turns[beside] - turns + np.pi, 2 * np.pi) - np.pi)
        w = np.where(there & (apart <= _TURN), weight[beside], 0.0)
        total, weights = total + w * own[beside], weights + w
    return np.where(weights > 0, total / np.maximum(weights, 1e-300), own), weights
