"""Compiled kernels of the clean-up; imported only when they are used."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats, Longs
from turnscan.compiled import njit

Vector = tuple[float, float, float]
_STRAYS, _ASTRAY, _FAR, _CLAIMS = 2, 3.0, 10.0, 3.0
"""Points of a run that may be strays, times that each lies farther off its line than the rest
scatter, by which three alike are no strays, and times what is usual and what it claims by itself
that it lies off at least."""


class Limits(NamedTuple):
    """What neighbours on one surface may be."""

    stretch: float
    """Distance in usual spacings."""
    jump: float
    """Distance in sigma."""
    cos_ray: float
    """Of the angle between their connection and the ray: above it one is behind the other."""
    cos_bend: float
    """Of the angle between sides that go on alike."""


@njit(cache=True, nogil=True)
def _gap(
    points: Floats, side: Bools, k: int, j: int, m: int, i: int, closed: bool
) -> tuple[bool, Vector]:
    """Whether the points (k, j) and (m, i) are both there, on one side of the axis; the way from
    the first to the second."""
    s, n, _ = points.shape
    if j < 0 or j >= n or i < 0 or i >= n:
        return False, (0.0, 0.0, 0.0)
    if (k < 0 or k >= s or m < 0 or m >= s) and not closed:
        return False, (0.0, 0.0, 0.0)
    k, m = k % s, m % s
    gap = (
        points[m, i, 0] - points[k, j, 0],
        points[m, i, 1] - points[k, j, 1],
        points[m, i, 2] - points[k, j, 2],
    )
    return side[k, j] == side[m, i] and gap[0] == gap[0], gap


@njit(cache=True, nogil=True)
def _dot(u: Vector, v: Vector) -> float:
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@njit(cache=True, nogil=True)
def _alike(u: Vector, v: Vector, cos_bend: float, ratio: float) -> bool:
    uu, vv = _dot(u, u), _dot(v, v)
    if not (uu <= ratio * ratio * vv and vv <= ratio * ratio * uu):
        return False
    return _dot(u, v) >= cos_bend * np.sqrt(uu * vv)  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def _goes_on(
    points: Floats,
    side: Bools,
    here: Vector,
    k: int,
    j: int,
    along_steps: bool,
    wraps: bool,
    cos_bend: float,
) -> bool:
    """Whether the side before or the side after is alike."""
    dk, dj = (1, 0) if along_steps else (0, 1)
    there, other = _gap(points, side, k - dk, j - dj, k, j, wraps)
    if there and _alike(here, other, cos_bend, 2.0):
        return True
    there, other = _gap(points, side, k + dk, j + dj, k + 2 * dk, j + 2 * dj, wraps)
    return there and _alike(here, other, cos_bend, 2.0)


@njit(cache=True, nogil=True)
def _beside_alike(
    points: Floats, side: Bools, here: Vector, k: int, j: int, wraps: bool, cos_bend: float
) -> bool:
    """Whether the lines above and below go to the next profile alike."""
    for o in (-1, 1):
        there, other = _gap(points, side, k, j + o, k + 1, j + o, wraps)
        if not (there and _alike(here, other, cos_bend, 2.0)):
            return False
    return True


@njit(cache=True, nogil=True)
def links(
    points: Floats,
    side: Bools,
    eyes: Floats,
    sigma: Floats,
    usual: Floats,
    along_steps: bool,
    closed: bool,
    limits: Limits,
) -> Bools:
    """(s, n) True where a point and the next one (step or line) are neighbours on one surface.

    They are where they lie no further apart than ``stretch`` usual spacings (s, n) or ``jump``
    sigma; further apart only where the side before or after goes on alike, or between profiles
    (up to three times as far) where the lines above and below do the same, and the two are not
    one behind the other along the camera's ray.
    """
    stretch, jump, cos_ray, cos_bend = limits
    s, n, _ = points.shape
    out = np.zeros((s, n), dtype=np.bool_)
    dk, dj = (1, 0) if along_steps else (0, 1)
    wraps = closed and along_steps
    for k in range(s):
        for j in range(n):
            there, here = _gap(points, side, k, j, k + dk, j + dj, wraps)
            if not there:
                continue
            length = np.sqrt(_dot(here, here))
            k1 = (k + dk) % s
            noise = jump * np.hypot(sigma[k, j], sigma[k1, j + dj])
            if length <= noise:
                out[k, j] = True
                continue
            if eyes[k, 0] == eyes[k, 0]:
                ray = (
                    points[k, j, 0] - eyes[k, 0],
                    points[k, j, 1] - eyes[k, 1],
                    points[k, j, 2] - eyes[k, 2],
                )
                depth = abs(_dot(ray, here)) / np.sqrt(_dot(ray, ray))
                if depth > cos_ray * length and depth > noise:
                    continue
            if length <= stretch * usual[k, j]:
                out[k, j] = True
                continue
            out[k, j] = _goes_on(points, side, here, k, j, along_steps, wraps, cos_bend) or (
                along_steps
                and length <= 3.0 * stretch * usual[k, j]
                and _beside_alike(points, side, here, k, j, wraps, cos_bend)
            )
    return out


@njit(cache=True, nogil=True)
def fading(
    points: Floats,
    sigma: Floats,
    light: Floats,
    beside: Floats,
    most: int,
    inner: int,
    share: float,
    apart: float,
) -> Bools:
    """(s, n) True for points at the ends of runs of lines where the light fades and bends away.

    Of the last ``most`` points of a run those count that are fainter than ``share`` of the median
    of the ``inner`` points before, and of the light ``beside`` (s, n) in the next profiles, and lie
    off the straight line through these points by more than ``apart`` of their median sigma; so do
    all points beyond one that counts.
    """
    s, n, _ = points.shape
    out = np.zeros((s, n), dtype=np.bool_)
    own = np.empty((inner, 3))
    for k in range(s):
        for j in range(n):
            for d in (-1, 1):
                last = j - d * (most + inner - 1)
                ends = j + d < 0 or j + d >= n or np.isnan(points[k, j + d, 0])
                if np.isnan(points[k, j, 0]) or not ends or last < 0 or last >= n:
                    continue
                first = j - d * most
                middle, slope, usual, noise = _run(points, sigma, light, k, first, d, own)
                for i in range(most - 1, -1, -1):
                    here = j - d * i
                    off = points[k, here] - middle
                    off -= (off * slope).sum() * slope
                    due = share * min(usual, beside[k, here])
                    if light[k, here] < due and np.sqrt((off * off).sum()) > noise * apart:
                        for beyond in range(here, j + d, d):
                            out[k, beyond] = not np.isnan(points[k, beyond, 0])
                        break
    return out


@njit(cache=True, nogil=True)
def _run(
    points: Floats, sigma: Floats, light: Floats, k: int, first: int, d: int, own: Floats
) -> tuple[Floats, Floats, float, float]:
    """Middle (3,) and direction (3,) of the line through the points before the end of a run, their
    median light and sigma; a light of 0 where half of them are missing."""
    inner = len(own)
    lights, sigmas, at = np.empty(inner), np.empty(inner), np.empty(inner)
    have = 0
    for i in range(inner):
        line = first - d * i
        if not np.isnan(points[k, line, 0]):
            at[have] = i
            for axis in range(3):
                own[have, axis] = points[k, line, axis]
            lights[have], sigmas[have] = light[k, line], sigma[k, line]
            have += 1
    middle, slope = np.zeros(3), np.zeros(3)
    if 2 * have <= inner:
        return middle, slope, 0.0, 0.0
    for i in range(have):
        middle += own[i] / have
    mean = at[:have].mean()
    for i in range(have):
        slope += (at[i] - mean) * own[i]
    slope /= max(np.sqrt((slope * slope).sum()), 1e-12)
    return middle, slope, np.median(lights[:have]), np.median(sigmas[:have])


@njit(cache=True, nogil=True)
def off_runs(
    points: Floats,
    sigma: Floats,
    claims: Floats,
    inner: int,
    skipped: int,
    rows: Longs,
    off: Floats,
    ratio: Floats,
) -> None:
    """For some profiles ``rows`` (r,): ``off`` (s, n, 3) mm by which each point lies beside the
    line of its run, and ``ratio`` (s, n), that distance over what is usual: its ``sigma`` (s, n),
    or what the run itself scatters if that is more, times what a line through so few points leaves
    unknown there; 0 where too few tell.

    The line goes through up to ``inner`` points before it and after it; at the ends of a run,
    through those on the one side, without the ``skipped`` next to it; of either, without the few
    that are strays themselves, by what they say of themselves, too: ``claims`` (s, n) mm.
    """
    own, at = np.empty((2 * inner, 3)), np.empty(2 * inner)
    for k in rows:
        for j in range(points.shape[1]):
            off[k, j, 0], off[k, j, 1], off[k, j, 2], ratio[k, j] = 0.0, 0.0, 0.0, 0.0
            if np.isnan(points[k, j, 0]):
                continue
            before = _gathered(points[k], j, -1, 0, inner, own, at, 0)
            have = _gathered(points[k], j, 1, 0, inner, own, at, before)
            if before < 2 or have - before < 2:
                way = -1 if 2 * before >= have else 1
                have = _gathered(points[k], j, way, skipped, inner, own, at, 0)
            if have < inner - 1:
                continue
            side, scatter, known = _beside_line(points[k, j], own[:have], at[:have])
            if scatter * np.sqrt(have) > _FAR * sigma[k, j]:  # less where there is no stray
                have = _without_strays(own, at, have, inner - 1, sigma[k, j], claims[k], j)
                side, scatter, known = _beside_line(points[k, j], own[:have], at[:have])
            off[k, j, 0], off[k, j, 1], off[k, j, 2] = side
            known *= max(sigma[k, j], scatter)
            ratio[k, j] = np.sqrt(_dot(side, side)) / known if known > 0.0 else 0.0


@njit(cache=True, nogil=True)
def _gathered(
    line: Floats, j: int, way: int, skipped: int, most: int, own: Floats, at: Floats, have: int
) -> int:
    """Write up to ``most`` points of a run on one side of j and their places; gives how many."""
    end = have + most
    for i in range(1, most + skipped + 1):
        place = j + way * i
        if place < 0 or place >= len(line) or np.isnan(line[place, 0]) or have == end:
            break
        if i > skipped:
            own[have, 0], own[have, 1], own[have, 2] = (
                line[place, 0],
                line[place, 1],
                line[place, 2],
            )
            at[have] = way * i
            have += 1
    return have


@njit(cache=True, nogil=True)
def _without_strays(
    own: Floats, at: Floats, have: int, least: int, sigma: float, claims: Floats, j: int
) -> int:
    """Take up to two of the points (m, 3) at places (m,) from j away, the farthest off their line
    first, while it lies much farther off than the rest scatter, than ``sigma``, mm, says and than
    it ``claims`` (n,) itself, and ``least`` are left; gives how many are left. Two strays in a run
    would hide each other."""
    for _ in range(_STRAYS):
        if have <= least:
            break
        middle, slope, _, _ = _line(own[:have], at[:have])
        worst, most, total = 0, 0.0, 0.0
        for i in range(have):
            side = _aside((own[i, 0], own[i, 1], own[i, 2]), middle, slope)
            far = _dot(side, side)
            total += far
            if far > most:
                worst, most = i, far
        usual = _ASTRAY * _ASTRAY * (total - most) / (have - 1)
        known = max(_FAR * sigma, _CLAIMS * claims[j + int(at[worst])])
        if not most > max(usual, known * known):
            break
        have -= 1
        for i in range(worst, have):
            at[i] = at[i + 1]
            for k in range(3):
                own[i, k] = own[i + 1, k]
    return have


@njit(cache=True, nogil=True)
def _line(own: Floats, at: Floats) -> tuple[Vector, Vector, float, float]:
    """The line through points (m, 3) at places (m,): middle, unit slope, the mean place, and the
    sum of squares of the places about it."""
    count, mean = len(at), at.mean()
    m0, m1, m2, t0, t1, t2, spread = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(count):
        m0, m1, m2 = m0 + own[i, 0] / count, m1 + own[i, 1] / count, m2 + own[i, 2] / count
        far = at[i] - mean
        t0, t1, t2 = t0 + far * own[i, 0], t1 + far * own[i, 1], t2 + far * own[i, 2]
        spread += far * far
    size = max(np.sqrt(t0 * t0 + t1 * t1 + t2 * t2), 1e-12)
    return (m0, m1, m2), (t0 / size, t1 / size, t2 / size), mean, spread


@njit(cache=True, nogil=True)
def _beside_line(point: Floats, own: Floats, at: Floats) -> tuple[Vector, float, float]:
    """(3,) from the line through points (m, 3) at places (m,) to one more at 0, across it; mm rms
    by which they scatter about it; and by how much noise counts there, the line's own included."""
    count = len(at)
    middle, slope, mean, spread = _line(own, at)
    scatter = 0.0
    for i in range(count):
        side = _aside((own[i, 0], own[i, 1], own[i, 2]), middle, slope)
        scatter += _dot(side, side)
    off = _aside((point[0], point[1], point[2]), middle, slope)
    known = np.sqrt(1.0 + 1.0 / count + mean * mean / spread)
    return off, np.sqrt(scatter / max(count - 2, 1)), known


