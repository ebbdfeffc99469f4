"""Compiled kernels of how whole the light of each point was; imported only when they are used."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.compiled import njit

Vector = tuple[float, float, float]
Pair = tuple[float, float]
Places = tuple[Floats, Floats, Floats, Floats]
"""Points (s, n, 3) mm, the camera (s, 3) mm at each step, the sheet's normals (s, n, 3), and the
usual way (s, n) mm of each point to the next step."""

_BESIDE = 2
"""Lines on either side that a width is the median of: speckle widens single lines by a tenth."""
_LINKED = 2.2
"""Usual arcs of a step that two points of one line may lie apart on one surface."""
_FAR = 6
"""Steps to either side that are looked at, at most, for a point that noise does not tilt."""
_CUT_OFF, _MOST_IN = 2.0, 6
"""Thicknesses of the sheet beside an end of what is seen within which something may cut a stripe,
and points that are looked at for an end, at most."""
_ALONG = 4.0
"""Usual ways that two points of a profile may lie apart on one surface."""
_TAIL = 3.0
"""Thicknesses of the sheet beyond its middle as far as a tail of its light is seen."""


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
def _put(some: Floats, count: int, value: float) -> None:
    """Put a value into the first ``count`` of an array, which are in order."""
    place = count
    while place > 0 and some[place - 1] > value:
        some[place] = some[place - 1]
        place -= 1
    some[place] = value


@njit(cache=True, nogil=True)
def _take(some: Floats, count: int, value: float) -> None:
    """Take a value that is there out of the first ``count`` of an array, which are in order."""
    place = np.searchsorted(some[:count], value)
    for i in range(place, count - 1):
        some[i] = some[i + 1]


@njit(cache=True, nogil=True)
def usual(width: Floats, reach: int) -> Floats:
    """(s, n) the median of the widths up to ``reach`` lines off in a profile, gaps left out; NaN
    where no width is."""
    s, n = width.shape
    out = np.full((s, n), np.nan)
    some = np.empty(2 * reach + 2)
    for k in range(s):
        have = 0
        for j in range(-reach, n):
            if j + reach < n and not np.isnan(width[k, j + reach]):
                _put(some, have, width[k, j + reach])
                have += 1
            if j - reach - 1 >= 0 and not np.isnan(width[k, j - reach - 1]):
                _take(some, have, width[k, j - reach - 1])
                have -= 1
            if j >= 0 and not np.isnan(width[k, j]):
                out[k, j] = (some[(have - 1) // 2] + some[have // 2]) / 2
    return out


@njit(cache=True, nogil=True)
def dot(a: Vector, b: Vector) -> float:
    """Their scalar product; kernels keep vectors in registers, arrays would be made on the heap."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, nogil=True)
