"""Compiled kernels of the grid's mesh; imported only when they are used."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, Longs
from turnscan.compiled import njit

_DEEP = 0.75
"""cos² 30°: a profile nearer to the ray than that lies on a surface that is seen from the edge."""
_LEANING = 0.5
"""Of the shorter side of a quad, that its other sides lean along it from which on it leans …"""
_ABOUT = 4
"""… in the mean of so many quads on either side along the profile."""


class Measured(NamedTuple):
    """A grid as its faces see it."""

    points: Floats
    """(s, n, 3) mm."""
    noise: Floats
    """(s, n) mm: excuses a long side."""
    sigma: Floats
    """(s, n) mm: excuses a deep one."""
    side: Bools
    """(s, n) True beyond the rotation axis."""
    eyes: Floats
    """(s, 3) mm: where the camera was; NaN where that is not known."""


class Sides(NamedTuple):
    """The sides to the next step and line, all (s, n)."""

    to_step: Floats
    to_line: Floats
    """mm; NaN where there is none."""
    usual_step: Floats
    usual_line: Floats
    """mm that they have there as a rule."""
    steady: Bools
    """True where what goes to the next step leads on alike."""


class Limits(NamedTuple):
    """What a face may be; docs/explain/surface.md, Faces."""

    stretch: float
    """Of a side, in its usual length; longer ones need an excuse."""
    jump: float
    """Noises that excuse a side."""
    cos_grazing: float
    """Of the angle between its normal and the ray; below it needs an excuse."""


class Quad(NamedTuple):
    """Four neighbours of a grid, in turn."""

    q: Floats
    """(4, 3) mm."""
    spread: Floats
    """(4, 2) mm: noise and sigma."""
    ratio: Floats
    """(4,) sides 0-1, 1-2, 2-3, 3-0 over their usual lengths."""
    ks: Longs
    """(4,) their steps."""


class Cuts(NamedTuple):
    """Triangles of diagonal 0-2, then of diagonal 1-3."""

    corners: Longs
    """(4, 3) of the quad."""
    sides: Longs
    """(4, 2) of the quad, in each."""


@njit(cache=True, nogil=True)
def _edge(points: Floats, side: Bools, k: int, j: int, m: int, i: int) -> float:
    if side[k, j] != side[m, i]:
        return np.nan
    d0 = points[k, j, 0] - points[m, i, 0]
    d1 = points[k, j, 1] - points[m, i, 1]
    d2 = points[k, j, 2] - points[m, i, 2]
    return np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def edges(points: Floats, side: Bools, closed: bool) -> tuple[Floats, Floats]:
    """Lengths (s, n) of the edges to the next step and to the next line; NaN where there is none.

    Points on different sides of the rotation axis are not neighbours.
    """
    s, n, _ = points.shape
    to_step = np.full((s, n), np.nan)
    to_line = np.full((s, n), np.nan)
    for k in range(s):
        for j in range(n):
            if k + 1 < s or closed:
                to_step[k, j] = _edge(points, side, k, j, (k + 1) % s, j)
            if j + 1 < n:
                to_line[k, j] = _edge(points, side, k, j, k, j + 1)
    return to_step, to_line


@njit(cache=True, nogil=True)
def bends(points: Floats) -> Floats:
    """(s, n) lengths of the second differences along the profiles; NaN at their ends."""
    s, n, _ = points.shape
    out = np.full((s, n), np.nan)
    for k in range(s):
        for j in range(1, n - 1):
            total = 0.0
            for i in range(3):
                bend = points[k, j + 1, i] - 2.0 * points[k, j, i] + points[k, j - 1, i]
                total += bend * bend
            out[k, j] = np.sqrt(total)
    return out


@njit(cache=True, nogil=True)
def usual(
    lengths: Floats, nominal: Floats, along_steps: bool, wraps: bool, least: float, most: float
) -> Floats:
    """Local spacing (s, n): the median of each edge and its two neighbours on either side.

    Between ``least`` and ``most`` times ``nominal`` (s, n); least where fewer than three of the
    five exist.
    """
    s, n = lengths.shape
    out = np.empty((s, n))
    five = np.empty(5)
    for k in range(s):
        for j in range(n):
            out[k, j] = least * nominal[k, j]
            if np.isnan(lengths[k, j]):
                continue
            have = 0
            for o in range(-2, 3):
                a, b = (k + o, j) if along_steps else (k, j + o)
                if along_steps and wraps:
                    a %= s
                if a < 0 or a >= s or b < 0 or b >= n or np.isnan(lengths[a, b]):
                    continue
                # Insertion sort: five numbers at most.
                y = have
                while y > 0 and five[y - 1] > lengths[a, b]:
                    five[y] = five[y - 1]
                    y -= 1
                five[y] = lengths[a, b]
                have += 1
            if have >= 3:
                # An even number has two middles; the longer one tears less.
                middle = five[have // 2]
                out[k, j] = min(max(least * nominal[k, j], middle), most * nominal[k, j])
    return out


@njit(cache=True, nogil=True)
def _alike(points: Floats, a: int, b: int, c: int, d: int, j: int, cos_bend: float) -> bool:
    """Whether the edges from step a to b and from c to d of one line are alike."""
    uu, vv, uv = 0.0, 0.0, 0.0
    for i in range(3):
        u = points[b, j, i] - points[a, j, i]
        v = points[d, j, i] - points[c, j, i]
        uu, vv, uv = uu + u * u, vv + v * v, uv + u * v
    # NaN, where one is missing, is not alike.
    return uu <= 4.0 * vv and vv <= 4.0 * uu and uv >= cos_bend * np.sqrt(uu * vv)


@njit(cache=True, nogil=True)
def leaps(points: Floats, to_step: Floats, most: Floats, closed: bool, cos_bend: float) -> Bools:
    """(s, n) True for edges to the next step that are longer than ``most`` (s, n) mm and continue
    none: neither the edge before nor the one after is alike in length and direction."""
    s, n = to_step.shape
    out = np.zeros((s, n), dtype=np.bool_)
    for k in range(s):
        for j in range(n):
            if not to_step[k, j] > most[k, j]:
                continue
            b = (k + 1) % s
            goes_on = (k > 0 or closed) and _alike(points, k, b, (k - 1) % s, k, j, cos_bend)
            if not goes_on and (k + 2 < s or closed):
                goes_on = _alike(points, k, b, b, (k + 2) % s, j, cos_bend)
            out[k, j] = not goes_on
    return out


@njit(cache=True, nogil=True)
def lead_on(points: Floats, to_step: Floats, closed: bool, cos_bend: float) -> Bools:
    """(s, n) True for sides to the next step that are alike in length and direction with the side
    before or the side after."""
    s, n = to_step.shape
    out = np.zeros((s, n), dtype=np.bool_)
    for k in range(s):
        a, b, c = (k - 1) % s, (k + 1) % s, (k + 2) % s
        for j in range(n):
            if np.isnan(to_step[k, j]):
                continue
            if not np.isnan(to_step[a, j]):
                out[k, j] = _alike(points, k, b, a, k, j, cos_bend)
            if not out[k, j] and not np.isnan(to_step[b, j]):
                out[k, j] = _alike(points, k, b, b, c, j, cos_bend)
    return out


@njit(cache=True, nogil=True)
def triangulate(
    grid: Measured, given: Sides, closed: bool, limits: Limits, span: tuple[int, int]
) -> Ints:
    """Faces (f, 3) of flat grid indices, in the grid's own winding, from the steps of a span, from
    its first to before its last, to the next.

    Faces between two lines where sides to the next step are steady may be seen at any angle, if
    the profile itself does not run along the ray.
    """
    points, noise, sigma, side, eyes = grid
    to_step, to_line, usual_step, usual_line, steady = given
    s, n, _ = points.shape
    last = min(span[1], s if closed else s - 1)
    faces = np.empty((2 * max(last - span[0], 0) * max(n - 1, 0), 3), dtype=np.int32)
    made = 0
    ks, js = np.empty(4, dtype=np.int64), np.empty(4, dtype=np.int64)
    q, spread, ratio = np.empty((4, 3)), np.empty((4, 2)), np.empty(4)
    corners = np.array(((0, 1, 2), (0, 2, 3), (0, 1, 3), (1, 2, 3)))
    cuts = Cuts(corners, np.array(((0, 1), (2, 3), (0, 3), (1, 2))))
    quad = Quad(q, spread, ratio, ks)
    leaning = np.zeros(max(n - 1, 0), dtype=np.bool_)
    for k in range(span[0], last):
        k1 = (k + 1) % s
        _leaning(points, k, k1, leaning)
        for j in range(n - 1):
            ks[0], ks[1], ks[2], ks[3] = k, k, k1, k1
            js[0], js[1], js[2], js[3] = j, j + 1, j + 1, j
            have = 0
            for c in range(4):
                for i in range(3):
                    q[c, i] = points[ks[c], js[c], i]
                one = sigma[ks[c], js[c]]
                spread[c, 0] = noise[ks[c], js[c]]
                spread[c, 1] = one if one == one else 0.0
                have += not np.isnan(q[c, 0])
            if have < 3:
                continue
            across = np.hypot(usual_step[k, j], usual_line[k, j])
            first = _edge(points, side, ks[0], js[0], ks[2], js[2])
            second = _edge(points, side, ks[1], js[1], ks[3], js[3])
            ratio[0] = to_line[k, j] / usual_line[k, j]
            ratio[1] = to_step[k, j + 1] / usual_step[k, j + 1]
            ratio[2] = to_line[k1, j] / usual_line[k1, j]
            ratio[3] = to_step[k, j] / usual_step[k, j]
            excused = steady[k, j] and steady[k, j + 1] and _across(q, eyes[k])
            least = 0.0 if excused else limits.cos_grazing
            pick, whole = _cut_along(
                quad, eyes, (first, second), leaning[j], across, cuts,
                limits.stretch, limits.jump, least,
            )  # fmt: skip
            for t in range(pick, pick + 2):
                if whole >> t & 1:
                    a, b, c = corners[t, 0], corners[t, 1], corners[t, 2]
                    if side[ks[a], js[a]]:
                        b, c = c, b
                    faces[made, 0] = ks[a] * n + js[a]
                    faces[made, 1] = ks[b] * n + js[b]
                    faces[made, 2] = ks[c] * n + js[c]
                    made += 1
    return faces[:made].copy()


@njit(cache=True, nogil=True)
def _across(q: Floats, eye: Floats) -> bool:
    """Whether the profile's own side of a quad (4, 3) lies at 30° or more to the ray."""
    side, ray = q[1] - q[0], eye - q[0]
    deep = (side * ray).sum() ** 2
    # False for NaN, where a corner is missing or the eye's place is not known.
    return deep <= _DEEP * (side * side).sum() * (ray * ray).sum()  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def _leaning(points: Floats, k: int, next_step: int, out: Bools) -> None:
    """Write (n − 1,) True for quads to the next step whose second diagonal is the shorter one for
    more than noise, as lines climb there from step to step.

    Noise makes the deeper diagonal the shorter one, since the directions of two profiles' noise
    differ: with it as a rule all faces would lie too deep. So quads about each one decide, but for
    one that leans by a whole side, as at an edge.
    """
    n = len(out)
    more, size = np.zeros(n + 1), np.zeros(n + 1)
    for j in range(n):
        along, across, product = 0.0, 0.0, 0.0
        for i in range(3):
            a, b = points[k, j, i], points[k, j + 1, i]
            c, d = points[next_step, j + 1, i], points[next_step, j, i]
            one, other = (c - b + d - a) / 2.0, (b - a + c - d) / 2.0
            along, across, product = along + other**2, across + one**2, product + one * other
        known = product == product
        more[j + 1] = more[j] + (product if known else 0.0)
        size[j + 1] = size[j] + (min(along, across) if known else 0.0)
    for j in range(n):
        low, high = max(j - _ABOUT, 0), min(j + _ABOUT + 1, n)
        own = more[j + 1] - more[j]
        if abs(own) > size[j + 1] - size[j]:
            out[j] = own > 0.0
        else:
            out[j] = more[high] - more[low] > _LEANING * (size[high] - size[low])