@njit(cache=True, nogil=True)
def _aside(point: Vector, middle: Vector, slope: Vector) -> Vector:
    """From a line to a point, across it."""
    x, y, z = point[0] - middle[0], point[1] - middle[1], point[2] - middle[2]
    along = _dot((x, y, z), slope)
    return x - along * slope[0], y - along * slope[1], z - along * slope[2]


@njit(cache=True, nogil=True)
def _neighbours(
    keep: Bools, to_step: Bools, to_line: Bools, closed: bool, k: int, j: int, ks: Longs, js: Longs
) -> int:
    """Write the kept neighbours (8 at most) of a point that links lead to; returns how many.

    A diagonal neighbour counts where links lead round the corner to it.
    """
    s, n = keep.shape
    have = 0
    up = k + 1 if k + 1 < s else (0 if closed else -1)
    down = k - 1 if k > 0 else (s - 1 if closed else -1)
    for o in range(8):
        dk = -1 if o in (0, 3, 5) else (1 if o in (2, 4, 7) else 0)
        dj = -1 if o < 3 else (1 if o > 4 else 0)
        a, b = (k if dk == 0 else (up if dk > 0 else down)), j + dj
        if a < 0 or b < 0 or b >= n or not keep[a, b]:
            continue
        low_k, low_j = (k if dk > 0 else a), min(j, b)
        if dk == 0:
            linked = to_line[k, low_j]
        elif dj == 0:
            linked = to_step[low_k, j]
        else:
            linked = (keep[a, j] and to_step[low_k, j] and to_line[a, low_j]) or (
                keep[k, b] and to_line[k, low_j] and to_step[low_k, b]
            )
        if linked:
            ks[have], js[have] = a, b
            have += 1
    return have


