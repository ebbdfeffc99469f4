"""Where along its profiles a grid gets new points, and how they are laid out in lines."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Bools, Floats, Ints

_NEAR = 0.25
"""Spacings within which a new point gives way to one that stays."""
_APART = 2.0
"""Spacings along a profile after which a point comes though no height was passed."""


@dataclass(frozen=True)
class Walk:
    """All points of a grid in a row, profile by profile and line by line."""

    profile: Ints
    """(m,) the index of its profile."""
    line: Ints
    """(m,)"""
    height: Floats
    """(m,) mm."""
    begins: Bools
    """(m,) True at the first point of each run."""
    stays: Bools
    """(m,) True where the point itself is wanted: the ends of runs, and others."""
    way: Floats
    """(m,) mm along all profiles; only differences within a run say something."""


def walks(points: Floats, joined: Bools, stays: Bools | None) -> Walk:
    """The points (s, n, 3) of a grid as a walk; ``joined``, ``stays`` (s, n) as in `resample`."""
    profile, line = np.nonzero(~np.isnan(points[..., 0]))
    begins = ~joined[profile, line]
    ends = np.append(begins[1:], True)
    wanted = begins | ends
    if stays is not None:
        wanted |= stays[profile, line]
    p = points[profile, line]
    steps = np.linalg.norm(np.diff(p, axis=0, prepend=p[:1]), axis=1)
    way = np.cumsum(np.where(begins, 0.0, steps))
    return Walk(profile.astype(np.int32), line.astype(np.int32), p[:, 2], begins, wanted, way)


def most_places(w: Walk, spacing: float) -> float:
    """About how many points the fullest profile gets."""
    step = np.where(w.begins, 0.0, np.diff(w.way, prepend=0.0)) / spacing
    count = np.bincount(w.profile, step + w.stays)
    return float(count.max())


def places(w: Walk, spacing: float, heights: bool) -> tuple[Ints, Floats, Ints]:
    """For every new point: the point (index into the walk) that ends its segment, how far along
    that segment it lies (0 to 1], and its place in its profile, from 0.
    """
    keep = np.flatnonzero(w.stays).astype(np.float64)
    arcs = _multiples(_since(w), w.begins, spacing)[0]
    if heights:
        passed, height = _multiples(w.height, w.begins, spacing)
        again = np.zeros(len(passed), dtype=np.bool_)
        run = np.cumsum(w.begins)[np.ceil(passed).astype(np.intp)]
        again[1:] = (height[1:] == height[:-1]) & (run[1:] == run[:-1])
        between = passed[~again]
        known, height = between, height[~again]
        clear = _clear(w, between, keep, _NEAR * spacing, 0.0)
        between, known, height = between[clear], known[clear], height[clear]
        wanted = np.sort(np.concatenate([keep, between]))
        fill = arcs[_clear(w, arcs, wanted, 2 * _NEAR * spacing, _APART * spacing)]
        wanted = np.sort(np.concatenate([wanted, fill]))
    else:
        known, height = np.zeros(0), np.zeros(0)
        between = arcs[_clear(w, arcs, keep, _NEAR * spacing, 0.0)]
        wanted = np.sort(np.concatenate([keep, between]))
    end = np.ceil(wanted).astype(np.intp)
    part = wanted - end + 1.0
    return end.astype(np.int32), part, _lay_out(w, wanted, known, height)


def _since(w: Walk) -> Floats:
    """(m,) mm along the run from its first point."""
    first = np.flatnonzero(w.begins)
    return np.asarray(w.way - w.way[first][np.cumsum(w.begins) - 1])


def _multiples(values: Floats, begins: Bools, spacing: float) -> tuple[Floats, Floats]:
    """Where (fractions between the points of a walk) values (m,) pass multiples of the spacing.

    Ascending, and which multiple each is. Where a point lies on one its number is whole.
    """
    b = values / spacing
    a = np.concatenate([b[:1], b[:-1]])
    low = np.where(b > a, np.floor(a) + 1, np.ceil(b))
    high = np.where(b > a, np.floor(b), np.ceil(a) - 1)
    count = np.where(begins | (a == b), 0, np.maximum(high - low + 1, 0)).astype(np.intp)
    segment = np.repeat(np.arange(len(b)), count)
    rank = np.arange(len(segment)) - np.repeat(np.cumsum(count) - count, count)
    multiple = np.where((b > a)[segment], low[segment] + rank, high[segment] - rank)
    part = (multiple - a[segment]) / (b - a)[segment]
    return segment - 1 + np.clip(part, 1e-12, 1.0), multiple


def _clear(w: Walk, at: Floats, fixed: Floats, near: float, apart: float) -> Bools:
    """Which places ``at`` are further than ``near`` mm from both of their neighbours in ``fixed``,
    and lie between two that are more than ``apart`` mm apart. Both ends of all runs are in it.
    """
    after = np.minimum(np.searchsorted(fixed, at), len(fixed) - 1)
    before = np.maximum(after - 1, 0)
    here, low, high = _way(w, at), _way(w, fixed[before]), _way(w, fixed[after])
    return np.asarray((here - low >= near) & (high - here >= near) & (high - low > apart))


def _way(w: Walk, at: Floats) -> Floats:
    return np.interp(at, np.arange(len(w.way)), w.way)


def _lay_out(w: Walk, at: Floats, known: Floats, height: Floats) -> Ints:
    """The place of each new point in its profile: in order, one place empty between runs.

    A run is moved on so far that the first height it passes (``height`` at ``known``) has the same
    place in all profiles.
    """
    run = np.cumsum(w.begins)[np.ceil(at).astype(np.intp)] - 1
    size = np.bincount(run)
    first = np.cumsum(size) - size
    profile = w.profile[w.begins]
    cum = np.cumsum(size + 1) - size - 1
    begins, index = np.unique(profile, return_inverse=True)
    start = cum - cum[np.searchsorted(profile, begins)][index]
    wanted = np.full(len(size), np.nan)
    if len(known):
        index = np.searchsorted(at, known)
        of, which = np.unique(run[index], return_index=True)
        falls = np.sum(np.where(w.begins, 0.0, np.diff(w.height, prepend=w.height[0]))) <= 0
        wanted[of] = (-height if falls else height)[which] - (index[which] - first[of])
    low = np.nanmin(wanted) if len(known) else 0.0
    wanted = np.where(np.isnan(wanted), start, wanted - low)
    # The furthest shift so far, profile by profile.
    far = (np.abs(wanted - start).max() + 1.0) * 2
    shift = np.maximum.accumulate(wanted - start + profile * far) - profile * far
    begin = start + np.round(np.maximum(shift, 0.0)).astype(np.intp)
    return np.asarray(begin[run] + np.arange(len(at)) - first[run], dtype=np.int32)
