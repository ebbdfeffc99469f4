"""Compiled kernels of the curvature across profiles; imported only when they are used."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.compiled import njit

Counts = npt.NDArray[np.int16]
Vector = tuple[float, float, float]

_MOST = 16
"""Steps to either side, at most, where the way from step to step says how many it takes, …"""
_MOST_SHORT = 64
"""… and where noise made that way look longer than it is: near the axis, or in fine steps."""
_REACHED = 0.5
"""Part of the span that the curve reaches to either side at least. Of points closer together noise
makes a curvature that moves the centre by more than the noise itself."""
_LONG, _SEVERAL = 0.5, 4
"""Part of the way to one end of a curve that one of its steps may be long, where they are so many
at least."""
_LOPSIDED = 1.5
"""The one side may be so many times as long as the other."""
_STRAIGHT = 0.3
"""Cosine between the two sides from which on they turn back: no curve, but an end of one."""
_LEAST = 0.2
"""Slope of the curve to the sheet, below which the sheet runs along the surface."""
_ALONG = 4
"""Lines on either side over which a profile's direction is taken."""
_BESIDE = 6
"""Lines on either side over which curvatures are averaged."""
_SAME = 1 / 3
"""Of the largest of three curvatures, what the least must have for them to be alike."""
_CUT_OFF = 0.609
"""Share of a profile's skewness that a window of ± 2.5 widths leaves out: 2 b³ φ(b) over what it
has of the variance, Φ(b) − Φ(−b) − 2 b φ(b), b = 2.5."""


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
def _short(a: Vector, b: Vector, least: float) -> bool:
    """Whether one of two ways is shorter than that; not where one is not known."""
    return min(_dot(a, a), _dot(b, b)) < least * least


