"""Compiled kernels of the comparison of surfaces; imported only when they are used."""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, Longs
from turnscan.compiled import njit

_SLACK = 1e-6
"""A line through a side meets one of its two faces, whatever the rounding."""
_TRIES = 3
"""Times that the place where a line meets a cubic is searched: 12 profiles a turn need two."""


@njit(cache=True, nogil=True)
def inner(faces: Ints, count: int) -> Bools:
    """(v,) True where faces go all the way round a vertex.

    Round it each face leads from one neighbour to the next; the sum of all that leads nowhere.
    """
    lead = np.zeros(count, dtype=np.int64)
    have = np.zeros(count, dtype=np.bool_)
    for f in range(len(faces)):
        for c in range(3):
            v = faces[f, c]
            have[v] = True
            lead[v] += faces[f, (c + 2) % 3] - faces[f, (c + 1) % 3]
    return have & (lead == 0)


@njit(cache=True, nogil=True)
def next_profile(faces: Ints, rank: Ints, line: Ints) -> tuple[Ints, Ints]:
    """(v,) the vertices that faces join to each on the same line of the profile before and after.

    ``rank`` (v,) counts the profiles; −1 where there is none. The turn closes where faces close it.
    """
    count = len(rank)
    before = np.full(count, -1, dtype=np.int32)
    after = np.full(count, -1, dtype=np.int32)
    last = rank.max() if count else 0
    for f in range(len(faces)):
        for c in range(3):
            a, b = faces[f, c], faces[f, (c + 1) % 3]
            if line[a] != line[b]:
                continue
            ahead = rank[b] - rank[a]
            if ahead == 1 or ahead == -last != -1:
                after[a], before[b] = b, a
            elif ahead == -1 or ahead == last != 1:
                after[b], before[a] = a, b
    return before, after


@njit(cache=True, nogil=True)
def differences(values: Floats, before: Ints, after: Ints) -> Floats:
    """(v, 3) second differences of ``values`` from profile to profile; NaN where one is missing."""
    out = np.full(values.shape, np.nan)
    for v in range(len(values)):
        a, b = before[v], after[v]
        if a >= 0 and b >= 0:
            for i in range(3):
                out[v, i] = values[a, i] - 2.0 * values[v, i] + values[b, i]
    return out


@njit(cache=True, nogil=True)
def _met(X: Floats, n: Floats, points: Floats, face: Ints, weights: Floats) -> float:
    """Where the line X + t·n meets a triangle: t and, in ``weights``, the place; NaN: nowhere."""
    a, b, c = face[0], face[1], face[2]
    u0, u1, u2 = (
        points[b, 0] - points[a, 0],
        points[b, 1] - points[a, 1],
        points[b, 2] - points[a, 2],
    )
    v0, v1, v2 = (
        points[c, 0] - points[a, 0],
        points[c, 1] - points[a, 1],
        points[c, 2] - points[a, 2],
    )
    s0, s1, s2 = X[0] - points[a, 0], X[1] - points[a, 1], X[2] - points[a, 2]
    p0, p1, p2 = n[1] * v2 - n[2] * v1, n[2] * v0 - n[0] * v2, n[0] * v1 - n[1] * v0
    det = u0 * p0 + u1 * p1 + u2 * p2
    if abs(det) < 1e-15:
        return np.nan
    q0, q1, q2 = s1 * u2 - s2 * u1, s2 * u0 - s0 * u2, s0 * u1 - s1 * u0
    weights[1] = (s0 * p0 + s1 * p1 + s2 * p2) / det
    weights[2] = (n[0] * q0 + n[1] * q1 + n[2] * q2) / det
    weights[0] = 1.0 - weights[1] - weights[2]
    if min(weights[0], weights[1], weights[2]) < -_SLACK:
        return np.nan
    return (v0 * q0 + v1 * q1 + v2 * q2) / det