def cross(a: Vector, b: Vector) -> Vector:
    """Their vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, nogil=True)
def way(points: Floats, k: int, j: int, m: int, i: int) -> Vector:
    """From the point (k, j) to the point (m, i); NaN where one is missing."""
    return (
        points[m, i, 0] - points[k, j, 0],
        points[m, i, 1] - points[k, j, 1],
        points[m, i, 2] - points[k, j, 2],
    )


@njit(cache=True, nogil=True)
def _off(a: Vector, b: Vector, share: float) -> Vector:
    """a less a share of b."""
    return a[0] - b[0] * share, a[1] - b[1] * share, a[2] - b[2] * share


@njit(cache=True, nogil=True)
def _normal(points: Floats, k: int, m: int, j: int, sign: float) -> tuple[bool, Vector]:
    """The normal (any sign, unit) of a surface through a point and one of step ``m``, if any."""
    n = points.shape[1]
    low = j - 1 if j > 0 and not np.isnan(points[k, j - 1, 0]) else j
    high = j + 1 if j + 1 < n and not np.isnan(points[k, j + 1, 0]) else j
    if low == high:
        return False, (0.0, 0.0, 0.0)
    v = way(points, k, j, m, j)
    normal = cross(way(points, k, low, k, high), (sign * v[0], sign * v[1], sign * v[2]))
    size = np.sqrt(dot(normal, normal))
    if not size > 0.0:
        return False, normal
    return True, (normal[0] / size, normal[1] / size, normal[2] / size)


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
        step = way(points, before, j, m, j)
        if np.sqrt(dot(step, step)) > _LINKED * arc[before, j]:
            break
        last = m
        gap = way(points, k, j, m, j)
        if np.sqrt(dot(gap, gap)) >= least:
            return last, True
    return last, False


@njit(cache=True, nogil=True)
def _at(vectors: Floats, k: int, j: int) -> Vector:
    return vectors[k, j, 0], vectors[k, j, 1], vectors[k, j, 2]


@njit(cache=True, nogil=True)
def _ray(points: Floats, eyes: Floats, k: int, j: int) -> Vector:
    return points[k, j, 0] - eyes[k, 0], points[k, j, 1] - eyes[k, 1], points[k, j, 2] - eyes[k, 2]


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
    for k in range(span[0], span[1]):
        for j in range(n):
            if np.isnan(points[k, j, 0]):
                continue
            ray, move = _ray(points, eyes, k, j), _at(moves, k, j)
            for hand in range(2):
                m, far = beside(points, k, j, 1 - 2 * hand, arc, least, closed)
                if m < 0:
                    continue
                there, normal = _normal(points, k, m, j, 1.0 - 2.0 * hand)
                if not there:
                    continue
                away = _off(move, ray, dot(normal, move) / dot(normal, ray))
                walk[hand, k, j] = abs(dot(_at(sheets, k, j), away)) if far else np.inf
                # Both as the camera sees them, square to the ray.
                gap = way(points, k, j, m, j)
                flat = _off(gap, ray, dot(gap, ray) / dot(ray, ray))
                side[hand, k, j] = 1.0 if dot(flat, move) > 0.0 else -1.0
                reach = np.hypot(points[k, j, 0], points[k, j, 1])
                turn = normal[1] * points[k, j, 0] - normal[0] * points[k, j, 1]
                slide[hand, k, j] = abs(turn) / max(reach, 1e-9)


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
    for k in range(span[0], span[1]):
        for hand in range(2):
            sign = 1 - 2 * hand
            o = k + sign * (far + 1)
            if not closed and (o < 0 or o >= s):
                continue
            m, o = (k + sign * far) % s, o % s
            for j in range(n):
                linked = True
                for i in range(far + 1):
                    a, b = (k + sign * i) % s, (k + sign * (i + 1)) % s
                    step = way(points, a, j, b, j)
                    # NaN, where one is missing, is no neighbour either.
                    if not np.sqrt(dot(step, step)) <= _LINKED * arc[a, j]:
                        linked = False
                        break
                gap = way(points, m, j, o, j)
                if not linked or not np.sqrt(dot(gap, gap)) >= least:
                    continue
                there, normal = _normal(points, m, o, j, float(sign))
                if not there:
                    continue
                ray, move = _ray(points, eyes, k, j), _at(moves, k, j)
                away = _off(move, ray, dot(normal, move) / dot(normal, ray))
                walk[hand, k, j] = abs(dot(_at(sheets, k, j), away))


@njit(cache=True, nogil=True)
def _next_on_surface(
    places: Places, limits: Pair, at: tuple[int, int], axis: int, sign: int, closed: bool
) -> tuple[int, int]:
    """The next place of a grid in a direction, if its point may lie on one surface with that at
    (step, line), or in the tail of its stripe; else (−1, −1).

    Where a near surface ends, its tail is seen on it while the sheet passes on, and its points move
    along the ray. They lie as far beside it as the sheet is thick. ``limits``, mm: how far apart
    along a profile, and how thick the sheet is as far as its tails reach.
    """
    points, eyes, sheets, arc = places
    (s, n, _), (k, j) = points.shape, at
    m, i = (k + sign, j) if axis == 0 else (k, j + sign)
    if closed:
        m %= s
    if m < 0 or m >= s or i < 0 or i >= n:
        return -1, -1
    gap = way(points, k, j, m, i)
    size = np.sqrt(dot(gap, gap))
    if axis == 1:
        return (m, i) if size <= limits[0] else (-1, -1)
    ray = _ray(points, eyes, k, j)
    far = np.sqrt(dot(ray, ray))
    along = abs(dot(gap, ray)) / far
    lean = abs(dot(_at(sheets, k, j), ray)) / far
    aside = np.sqrt(max(size * size - along * along, 0.0))
    linked = max(_LINKED * max(arc[k, j], arc[m, i]), limits[1] / _TAIL)
    goes_on = aside <= linked and along <= max(linked, limits[1] / max(lean, 1e-9))
    return (m, i) if goes_on else (-1, -1)


@njit(cache=True, nogil=True)
def _ends_within(
    places: Places, limits: Pair, at: tuple[int, int], axis: int, sign: int, closed: bool,
    reach: int,
) -> bool:  # fmt: skip
    """Whether what is seen ends in a direction, fewer than ``reach`` points on."""
    for _ in range(reach):
        at = _next_on_surface(places, limits, at, axis, sign, closed)
        if at[0] < 0:
            return True
    return False


@njit(cache=True, nogil=True)
def _width_further_in(
    places: Places, limits: Pair, at: tuple[int, int], axis: int, sign: int, closed: bool,
    reach: int, width: Floats,
) -> float:  # fmt: skip
    """The median width of the points ``reach`` places on, and one and two more; NaN for none."""
    some, count = np.empty(3), 0
    for far in range(1, reach + 3):
        at = _next_on_surface(places, limits, at, axis, sign, closed)
        if at[0] < 0:
            break
        if far >= reach and not np.isnan(width[at]):
            some[count] = width[at]
            count += 1
    return np.median(some[:count]) if count else np.nan


@njit(cache=True, nogil=True)
def _on_line(
    places: Places, limits: Pair, at: tuple[int, int], closed: bool, width: Floats
) -> float:
    """The median of a width and those before and after it on its line."""
    some, count = np.empty(3), 1
    some[0] = width[at]
    for sign in (1, -1):
        beside = _next_on_surface(places, limits, at, 0, sign, closed)
        if beside[0] >= 0 and not np.isnan(width[beside]):
            some[count] = width[beside]
            count += 1
    return np.median(some[:count])


@njit(cache=True, nogil=True)
def whole_widths(
    places: Places,
    width: Floats,
    steadied: Floats,
    sizes: Pair,
    closed: bool,
    span: tuple[int, int],
    out: Floats,
) -> None:
    """How wide stripes are near an end of what is seen, and how wide those further in.

    ``width`` (s, n) px are those of single stripes, ``steadied`` (s, n) px those of `steady`.
    ``sizes`` mm: how far apart points of a profile usually are, and how thick the sheet is. Ends
    are looked for along lines and along profiles as far as two thicknesses, and not further than
    `_MOST_IN` points; beyond that three points inwards have a median width. Writes both widths of
    the direction in which they differ most into ``out`` (2, s, n) px, full of NaN, for the steps of
    a ``span``.
    """
    apart, thickness = sizes
    for k in range(span[0], span[1]):
        for j in range(width.shape[1]):
            at = (k, j)
            if np.isnan(places[0][k, j, 0]):
                continue
            limits = (_ALONG * apart, _TAIL * thickness)
            for axis in range(2):
                step = places[3][at] if axis == 0 else apart
                if step > _CUT_OFF * thickness:  # what is further in is no longer the same surface
                    continue
                steps = np.ceil(_CUT_OFF * thickness / max(step, 1e-9))
                reach = int(min(max(steps, 2.0), _MOST_IN))
                for sign in (1, -1):
                    if not _ends_within(places, limits, at, axis, sign, closed, reach):
                        continue
                    whole = _width_further_in(
                        places, limits, at, axis, -sign, closed, reach, steadied
                    )
                    own = steadied[at]
                    if axis == 1:  # along the profile a median would even its end out
                        own = _on_line(places, limits, at, closed, width)
                    if whole > 0.0 and not out[1, k, j] * own >= out[0, k, j] * whole:
                        out[0, k, j], out[1, k, j] = own, whole