@njit(cache=True, nogil=True)
def shifts(
    points: Floats, eyes: Floats, moves: Floats, sheets: Floats, width: Floats, thickness: float,
    span: float, closed: bool,
) -> tuple[Floats, Floats, Counts]:  # fmt: skip
    """(s, n) px that a centre shifts for a sheet of rms ``thickness`` mm: for the curve of the
    surface, and for its slant alone; NaN where that is not known. Then how many steps to either
    side the curve was taken over, 0 there. ``width`` (s, n) px rms of the stripe.

    The last points of a profile have no curvature; what they lie beside is not seen.
    """
    s, n, _ = points.shape
    curve, slant = np.full((s, n), np.nan), np.full((s, n), np.nan)
    over = np.zeros((s, n), np.int16)
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
            # None in a turn of fewer than four steps.
            if m == 0 or (not closed and (k + m >= s or k < m)):
                continue
            a, b = (
                _from(here, _at(points, (k - m) % s, j)),
                _from(here, _at(points, (k + m) % s, j)),
            )
            while _short(a, b, _REACHED * span):
                m *= 2
                if m > min(_MOST_SHORT, s // 4) or (not closed and (k + m >= s or k < m)):
                    break
                a, b = (
                    _from(here, _at(points, (k - m) % s, j)),
                    _from(here, _at(points, (k + m) % s, j)),
                )
            if _short(a, b, _REACHED * span) or (m >= _SEVERAL and _jumps(points, k, j, m)):
                continue
            sight, rise = _from(here, eye), _rise(points, k, j)
            one, other = _shift(
                a, b, rise, sight, _at(moves, k, j), _at(sheets, k, j), thickness, width[k, j]
            )
            if not np.isnan(one):
                curve[k, j], slant[k, j], over[k, j] = one, other, m
    return curve, slant, over


@njit(cache=True, nogil=True)
def _jumps(points: Floats, k: int, j: int, m: int) -> bool:
    """Whether one step of those from ``m`` before to m after a point is as long as half of the way
    to one end: on a thin body beside the axis the far side may lie between."""
    s = len(points)
    for sign in (1, -1):
        end = _from(_at(points, k, j), _at(points, (k + sign * m) % s, j))
        most = _LONG**2 * _dot(end, end)
        for i in range(m):
            a, b = (k + sign * i) % s, (k + sign * (i + 1)) % s
            step = _from(_at(points, a, j), _at(points, b, j))
            # NaN, where one is missing, is a gap as well.
            if not _dot(step, step) <= most:
                return True
    return False


@njit(cache=True, nogil=True)
def _rise(points: Floats, k: int, j: int) -> Vector:
    """The way along a profile about a point, over `_ALONG` lines to either side or fewer; NaN at
    its ends."""
    n = points.shape[1]
    for i in range(_ALONG, 0, -1):
        if j >= i and j + i < n:
            way = _from(_at(points, k, j - i), _at(points, k, j + i))
            if _dot(way, way) > 0.0:
                return way
    return np.nan, np.nan, np.nan


@njit(cache=True, nogil=True)
def _cross(a: Vector, b: Vector) -> Vector:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@njit(cache=True, nogil=True)
def _in_line(
    t: Vector, bend: Vector, rise: Vector, v: Vector, pixel: Vector
) -> tuple[Vector, Vector]:
    """Tangent and curvature of the surface's section by the plane in which one line of the picture
    looks, which holds ``v`` and ``pixel``, from those ``t`` and ``bend`` of the curve across the
    profiles and the way ``rise`` along them.

    Meusnier: where two sections share their tangent, their curvatures have the same part along the
    surface's normal. The tangents differ by a few degrees, and the normal curvature is taken to be
    the same. The curve itself where the surface's normal is not known or lies across the plane.
    """
    normal, plane = _cross(t, rise), _cross(v, pixel)
    size = np.sqrt(_dot(normal, normal) * _dot(plane, plane))
    if not size > 0.0:
        return t, bend
    normal = _over(normal, np.sqrt(_dot(normal, normal)))
    plane = _over(plane, np.sqrt(_dot(plane, plane)))
    section = _cross(normal, plane)
    slope = np.sqrt(_dot(section, section))
    if slope < _LEAST:
        return t, bend
    section = _over(section, slope if _dot(section, t) > 0.0 else -slope)
    # In the plane, square to the section: the part of the normal along it is the slope.
    inward = _cross(plane, section)
    by = _dot(bend, normal) / _dot(inward, normal)
    return section, (by * inward[0], by * inward[1], by * inward[2])


@njit(cache=True, nogil=True)
def _shift(
    a: Vector, b: Vector, rise: Vector, v: Vector, move: Vector, sheet: Vector, thickness: float,
    width: float,
) -> tuple[float, float]:  # fmt: skip
    """px that the centre of a point shifts for its curve and for its slant; NaN where no curvature
    is known. The curve goes on to ``a`` and ``b`` from there, the profile along ``rise``, and the
    camera is at ``v``."""
    la, lb = np.sqrt(_dot(a, a)), np.sqrt(_dot(b, b))
    if not (la > 0.0 and lb > 0.0 and la < _LOPSIDED * lb and lb < _LOPSIDED * la):
        return np.nan, np.nan
    if _dot(a, b) > -_STRAIGHT * la * lb:
        return np.nan, np.nan
    one, two = _over(a, la), _over(b, lb)
    bend = (
        2.0 * (one[0] + two[0]) / (la + lb),
        2.0 * (one[1] + two[1]) / (la + lb),
        2.0 * (one[2] + two[2]) / (la + lb),
    )
    t = _from(a, b)
    t = _over(t, np.sqrt(_dot(t, t)))
    far = np.sqrt(_dot(v, v))
    v = _over(v, far)
    along = _dot(move, v)
    flat = (move[0] - along * v[0], move[1] - along * v[1], move[2] - along * v[2])
    pixel = _over(flat, _dot(flat, flat))
    t, bend = _in_line(t, bend, rise, v, pixel)
    c = _dot(t, sheet)
    if abs(c) < _LEAST:
        return np.nan, np.nan
    across = _dot(v, t)
    normal = (v[0] - across * t[0], v[1] - across * t[1], v[2] - across * t[2])
    facing = np.sqrt(_dot(normal, normal))
    if facing < _LEAST:
        return np.nan, np.nan
    normal = _over(normal, facing)
    ta = _dot(t, pixel)
    drawn = (thickness / c) ** 2
    whole = 3.0
    if width > 0.0:
        whole -= _CUT_OFF * min(drawn * ta**2 / width**2, 1.0)
    sinks = _dot(bend, pixel) / 2
    beside = (whole - 2.0) * ta * _dot(bend, sheet) / (2 * c)
    seen = (whole - 1.0) / 2 * ta * across * _dot(bend, normal) / facing
    return (sinks - beside - seen) * drawn, whole * ta * across / far * drawn


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
    """(s, n) what each value and those as many ``steps`` before and after as it was taken over say
    together: their mean where they are alike, else the least; 0 where they differ in sign.

    The least of three that differ by noise alone would be too small. A neighbour that is missing
    says nothing.
    """
    s, n = values.shape
    out = np.full((s, n), np.nan)
    for k in range(s):
        for j in range(n):
            if np.isnan(values[k, j]):
                continue
            low = high = total = values[k, j]
            count = 1
            for way in (-1, 1):
                m = k + way * steps[k, j]
                if closed:
                    m %= s
                if m < 0 or m >= s or np.isnan(values[m, j]):
                    continue
                low, high = min(low, values[m, j]), max(high, values[m, j])
                total += values[m, j]
                count += 1
            least = low if low > 0.0 else high
            if low <= 0.0 <= high:
                out[k, j] = 0.0
            elif abs(least) >= _SAME * max(-low, high):
                out[k, j] = total / count
            else:
                out[k, j] = least
    return out