@njit(cache=True, nogil=True)
def feet(
    X: Floats, normals: Floats, near: Ints, points: Floats, faces: Ints, start: Longs, numbers: Ints
) -> tuple[Ints, Floats, Floats]:
    """Where lines along ``normals`` from X (m, 3) meet the faces round their nearest vertex.

    Returns the face (m,), −1 for none, the weights of its corners (m, 3) and the distance (m,)
    from that place to X along the normal. Faces of the second ring count, too.
    """
    m = len(X)
    which = np.full(m, -1, dtype=np.int32)
    weights = np.zeros((m, 3))
    off = np.full(m, np.nan)
    here = np.empty(3)
    for i in range(m):
        for ring in range(2):
            for j in range(start[near[i]], start[near[i] + 1]):
                for c in range(3):
                    # The second ring: the faces round the vertices of the first.
                    v = faces[numbers[j], c]
                    low, high = (start[v], start[v + 1]) if ring else (j, j + 1)
                    for k in range(low, high):
                        t = _met(X[i], normals[i], points, faces[numbers[k]], here)
                        if t == t and not abs(off[i]) <= abs(t):
                            off[i], which[i] = -t, numbers[k]
                            weights[i] = here
                    if not ring:
                        break
            if which[i] >= 0:
                break
    return which, weights, off


@njit(cache=True, nogil=True)
def _above(
    chord: Floats, first: Floats, second: Floats, n: Floats, foot: float
) -> tuple[float, float]:
    """Where the line along the normal ``n`` (3,) through a place on a chord, the part ``foot`` of
    the way, meets the cubic above: its part of the way, and mm from the chord.

    ``first`` and ``second`` (3,) are the second differences at both ends. In coarse steps the
    normal leans against the chord, and meets the cubic elsewhere than right above the place.
    """
    level = chord - (chord * n).sum() * n
    long = (chord * level).sum()
    t = foot
    for _ in range(_TRIES):
        rise = -t * (1.0 - t) / 6.0 * ((2.0 - t) * first + (1.0 + t) * second)
        if long > 0.0:
            t = min(max(foot - (rise * level).sum() / long, 0.0), 1.0)
    rise = -t * (1.0 - t) / 6.0 * ((2.0 - t) * first + (1.0 + t) * second)
    return t, (((t - foot) * chord + rise) * n).sum()


@njit(cache=True, nogil=True)
def between(
    which: Ints,
    weights: Floats,
    normals: Floats,
    points: Floats,
    faces: Ints,
    rank: Ints,
    neighbours: tuple[Ints, Ints],
    smooth: Bools,
    second: Floats,
    sigma: Floats,
) -> tuple[Floats, Floats]:
    """What lies between profiles at a foot (`feet`): bulge and sigma (m,) mm along the normal.

    The bulge is how far the cubic through four profiles lies above the chord of the middle two,
    sigma what the noise of the four makes of it; ``sigma`` (v, 3) is the noise of each vertex as a
    vector. NaN where one of the face's corners is not ``smooth``.
    """
    m, (before, after) = len(which), neighbours
    bulge = np.full(m, np.nan)
    spread = np.full(m, np.nan)
    for i in range(m):
        face, n = faces[which[i]], normals[i]
        if not (smooth[face[0]] and smooth[face[1]] and smooth[face[2]]):
            continue
        for c in range(3):
            a = face[c]
            b = after[a]
            if b != face[0] and b != face[1] and b != face[2]:
                continue
            t = 0.0
            for d in range(3):
                t += weights[i, d] if rank[face[d]] == rank[b] else 0.0
            foot = min(max(t, 0.0), 1.0)
            t, bulge[i] = _above(points[b] - points[a], second[a], second[b], n, foot)
            share = (
                -t * (1.0 - t) * (2.0 - t) / 6.0,
                (1.0 - t * t) * (2.0 - t) / 2.0,
                t * (1.0 + t) * (2.0 - t) / 2.0,
                -t * (1.0 - t * t) / 6.0,
            )
            total = 0.0
            for k, v in enumerate((before[a], a, b, after[b])):
                total += (share[k] * (n * sigma[v]).sum()) ** 2
            spread[i] = np.sqrt(total)
    return bulge, spread
