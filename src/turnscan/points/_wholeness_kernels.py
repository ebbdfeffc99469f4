"""Compiled kernels of how whole the light of each point was; imported only when they are used."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.compiled import njit

_BESIDE = 2
"""Lines on either side that a width is the median of: speckle widens single lines by a tenth."""
_LINKED = 2.2
"""Usual arcs of a step that two points of one line may lie apart on one surface."""
_FAR = 6
"""Steps to either side that are looked at, at most, for a point that noise does not tilt."""


@njit(cache=True, nogil=True)
def steady(width: Floats) -> Floats:
    """(s, n) the median of each width and up to two beside it along the run; NaN where none is."""
    s, n = width.shape
    out = np.empty((s, n))
    out[:] = np.nan
    some = np.empty(2 * _BESIDE + 1)
    for k in range(s):
        for j in range(n):
            if np.isnan(width[k, j]):
                continue
            low, high = j, j
            while low > max(0, j - _BESIDE) and not np.isnan(width[k, low - 1]):
                low -= 1
            while high < min(n - 1, j + _BESIDE) and not np.isnan(width[k, high + 1]):
                high += 1
            have = 0
            for i in range(low, high + 1):  # the few are kept in order
                place = have
                while place > 0 and some[place - 1] > width[k, i]:
                    some[place] = some[place - 1]
                    place -= 1
                some[place] = width[k, i]
                have += 1
            out[k, j] = (some[(have - 1) // 2] + some[have // 2]) / 2
    return out


@njit(cache=True, nogil=True)
def _normal(points: Floats, k: int, m: int, j: int, sign: float, normal: Floats) -> bool:
    """Write the normal (any sign, unit) of a surface through a point and one of step ``m``."""
    n = points.shape[1]
    low = j - 1 if j > 0 and not np.isnan(points[k, j - 1, 0]) else j
    high = j + 1 if j + 1 < n and not np.isnan(points[k, j + 1, 0]) else j
    if low == high:
        return False
    u0 = points[k, high, 0] - points[k, low, 0]
    u1 = points[k, high, 1] - points[k, low, 1]
    u2 = points[k, high, 2] - points[k, low, 2]
    v0 = sign * (points[m, j, 0] - points[k, j, 0])
    v1 = sign * (points[m, j, 1] - points[k, j, 1])
    v2 = sign * (points[m, j, 2] - points[k, j, 2])
    normal[0], normal[1], normal[2] = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    size = np.sqrt((normal * normal).sum())
    if not size > 0.0:
        return False
    normal /= size
    return True


@njit(cache=True, nogil=True)
def beside(
    points: Floats, k: int, j: int, sign: int, arc: Floats, least: float, closed: bool
) -> tuple[int, bool]:
    """The nearest step whose point is linked and lies ``least`` mm off, and whether there is one.

    Without one the last step that is linked; −1 where the very next is no neighbour.
    """
    s = len(points)
    last = -1
    m = k
    for _ in range(_FAR):
        before, m = m, m + sign
        if closed:
            m %= s
        if m < 0 or m >= s or m == k or np.isnan(points[m, j, 0]):
            break
        step = points[m, j] - points[before, j]
        if np.sqrt((step * step).sum()) > _LINKED * arc[before, j]:
            break
        last = m
        gap = points[m, j] - points[k, j]
        if np.sqrt((gap * gap).sum()) >= least:
            return last, True
    return last, False


@njit(cache=True, nogil=True)
def across(
    points: Floats,
    eyes: Floats,
    moves: Floats,
    sheets: Floats,
    arc: Floats,
    least: float,
    closed: bool,
    span: tuple[int, int],
    out: Floats,
) -> None:
    """How the surface between each point and the next profile lies to the light, both ways.

    ``moves`` (s, n, 3) is ∂X/∂u at the point's depth, square to nothing in particular: the ray's
    end for the next pixel; ``sheets`` (s, n, 3) the sheet's normal, ``arc`` (s, n) mm the usual
    way to the next step. A neighbour is the nearest point that lies ``least`` mm off: noise tilts
    what is nearer. Writes into ``out`` (3, 2, s, n), full of NaN, for the steps of a ``span`` from
    the first to before the last: walk (2, s, n): mm that one pixel leads away from the sheet on
    the plane through the profile and its neighbour after and before, NaN where there is none,
    infinite where none lies so far off, as on the axis of the table, which nothing turns;
    slide (2, s, n): the share of a turn's movement that is along the plane's normal; and side
    (2, s, n): 1 where the neighbour lies on the side of higher pixels, else −1.
    """
    n = points.shape[1]
    walk, slide, side = out[0], out[1], out[2]
    normal = np.empty(3)
    for k in range(span[0], span[1]):
        for j in range(n):
            if np.isnan(points[k, j, 0]):
                continue
            for way in range(2):
                m, far = beside(points, k, j, 1 - 2 * way, arc, least, closed)
                if m < 0:
                    continue
                gap = points[m, j] - points[k, j]
                if not _normal(points, k, m, j, 1.0 - 2.0 * way, normal):
                    continue
                ray = points[k, j] - eyes[k]
                along = (normal * moves[k, j]).sum() / (normal * ray).sum()
                away = moves[k, j] - ray * along
                walk[way, k, j] = abs((sheets[k, j] * away).sum()) if far else np.inf
                # Both as the camera sees them, square to the ray.
                flat = gap - ray * ((gap * ray).sum() / (ray * ray).sum())
                side[way, k, j] = 1.0 if (flat * moves[k, j]).sum() > 0.0 else -1.0
                reach = np.hypot(points[k, j, 0], points[k, j, 1])
                turn = normal[1] * points[k, j, 0] - normal[0] * points[k, j, 1]
                slide[way, k, j] = abs(turn) / max(reach, 1e-9)


@njit(cache=True, nogil=True)
def further_in(
    points: Floats,
    eyes: Floats,
    moves: Floats,
    sheets: Floats,
    arc: Floats,
    least: float,
    closed: bool,
    span: tuple[int, int],
    walk: Floats,
    far: int,
) -> None:
    """The walk of `across` on the plane of the profiles ``far`` and one more steps off.

    As the light of each point's own step sees it. Writes into ``walk`` (2, s, n), full of NaN, for
    the steps of a ``span``; NaN stays where one on the way is no neighbour, or the two are less
    than ``least`` mm apart.
    """
    s, n, _ = points.shape
    normal = np.empty(3)
    for k in range(span[0], span[1]):
        for way in range(2):
            sign = 1 - 2 * way
            o = k + sign * (far + 1)
            if not closed and (o < 0 or o >= s):
                continue
            m, o = (k + sign * far) % s, o % s
            for j in range(n):
                linked = True
                for i in range(far + 1):
                    a, b = (k + sign * i) % s, (k + sign * (i + 1)) % s
                    step = points[b, j] - points[a, j]
                    # NaN, where one is missing, is no neighbour either.
                    if not np.sqrt((step * step).sum()) <= _LINKED * arc[a, j]:
                        linked = False
                        break
                gap = points[o, j] - points[m, j]
                if not linked or not np.sqrt((gap * gap).sum()) >= least:
                    continue
                if not _normal(points, m, o, j, float(sign), normal):
                    continue
                ray = points[k, j] - eyes[k]
                along = (normal * moves[k, j]).sum() / (normal * ray).sum()
                walk[way, k, j] = abs((sheets[k, j] * (moves[k, j] - ray * along)).sum())