@njit(cache=True, nogil=True)
def core(keep: Bools, to_step: Bools, to_line: Bools, closed: bool, least: int) -> Bools:
    """The points (s, n) that stay when those with fewer than ``least`` neighbours are removed,
    again and again until none is left to take. The order does not matter.
    """
    s, n = keep.shape
    left = keep.copy()
    ks, js = np.empty(8, dtype=np.int64), np.empty(8, dtype=np.int64)
    stack = np.empty((9 * s * n + 1, 2), dtype=np.int32)
    top = 0
    for k in range(s):
        for j in range(n):
            if left[k, j]:
                stack[top, 0], stack[top, 1] = k, j
                top += 1
    while top > 0:
        top -= 1
        k, j = stack[top]
        if not left[k, j]:
            continue
        have = _neighbours(left, to_step, to_line, closed, k, j, ks, js)
        if have >= least:
            continue
        left[k, j] = False
        for i in range(have):
            stack[top, 0], stack[top, 1] = ks[i], js[i]
            top += 1
    return left


@njit(cache=True, nogil=True)
def piece_sizes(keep: Bools, to_step: Bools, to_line: Bools, closed: bool) -> Longs:
    """(s, n): for every kept point, how many kept points links lead to from it, itself included."""
    s, n = keep.shape
    size = np.zeros((s, n), dtype=np.int64)
    ks, js = np.empty(8, dtype=np.int64), np.empty(8, dtype=np.int64)
    queue = np.empty((s * n, 2), dtype=np.int32)
    for k in range(s):
        for j in range(n):
            if not keep[k, j] or size[k, j] != 0:
                continue
            queue[0, 0], queue[0, 1] = k, j
            size[k, j] = -1
            begin, end = 0, 1
            while begin < end:
                a, b = queue[begin]
                begin += 1
                have = _neighbours(keep, to_step, to_line, closed, a, b, ks, js)
                for i in range(have):
                    if size[ks[i], js[i]] == 0:
                        size[ks[i], js[i]] = -1
                        queue[end, 0], queue[end, 1] = ks[i], js[i]
                        end += 1
            for i in range(end):
                size[queue[i, 0], queue[i, 1]] = end
    return size