@njit(cache=True, nogil=True)
def _cut_along(
    quad: Quad,
    eyes: Floats,
    diagonals: tuple[float, float],
    leaning: bool,
    across: float,
    cuts: Cuts,
    stretch: float,
    jump: float,
    cos_grazing: float,
) -> tuple[int, int]:
    """The first of the two triangles that a quad is cut into, and which of them are sound, as bits.

    Of its ``diagonals`` (mm, usually ``across``) it is cut along the first, or the second where it
    is ``leaning``; along the other one where that makes more faces.
    """
    q, spread, ratio, ks = quad
    first, second = diagonals
    corners, sides = cuts
    pick, most, whole = 0, -1, 0
    for turn in range(2):
        way = 2 * (leaning != (turn == 1))
        sound, count = 0, 0
        for t in range(way, way + 2):
            diagonal = (first if t < 2 else second) / across
            # A NaN, where a corner is missing or beyond the axis, is no face either.
            span = ratio[sides[t, 0]] + ratio[sides[t, 1]] + diagonal
            if span == span and _sound(
                q, spread, eyes, ks[corners[t, 0]], corners, t,
                max(ratio[sides[t, 0]], ratio[sides[t, 1]], diagonal) > stretch,
                jump, cos_grazing,
            ):  # fmt: skip
                sound |= 1 << t
                count += 1
        if count > most:
            pick, most, whole = way, count, sound
        if most == 2:
            break
    return pick, whole


