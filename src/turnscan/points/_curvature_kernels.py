"""Compiled kernels of the curvature across profiles; imported only when they are used."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.compiled import njit

Counts = npt.NDArray[np.int16]
Vector = tuple[float, float, float]

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
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True)
def _at(places: Floats, k: int, j: int) -> Vector:
    return places[k, j, 0], places[k, j, 1], places[k, j, 2]


@njit(cache=True, nogil=True)
def _from(p: Vector, q: Vector) -> Vector:
    return q[0] - p[0], q[1] - p[1], q[2] - p[2]


@njit(cache=True, nogil=True)
def _over(p: Vector, by: float) -> Vector:
    return p[0] / by, p[1] / by, p[2] / by


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
        eye = (eyes[k, 0], eyes[k, 1], eyes[k, 2])
        for j in range(n):
            if np.isnan(points[k, j, 0]):
                continue
            here = _at(points, k, j)
            on = (k + 1) % s if closed else min(k + 1, s - 1)
            back = (k - 1) % s if closed else max(k - 1, 0)
            arc = 0.0
            for m in (on, back):
                step = _from(here, _at(points, m, j))
                arc = max(arc, np.sqrt(_dot(step, step)))
            # NaN where one of them is missing.
            if not arc > 0.0:
                continue
            m = min(max(int(np.rint(span / arc)), 1), min(_MOST, s // 4))
            if not closed and (k + m >= s or k < m):
                continue
            a, b = (
                _from(here, _at(points, (k - m) % s, j)),
                _from(here, _at(points, (k + m) % s, j)),
            )
            shift = _shift(a, b, _from(here, eye), _at(moves, k, j), _at(sheets, k, j))
            if not np.isnan(shift):
                out[k, j], over[k, j] = shift, m
    return out, over


@njit(cache=True, nogil=True)
def _shift(a: Vector, b: Vector, v: Vector, move: Vector, sheet: Vector) -> float:
    """px/mm² of a point from which the curve goes on to ``a`` and ``b`` and the camera is at ``v``,
    NaN where no curvature is known."""
    la, lb = np.sqrt(_dot(a, a)), np.sqrt(_dot(b, b))
    if not (la > 0.0 and lb > 0.0 and la < _LOPSIDED * lb and lb < _LOPSIDED * la):
        return np.nan
    if _dot(a, b) > -_STRAIGHT * la * lb:
        return np.nan
    one, two = _over(a, la), _over(b, lb)
    bend = (
        2.0 * (one[0] + two[0]) / (la + lb),
        2.0 * (one[1] + two[1]) / (la + lb),
        2.0 * (one[2] + two[2]) / (la + lb),
    )
    t = _from(a, b)
    t = _over(t, np.sqrt(_dot(t, t)))
    c = _dot(t, sheet)
    if abs(c) < _LEAST:
        return np.nan
    v = _over(v, np.sqrt(_dot(v, v)))
    across = _dot(v, t)
    normal = (v[0] - across * t[0], v[1] - across * t[1], v[2] - across * t[2])
    facing = np.sqrt(_dot(normal, normal))
    if facing < _LEAST:
        return np.nan
    normal = _over(normal, facing)
    pixel = _over(move, _dot(move, move))
    ta = _dot(t, pixel)
    sinks = _dot(bend, pixel) / 2
    beside = ta * _dot(bend, sheet) / (2 * c)
    seen = ta * across * _dot(bend, normal) / facing
    return (sinks - beside - seen) / c**2  # type: ignore[no-any-return]


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
