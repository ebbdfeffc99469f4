"""Compiled kernels of how a range surface bends from profile to profile; for its merge."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Ints, Longs
from turnscan.compiled import njit

_REACH = 2
"""Profiles on either side that a bend is held against."""
_AGREES = 4.0
"""Sigma within which a bend is that of the profiles about it."""


@njit(cache=True, nogil=True)
def along(values: Floats, below: Ints, above: Ints, rounds: int) -> Floats:
    """Means of ``values`` (v, k) over each vertex and those ``below`` and ``above`` (v,) it on its
    profile, −1 where there is none, ``rounds`` times. What is NaN stays so, and counts nowhere."""
    for _ in range(rounds):
        out = values.copy()
        for v in range(len(values)):
            count = 1
            for other in (below[v], above[v]):
                if other >= 0 and not np.isnan(values[other, 0]):
                    for i in range(values.shape[1]):
                        out[v, i] += values[other, i]
                    count += 1
            for i in range(values.shape[1]):
                out[v, i] /= count
        values = out
    return values


@njit(cache=True, nogil=True)
def curvatures(points: Floats, normals: Floats, sigma: Floats, before: Ints, after: Ints) -> Floats:
    """(v, 2) 1/mm: how the surface bends at each vertex between the profiles ``before`` and
    ``after`` it, positive where it bulges, and what noise makes of that; NaN where one is missing.

    From how far a vertex lies off the line through both, a circle's to the second order. Points of
    a plane have none, however unlike their distances are.
    """
    out = np.full((len(points), 2), np.nan)
    for v in range(len(points)):
        if before[v] < 0 or after[v] < 0:
            continue
        back, ahead = points[v] - points[before[v]], points[after[v]] - points[v]
        way = back + ahead
        whole, first, second = (way * way).sum(), (back * back).sum(), (ahead * ahead).sum()
        if not min(whole, first, second) > 0.0:
            continue
        share = (back * way).sum() / whole
        off = ((back - share * way) * normals[v]).sum()
        each = 2.0 / np.sqrt(first * second)
        rest = 1.0 - share
        out[v, 0] = each * off
        out[v, 1] = each * sigma[v] * np.sqrt(1.0 + share * share + rest * rest)
    return out


@njit(cache=True, nogil=True)
def settled(bend: Floats, noise: Floats, before: Ints, after: Ints) -> Floats:
    """(v,) The ``bend`` (v,) that each vertex has with most of the two profiles on either side:
    the mean of what differs from the middle one by no more than ``noise`` (v,) tells; 0 where
    nothing is known.

    An edge between two profiles bends those beside it alone, and is in the middle of none. What a
    vertex itself bends otherwise than most is no bend of the surface: the smaller one counts, or
    none where they bend apart.
    """
    out = np.zeros(len(bend))
    about = np.empty(2 * _REACH + 1, dtype=np.int64)
    for v in range(len(bend)):
        known = _about(v, bend, before, after, about)
        if not known:
            continue
        middle = _smaller(bend[about[(known - 1) // 2]], bend[about[known // 2]])
        total, count = 0.0, 0
        for k in range(known):
            at = about[k]
            if abs(bend[at] - middle) <= _AGREES * noise[at]:
                total += bend[at]
                count += 1
        most = total / count if count else middle
        apart = abs(bend[v] - middle) > _AGREES * noise[v]
        out[v] = _smaller(bend[v], most) if apart else most
    return out


@njit(cache=True, nogil=True)
def _about(v: int, bend: Floats, before: Ints, after: Ints, out: Longs) -> int:
    """How many of a vertex and the profiles about it have a ``bend``; ``out`` begins with these,
    the least first."""
    known = _sorted_in(v, bend, out, 0)
    for ways in (before, after):
        at = ways[v]
        for _ in range(_REACH):
            if at < 0 or at == v:
                break
            known = _sorted_in(at, bend, out, known)
            at = ways[at]
    return known


@njit(cache=True, nogil=True)
def _sorted_in(at: int, bend: Floats, out: Longs, known: int) -> int:
    """Put a vertex that has a ``bend`` among the ``known`` ones; how many there are then."""
    if np.isnan(bend[at]):
        return known
    k = known
    while k > 0 and bend[out[k - 1]] > bend[at]:
        out[k] = out[k - 1]
        k -= 1
    out[k] = at
    return known + 1


@njit(cache=True, nogil=True)
def _smaller(a: float, b: float) -> float:
    """The one nearer to 0; 0 where their signs differ."""
    if a * b <= 0.0:
        return 0.0
    return a if abs(a) < abs(b) else b