@njit(cache=True, nogil=True)
def compact(faces: Ints, count: int) -> tuple[Ints, Ints]:
    """Those of ``count`` points that faces use, in order, and the faces (f, 3) in their numbers."""
    new = np.full(count, -1, dtype=np.int32)
    for f in range(len(faces)):
        for i in range(3):
            new[faces[f, i]] = 0
    used = np.empty(count, dtype=np.int32)
    have = 0
    for p in range(count):
        if new[p] == 0:
            new[p] = have
            used[have] = p
            have += 1
    out = np.empty((len(faces), 3), dtype=np.int32)
    for f in range(len(faces)):
        for i in range(3):
            out[f, i] = new[faces[f, i]]
    return used[:have].copy(), out


@njit(cache=True, nogil=True)
def _sound(
    q: Floats,
    spread: Floats,
    eyes: Floats,
    k: int,
    corners: Longs,
    t: int,
    stretched: bool,
    jump: float,
    cos_grazing: float,
) -> bool:
    """Whether three ``corners[t]`` of a quad (4, 3), seen from ``eyes[k]``, are one surface.

    The rules are those of docs/explain/surface.md, Faces.
    """
    a, b, c = corners[t, 0], corners[t, 1], corners[t, 2]
    u0, u1, u2 = q[b, 0] - q[a, 0], q[b, 1] - q[a, 1], q[b, 2] - q[a, 2]
    v0, v1, v2 = q[c, 0] - q[b, 0], q[c, 1] - q[b, 1], q[c, 2] - q[b, 2]
    w0, w1, w2 = q[a, 0] - q[c, 0], q[a, 1] - q[c, 1], q[a, 2] - q[c, 2]
    longest = max(
        u0 * u0 + u1 * u1 + u2 * u2, v0 * v0 + v1 * v1 + v2 * v2, w0 * w0 + w1 * w1 + w2 * w2
    )
    n0, n1, n2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    area = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    if not area > 1e-9 * longest:
        return False
    most = jump * np.sqrt(2.0) * max(spread[a, 0], spread[b, 0], spread[c, 0])
    if stretched and longest > most * most:
        return False
    if np.isnan(eyes[k, 0]):
        return True
    r0, r1, r2 = eyes[k, 0] - q[a, 0], eyes[k, 1] - q[a, 1], eyes[k, 2] - q[a, 2]
    length = np.sqrt(r0 * r0 + r1 * r1 + r2 * r2)
    if abs(n0 * r0 + n1 * r1 + n2 * r2) >= cos_grazing * area * length:
        return True
    depth = max(
        abs(u0 * r0 + u1 * r1 + u2 * r2),
        abs(v0 * r0 + v1 * r1 + v2 * r2),
        abs(w0 * r0 + w1 * r1 + w2 * r2),
    )
    most = jump * np.sqrt(2.0) * max(spread[a, 1], spread[b, 1], spread[c, 1])
    return depth <= most * length  # type: ignore[no-any-return]
