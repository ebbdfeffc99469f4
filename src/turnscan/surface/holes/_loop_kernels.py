"""Compiled kernels of flat fillings; imported only when they are used."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, Longs
from turnscan.compiled import njit


@njit(cache=True, nogil=True)
def _cross(xy: Floats, a: int, b: int, c: int) -> float:
    return float(
        (xy[b, 0] - xy[a, 0]) * (xy[c, 1] - xy[a, 1])
        - (xy[b, 1] - xy[a, 1]) * (xy[c, 0] - xy[a, 0])
    )


@njit(cache=True, nogil=True)
def clip_ears(xy: Floats, used: Bools) -> Ints:
    """A polygon (m, 2), counter-clockwise → (m − 2, 3) triangles of its corners.

    Of the ears there are, the one with the best-shaped triangle goes first (its smallest height
    against its longest side). A polygon that crosses itself has no ear at some point; then the
    corner that turns left the most is cut off, so that the result always has all its sides.
    ``used`` (m, m) marks chords that already have their two faces: a cut along one of those is the
    last resort.
    """
    m = len(xy)
    ahead = np.empty(m, dtype=np.int64)
    back = np.empty(m, dtype=np.int64)
    score = np.empty(m)
    for i in range(m):
        ahead[i] = (i + 1) % m
        back[i] = (i - 1) % m
    for i in range(m):
        score[i] = _ear(xy, back, ahead, i, used)
    faces = np.empty((max(m - 2, 0), 3), dtype=np.int32)
    left = m
    made = 0
    start = 0
    while left > 2:
        best = start
        i = ahead[start]
        while i != start:
            if score[i] > score[best]:
                best = i
            i = ahead[i]
        a, c = back[best], ahead[best]
        faces[made, 0], faces[made, 1], faces[made, 2] = a, best, c
        made += 1
        ahead[a], back[c] = c, a
        left -= 1
        start = a
        score[a] = _ear(xy, back, ahead, a, used)
        score[c] = _ear(xy, back, ahead, c, used)
    return faces


@njit(cache=True, nogil=True)
def _ear(xy: Floats, back: Longs, ahead: Longs, i: int, used: Bools) -> float:
    """How good an ear the corner is: above 0 for an ear, else below, −3 for a side in use."""
    a, c = back[i], ahead[i]
    if used[a, c]:
        return -3.0
    twice = _cross(xy, a, i, c)
    longest = 0.0
    for p, q in ((a, i), (i, c), (c, a)):
        d = (xy[p, 0] - xy[q, 0]) ** 2 + (xy[p, 1] - xy[q, 1]) ** 2
        longest = max(longest, d)
    if longest == 0.0:
        return -1.0
    shape = twice / longest
    if shape <= 0.0:
        return float(shape - 1.0)
    k = ahead[c]
    while k != a:
        # A corner inside or on the triangle, other than one that lies on its own corners.
        if (
            _cross(xy, a, i, k) >= 0.0
            and _cross(xy, i, c, k) >= 0.0
            and _cross(xy, c, a, k) >= 0.0
            and not _same(xy, k, a)
            and not _same(xy, k, i)
            and not _same(xy, k, c)
        ):
            return float(-1.0 + shape * 0.5)
        k = ahead[k]
    return float(shape)


@njit(cache=True, nogil=True)
def _same(xy: Floats, a: int, b: int) -> bool:
    return bool(xy[a, 0] == xy[b, 0] and xy[a, 1] == xy[b, 1])
