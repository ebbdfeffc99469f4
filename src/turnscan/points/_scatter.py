"""How far the centres of a laser scatter for their width, from several pictures together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from turnscan.arrays import Bools, Flags, Floats
from turnscan.points._common_shape import OF_MEDIAN, Scatters, without_shape
from turnscan.stripes import Stripe, StripeFlag

_FRAMES, _TURN = 8, np.pi / 4
"""Pictures before and after, at most, and the turn, rad, within which speckle is alike."""
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
    part's shape: collars, a thread (`without_shape`).
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
    mean, told, alike, itself = _together(stripes, photons, turns, closed)
    itself = np.where(np.isnan(itself), own, np.maximum(itself, 0.0))
    if not told.all():
        mean = np.where(told, mean, of_few_lines(stripes))
    unsure = _DIFFERS * OF_MEDIAN / np.sqrt(np.maximum(count, 1))
    least = np.maximum((photons + itself) / (1 + unsure) - photons, 0.0)
    most = np.where(unsure < 1, (photons + itself) / np.maximum(1 - unsure, 1e-9) - photons, np.inf)
    more = np.where(weight > 0, np.clip(mean, least, most), mean) - own
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
    what each picture says by itself, NaN where that is what `Stripe.scatter` says."""
    own = Scatters(*map(np.stack, zip(*(s.scatters() for s in stripes), strict=True)))
    # A variance is known as well as all that makes it is small: where photons decide, as in light
    # from the bottom of a gap, a picture says little of what its centres scatter besides. Where
    # they explain all in most pictures, there is nothing to be known better.
    usual = float(np.median(own.values[:, 0]))
    counts = 1.0 / (1.0 + photons / usual)[:, None] ** 2 if usual > 0 else np.ones((1, 1))

    def about(some: Scatters) -> Scatters:
        columns = zip(some.values.T, (some.counts * counts).T, strict=True)
        pooled = [_about(value, count, turns, closed) for value, count in columns]
        return Scatters(*(np.stack(v, axis=1) for v in zip(*pooled, strict=True)))

    means, itself = without_shape(stripes, own, about, photons, turns, closed)
    best, told = np.zeros(len(stripes)), np.zeros(len(stripes), np.bool_)
    for i, (mean, count) in enumerate(zip(means.values.T, means.counts.T, strict=True)):
        unsure = _TWICE * OF_MEDIAN / np.sqrt(np.maximum(count, 1.0))
        surely = mean > best + unsure * (np.maximum(best, 0.0) + photons)
        best = np.where((count > 0) & (surely | (i == 0)), mean, best)
        told |= count > 0
    best = np.maximum(best, 0.0)
    near = (own.counts[:, 0] > 0) & (photons + best > 0)
    if not near.any():
        return best, told, 0.0, itself
    shown = (photons + means.values[:, 0])[near] / (photons + best)[near]
    alike = float(np.clip((_CHANCE - np.median(shown)) / 1.5, 0.0, _MOST_ALIKE))
    return best, told, alike, itself


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
