"""Compiled kernels of the curvature across profiles; imported only when they are used."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.compiled import njit

Counts = npt.NDArray[np.int16]

_MOST = 16
"""Steps to either side, at most."""
_LOPSIDED = 1.5
"""The one side may be so many times as long as the other."""
_STRAIGHT = 0.3
"""Cosine between the two sides from which on they turn back: no curve, but an end of one."""
_LEAST = 0.2
"""Slope of the curve to the sheet, below which the sheet runs along the surface."""
_BESIDE = 6
"""Lines on either side over which curvatures are averaged."""


@njit(cache=True, nogil=True)
def shifts(
    points: Floats, eyes: Floats, moves: Floats, sheets: Floats, span: float, closed: bool
) -> tuple[Floats, Counts]:
    """(s, n) px/mm² that a centre shifts for each square of the sheet's thickness, NaN where no
    curvature is known; and how many steps to either side it was taken over, 0 there.

    The last points of a profile have no curvature; what they lie beside is not seen.
    """
    s, n, _ = points.shape
    out, over = np.full((s, n), np.nan), np.zeros((s, n), np.int16)
    for k in range(s):
        for j in range(n):
            if np.isnan(points[k, j, 0]):
                continue
            on = (k + 1) % s if closed else min(k + 1, s - 1)
            back = (k - 1) % s if closed else max(k - 1, 0)
            arc = 0.0
            for m in (on, back):
                step = points[m, j] - points[k, j]
                arc = max(arc, np.sqrt((step * step).sum()))
            # NaN where one of them is missing.
            if not arc > 0.0:
                continue
            m = min(max(int(np.rint(span / arc)), 1), min(_MOST, s // 4))
            if not closed and (k + m >= s or k < m):
                continue
            a, b = points[(k - m) % s, j] - points[k, j], points[(k + m) % s, j] - points[k, j]
            la, lb = np.sqrt((a * a).sum()), np.sqrt((b * b).sum())
            if not (la > 0.0 and lb > 0.0 and la < _LOPSIDED * lb and lb < _LOPSIDED * la):
                continue
            if (a * b).sum() > -_STRAIGHT * la * lb:
                continue
            bend = 2.0 * (a / la + b / lb) / (la + lb)
            t = b - a
            t /= np.sqrt((t * t).sum())
            c = (t * sheets[k, j]).sum()
            if abs(c) < _LEAST:
                continue
            v = eyes[k] - points[k, j]
            v /= np.sqrt((v * v).sum())
            across = (v * t).sum()
            normal = v - across * t
            facing = np.sqrt((normal * normal).sum())
            if facing < _LEAST:
                continue
            normal /= facing
            pixel = moves[k, j] / (moves[k, j] * moves[k, j]).sum()
            ta = (t * pixel).sum()
            sinks = (bend * pixel).sum() / 2
            beside = ta * (bend * sheets[k, j]).sum() / (2 * c)
            seen = ta * across * (bend * normal).sum() / facing
            out[k, j] = (sinks - beside - seen) / c**2
            over[k, j] = m
    return out, over


@njit(cache=True, nogil=True)
def evened(values: Floats) -> Floats:
    """(s, n) the mean of each value and those beside it along the run, without the two ends."""
    s, n = values.shape
    out = np.full((s, n), np.nan)
    some = np.empty(2 * _BESIDE + 1)
    for k in range(s):
        for j in range(n):
            if np.isnan(values[k, j]):
                continue
            count = 0
            for way in (-1, 1):
                i = j if way < 0 else j + 1
                while 0 <= i < n and abs(i - j) <= _BESIDE and not np.isnan(values[k, i]):
                    some[count] = values[k, i]
                    count += 1
                    i += way
            if count < 3:
                out[k, j] = np.median(some[:count])
            else:
                out[k, j] = (some[:count].sum() - some[:count].min() - some[:count].max()) / (
                    count - 2
                )
    return out


@njit(cache=True, nogil=True)
def agreed(values: Floats, steps: Counts, closed: bool) -> Floats:
    """(s, n) the least of each value and those as many ``steps`` before and after as it was taken
    over; 0 where they differ in sign. A neighbour that is missing says nothing.
    """
    s, n = values.shape
    out = np.full((s, n), np.nan)
    for k in range(s):
        for j in range(n):
            least = values[k, j]
            if np.isnan(least):
                continue
            for way in (-1, 1):
                m = k + way * steps[k, j]
                if closed:
                    m %= s
                if m < 0 or m >= s or np.isnan(values[m, j]):
                    continue
                other = values[m, j]
                if other * least <= 0.0:
                    least = 0.0
                elif abs(other) < abs(least):
                    least = other
            out[k, j] = least
    return out
