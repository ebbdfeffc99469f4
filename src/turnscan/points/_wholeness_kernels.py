"""Compiled kernels of how whole the light of each point was; imported only when they are used."""

from __future__ import annotations

from math import erf

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.compiled import njit

Vector = tuple[float, float, float]
Pair = tuple[float, float]
Places = tuple[Floats, Floats, Floats, Floats]
"""Points (s, n, 3) mm, the camera (s, 3) mm at each step, the sheet's normals (s, n, 3), and the
usual way (s, n) mm of each point to the next step."""

_BESIDE = 2
"""Lines on either side that a width is the median of: speckle widens single lines by a tenth."""
LINKED = 2.2
"""Usual arcs of a step that two points of one line may lie apart on one surface."""
_GRAZED = 4.5
"""The same where the line leads straight on there: on a surface that turns away from the light
steps are longer, …"""
_ON, _EVEN = 0.978, 0.3
"""… the cosine of the bend up to which it does, and the part of a step that the next one is long,
at least, which tells that."""
_FAR = 6
"""Steps to either side that are looked at, at most, for a point that noise does not tilt."""
_MEET, _MEET_AT = 30, 3.0
"""Places to either side of the sheet's middle at which two surfaces may meet, and thicknesses of
the sheet from there to the last."""


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
def usual_beside(value: Floats, reach: int) -> Floats:
    """(s, n) the smaller one of two medians along a row: of up to ``reach`` values before and
    after, gaps left out; NaN where one side has none."""
    s, n = value.shape
    out = np.full((s, n), np.nan)
    before, after = np.empty(reach + 2), np.empty(reach + 2)
    for k in range(s):
        lower = upper = 0
        for j in range(min(reach, n)):
            if not np.isnan(value[k, j]):
                _put(after, upper, value[k, j])
                upper += 1
        for j in range(n):
            if not np.isnan(value[k, j]):
                _take(after, upper, value[k, j])
                upper -= 1
            if j + reach < n and not np.isnan(value[k, j + reach]):
                _put(after, upper, value[k, j + reach])
                upper += 1
            if lower and upper:
                a = (before[(lower - 1) // 2] + before[lower // 2]) / 2
                b = (after[(upper - 1) // 2] + after[upper // 2]) / 2
                out[k, j] = min(a, b)
            if not np.isnan(value[k, j]):
                _put(before, lower, value[k, j])
                lower += 1
            if j - reach >= 0 and not np.isnan(value[k, j - reach]):
                _take(before, lower, value[k, j - reach])
                lower -= 1
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
def less(a: Vector, b: Vector, share: float) -> Vector:
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
def _linked(
    points: Floats, arc: Floats, k: int, j: int, sign: int, closed: bool, on: bool = False
) -> int:
    """The next step in a direction, if its point may lie on one surface with that of (k, j); else
    −1. With ``on`` also over a long step where the line leads straight on."""
    s = len(points)
    m = k + sign
    if closed:
        m %= s
    if m < 0 or m >= s:
        return -1
    step = way(points, k, j, m, j)
    square, usual = dot(step, step), arc[k, j] * arc[k, j]
    if square <= LINKED * LINKED * usual:
        return m
    # NaN, where one is missing, is no neighbour either.
    if not on or not square <= _GRAZED * _GRAZED * usual:
        return -1
    before, after = k - sign, m + sign
    if closed:
        before, after = before % s, after % s
    for a, b in ((before, k), (m, after)):
        if min(a, b) >= 0 and max(a, b) < s:
            other = way(points, a, j, b, j)
            long = dot(other, other)
            straight = dot(step, other) >= _ON * np.sqrt(square * long)
            if straight and long >= _EVEN * _EVEN * square:
                return m
    return -1


@njit(cache=True, nogil=True)
def beside(
    points: Floats,
    k: int,
    j: int,
    sign: int,
    arc: Floats,
    least: float,
    closed: bool,
    on: bool = False,
) -> tuple[int, bool]:
    """The nearest step whose point is linked and lies ``least`` mm off, and whether there is one.

    Without one the last step that is linked; −1 where the very next is no neighbour. ``on`` as in
    `_linked`.
    """
    last = -1
    m = k
    for _ in range(_FAR):
        m = _linked(points, arc, m, j, sign, closed, on)
        if m < 0 or m == k:
            break
        last = m
        gap = way(points, k, j, m, j)
        if np.sqrt(dot(gap, gap)) >= least:
            return last, True
    return last, False


@njit(cache=True, nogil=True)
def straight_beyond(
    points: Floats, arc: Floats, closed: bool, span: tuple[int, int], out: Bools
) -> None:
    """Make (s, n) True where a line leads straight on to a next point that is too far to be linked,
    for the steps of a ``span``. On a surface that turns away from the light steps grow.
    """
    for k in range(span[0], span[1]):
        for j in range(points.shape[1]):
            for sign in (1, -1):
                if _linked(points, arc, k, j, sign, closed) < 0:
                    out[k, j] = out[k, j] or _linked(points, arc, k, j, sign, closed, True) >= 0


@njit(cache=True, nogil=True)
def vector(vectors: Floats, k: int, j: int) -> Vector:
    """The one at step k and line j of (s, n, 3)."""
    return vectors[k, j, 0], vectors[k, j, 1], vectors[k, j, 2]


@njit(cache=True, nogil=True)
def ray_of(points: Floats, eyes: Floats, k: int, j: int) -> Vector:
    """From the camera to the point at step k and line j, mm."""
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
            ray, move = ray_of(points, eyes, k, j), vector(moves, k, j)
            for hand in range(2):
                m, far = beside(points, k, j, 1 - 2 * hand, arc, least, closed)
                if m < 0:
                    continue
                there, normal = _normal(points, k, m, j, 1.0 - 2.0 * hand)
                if not there:
                    continue
                away = less(move, ray, dot(normal, move) / dot(normal, ray))
                walk[hand, k, j] = abs(dot(vector(sheets, k, j), away)) if far else np.inf
                # Both as the camera sees them, square to the ray.
                gap = way(points, k, j, m, j)
                flat = less(gap, ray, dot(gap, ray) / dot(ray, ray))
                side[hand, k, j] = 1.0 if dot(flat, move) > 0.0 else -1.0
                reach = np.hypot(points[k, j, 0], points[k, j, 1])
                turn = normal[1] * points[k, j, 0] - normal[0] * points[k, j, 1]
                slide[hand, k, j] = abs(turn) / max(reach, 1e-9)


@njit(cache=True, nogil=True)
def _plane_beside(
    places: Places, at: tuple[int, int], sign: int, least: float, closed: bool, far: int
) -> tuple[bool, int, Vector]:
    """Whether the profiles ``far`` and one more steps off, in a direction, are linked to a point,
    the step of the nearer, and the normal (any sign, unit) of the plane through both. Where these
    lie less than ``least`` mm apart, which noise tilts, the next that does not is taken."""
    points, _, _, arc = places
    o, j = at
    m = o
    for _ in range(far + 1):
        m, o = o, _linked(points, arc, o, j, sign, closed)
        if o < 0:
            return False, -1, (0.0, 0.0, 0.0)
    for _ in range(_FAR):
        gap = way(points, m, j, o, j)
        if np.sqrt(dot(gap, gap)) >= least:
            there, normal = _normal(points, m, o, j, float(sign))
            return there, m, normal
        o = _linked(points, arc, o, j, sign, closed)
        if o < 0 or o == m:
            break
    return False, -1, (0.0, 0.0, 0.0)


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
    the steps of a ``span``; NaN stays where one on the way is no neighbour, or no other further on
    lies ``least`` mm from the first (`_plane_beside`).
    """
    places = points, eyes, sheets, arc
    for k in range(span[0], span[1]):
        for hand in range(2):
            for j in range(points.shape[1]):
                if np.isnan(points[k, j, 0]):
                    continue
                there, _, normal = _plane_beside(places, (k, j), 1 - 2 * hand, least, closed, far)
                if not there:
                    continue
                ray, move = ray_of(points, eyes, k, j), vector(moves, k, j)
                away = less(move, ray, dot(normal, move) / dot(normal, ray))
                walk[hand, k, j] = abs(dot(vector(sheets, k, j), away))


@njit(cache=True, nogil=True)
def crease(k: float, high: Vector, low: Vector) -> Pair:
    """px that the centre of a sheet's light is off that of its middle on two lines that meet ``k``
    thicknesses beside it, and how wide it is, px rms.

    Of each, that above k and that below: px for a thickness, px at the sheet's middle, and light.
    """
    ridge = np.exp(-0.5 * k * k) / np.sqrt(2.0 * np.pi)
    below = 0.5 * (1.0 + erf(k / np.sqrt(2.0)))
    above = 1.0 - below
    light = low[2] * below + high[2] * above
    first = low[2] * (low[1] * below - low[0] * ridge)
    first += high[2] * (high[1] * above + high[0] * ridge)
    second = low[1] ** 2 * below - 2.0 * low[0] * low[1] * ridge + low[0] ** 2 * (below - k * ridge)
    second *= low[2]
    more = high[1] ** 2 * above + 2.0 * high[0] * high[1] * ridge
    second += high[2] * (more + high[0] ** 2 * (above + k * ridge))
    centre = first / light
    width = np.sqrt(max(second / light - centre**2, 0.0))
    return centre - (low[1] if k > 0.0 else high[1]), width


@njit(cache=True, nogil=True)
def told_by_width(narrow: Floats, wide: Floats, bright: Floats, own: Floats) -> Floats:
    """(m,) px that the centre of a sheet's light is off on two lines that make it ``narrow`` and
    ``wide`` (m,) px, towards the latter, which sends ``bright`` (m,) times as much of it: where
    they meet so that it is about as wide as its ``own`` (m,) px."""
    out = np.empty(len(own))
    for i in range(len(own)):
        nearest, n, w = np.inf, narrow[i], wide[i]
        for step in range(-_MEET, _MEET + 1):
            k = step * _MEET_AT / _MEET
            centre, width = crease(k, (w, -w * k, bright[i]), (n, -n * k, 1.0))
            if abs(width - own[i]) < nearest:
                nearest, out[i] = abs(width - own[i]), centre
    return out


@njit(cache=True, nogil=True)
def folded(
    points: Floats,
    eyes: Floats,
    moves: Floats,
    sheets: Floats,
    arc: Floats,
    least: float,
    closed: bool,
    span: tuple[int, int],
    out: Floats,
    sheet: tuple[float, int],
) -> None:
    """What the planes of profiles before and after do to a stripe that lies on both.

    Places as in `across`; ``sheet`` is how thick it is, mm, and how many steps off the nearer two
    profiles are; the others are one more. In the plane of a point's ray and that of the next pixel
    both are lines: a light of Gaussian profile falls on either as far as where they meet, and each
    sends as much of it to the camera as it faces it. Writes into ``out`` (5, m, n), full of NaN,
    for the m steps of a ``span``: px that the centre is off; how much wider a stripe is on the
    plane after, and on that before, in the light of the point's own step than in that of the
    profile there, as the table turns them; and how much more light they send in it. NaN stays where
    one on the way is no neighbour, where no two of a side are ``least`` mm apart, or where both
    sides lie on one of the sheet.
    """
    places = points, eyes, sheets, arc
    thickness, far = sheet
    for k in range(span[0], span[1]):
        for j in range(points.shape[1]):
            if np.isnan(points[k, j, 0]):
                continue
            after = _plane_beside(places, (k, j), 1, least, closed, far)
            before = _plane_beside(places, (k, j), -1, least, closed, far)
            if not after[0] or not before[0]:
                continue
            m, o = after[1], before[1]
            to, back = way(points, k, j, m, j), way(points, k, j, o, j)
            ray, move, normal = (
                ray_of(points, eyes, k, j),
                vector(moves, k, j),
                vector(sheets, k, j),
            )
            one = _line_on(after[2], to, ray, move, normal)
            other = _line_on(before[2], back, ray, move, normal)
            bend = one[0] - other[0]
            if not dot(normal, to) * dot(normal, back) < 0.0 or not abs(bend) > 1e-9:
                continue
            meet = (other[1] - one[1]) / bend / thickness
            first = (one[0] * thickness, one[1], one[2])
            second = (other[0] * thickness, other[1], other[2])
            high, low = (first, second) if dot(normal, to) > 0.0 else (second, first)
            out[0, k - span[0], j] = crease(meet, high, low)[0]
            own = _line_on(
                after[2],
                to,
                ray_of(points, eyes, m, j),
                vector(moves, m, j),
                vector(sheets, m, j),
            )
            out[1, k - span[0], j], out[3, k - span[0], j] = abs(one[0] / own[0]), one[2] / own[2]
            own = _line_on(
                before[2],
                back,
                ray_of(points, eyes, o, j),
                vector(moves, o, j),
                vector(sheets, o, j),
            )
            out[2, k - span[0], j], out[4, k - span[0], j] = (
                abs(other[0] / own[0]),
                other[2] / own[2],
            )


@njit(cache=True, nogil=True)
def _line_on(normal: Vector, to: Vector, ray: Vector, move: Vector, sheet: Vector) -> Vector:
    """A plane of this ``normal`` through what lies ``to`` from a point, as the light sees it: px
    for each mm across the sheet, px off the point at the sheet's middle, and the cosine under which
    it is seen."""
    facing = dot(normal, ray)
    away = less(move, ray, dot(normal, move) / facing)
    slope = 1.0 / dot(sheet, away)
    seen = abs(facing) / np.sqrt(dot(ray, ray))
    return slope, -dot(normal, to) / facing * dot(sheet, ray) * slope, seen
