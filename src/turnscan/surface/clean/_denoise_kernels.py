"""Compiled kernels of denoising; imported only when they are used."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.compiled import njit

_SAG = 4.0
"""Noise by which a surface may bend over one reach without being held straight."""
_FLAT = 2.0
"""Mean square residual, in noises, up to which a window is flat."""
_TERMS = 6
_ROUNDS = 3
"""Times that the weights follow the fit."""
_HALVES = 8
"""Half windows: the four sides and the four corners."""
_LINES = 6
"""Lines to each side in which a profile is a parabola."""
_OF_NORMAL = 1.4826
"""Standard deviation of a normal distribution over the median size of its values."""


class Measured(NamedTuple):
    """A grid as denoising sees it."""

    points: Floats
    """(s, n, 3) mm."""
    side: Bools
    """(s, n) True beyond the rotation axis."""
    eyes: Floats
    """(s, 3) mm: where the camera was."""
    noise: Floats
    """(s, n) mm."""


@njit(cache=True, nogil=True)
def _around(
    points: Floats, side: Bools, noise: Floats, closed: bool, k: int, j: int, ray: Floats,
    most: int, reach: float, out: Floats,
) -> int:  # fmt: skip
    """Write the points about one in the grid: x, y across its ray and h along it (towards the
    camera), weight by distance in the grid, noise, steps and lines away. Gives how many.

    x and y are in units of their rms, so that the fit's prior means the same everywhere.
    """
    s, n, _ = points.shape
    # Two directions across the ray: the first as level as can be.
    size = np.hypot(ray[0], ray[1])
    e0, e1 = (-ray[1] / size, ray[0] / size) if size > 1e-6 else (1.0, 0.0)
    f0, f1, f2 = -ray[2] * e1, ray[2] * e0, ray[0] * e1 - ray[1] * e0
    have = 0
    square, total = 0.0, 0.0
    for dk in range(-most, most + 1):
        a = k + dk
        if closed:
            a %= s
        if a < 0 or a >= s:
            continue
        for dj in range(-most, most + 1):
            b = j + dj
            if b < 0 or b >= n or np.isnan(points[a, b, 0]) or side[a, b] != side[k, j]:
                continue
            d0 = points[a, b, 0] - points[k, j, 0]
            d1 = points[a, b, 1] - points[k, j, 1]
            d2 = points[a, b, 2] - points[k, j, 2]
            out[have, 0] = d0 * e0 + d1 * e1
            out[have, 1] = d0 * f0 + d1 * f1 + d2 * f2
            out[have, 2] = d0 * ray[0] + d1 * ray[1] + d2 * ray[2]
            w = np.exp(-(dk * dk + dj * dj) / (2.0 * reach * reach))
            out[have, 3], out[have, 4] = w, max(noise[a, b], 1e-9)
            out[have, 5], out[have, 6] = dk, dj
            square += w * (out[have, 0] ** 2 + out[have, 1] ** 2)
            total += 2.0 * w
            have += 1
    unit = np.sqrt(square / total) if square > 0.0 else 1.0
    for i in range(have):
        out[i, 0] /= unit
        out[i, 1] /= unit
    return have


@njit(cache=True, nogil=True)
def _solve(A: Floats, b: Floats, terms: int) -> bool:
    """Solve A x = b in place (Cholesky; x stands in b); False where A is not positive."""
    for i in range(terms):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= A[i, k] * A[j, k]
            if i == j:
                if not total > 1e-12:
                    return False
                A[i, i] = np.sqrt(total)
            else:
                A[i, j] = total / A[j, j]
    for i in range(terms):
        for k in range(i):
            b[i] -= A[i, k] * b[k]
        b[i] /= A[i, i]
    for i in range(terms - 1, -1, -1):
        for k in range(i + 1, terms):
            b[i] -= A[k, i] * b[k]
        b[i] /= A[i, i]
    return True


@njit(cache=True, nogil=True)
def _fit(
    near: Floats, have: int, weight: Floats, terms: int, bend: float, A: Floats, x: Floats
) -> bool:
    """Weighted fit of h by 1, x, y (and x², xy, y² where ``terms`` is 6, these near 0 ± bend)."""
    row = np.empty(_TERMS)
    for i in range(terms):
        x[i] = 0.0
        for j in range(terms):
            A[i, j] = 0.0
    for p in range(have):
        w = weight[p]
        if w <= 0.0:
            continue
        u, v = near[p, 0], near[p, 1]
        row[0], row[1], row[2], row[3], row[4], row[5] = 1.0, u, v, u * u, u * v, v * v
        for i in range(terms):
            x[i] += w * row[i] * near[p, 2]
            for j in range(i + 1):
                A[i, j] += w * row[i] * row[j]
    for i in range(3, terms):
        A[i, i] += 1.0 / (bend * bend)
    return _solve(A, x, terms)


@njit(cache=True, nogil=True)
def _height(x: Floats, terms: int, u: float, v: float) -> float:
    h = x[0] + x[1] * u + x[2] * v
    if terms > 3:
        h += x[3] * u * u + x[4] * u * v + x[5] * v * v
    return h  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def _in_half(half: int, dk: float, dj: float) -> bool:
    """Whether a neighbour is in one of the eight half windows, which all hold the middle."""
    if half < 4:
        a = dk if half < 2 else dj
        return a <= 0.0 if half % 2 else a >= 0.0
    a = dk if half < 6 else -dk
    b = dj if half % 2 else -dj
    return a + b >= 0.0


@njit(cache=True, nogil=True)
def _spread(near: Floats, have: int, weight: Floats, x: Floats, terms: int) -> float:
    """Weighted mean square of the residuals in their noise."""
    total, sum_w = 0.0, 0.0
    for p in range(have):
        r = (near[p, 2] - _height(x, terms, near[p, 0], near[p, 1])) / near[p, 4]
        total += weight[p] * r * r
        sum_w += weight[p]
    return total / sum_w if sum_w > 0.0 else np.inf


@njit(cache=True, nogil=True)
def _begin(
    near: Floats, have: int, base: Floats, weight: Floats, A: Floats, x: Floats, best: Floats
) -> bool:
    """Write the plane to begin with: through the whole window, or its flattest half.

    The whole is taken where it is as flat as the noise says; where it is not there is an edge or
    a bend, and a half window lies on one side of an edge.
    """
    least = np.inf
    if _fit(near, have, base, 3, 1.0, A, x):
        least = _spread(near, have, base, x, 3)
        best[:3] = x[:3]
    if least > _FLAT:
        for half in range(_HALVES):
            for p in range(have):
                weight[p] = base[p] if _in_half(half, near[p, 5], near[p, 6]) else 0.0
            if _fit(near, have, weight, 3, 1.0, A, x):
                spread = _spread(near, have, weight, x, 3)
                if spread < least:
                    least = spread
                    best[:3] = x[:3]
    x[:3] = best[:3]
    return least < np.inf


@njit(cache=True, nogil=True)
def _settle(
    near: Floats,
    have: int,
    base: Floats,
    weight: Floats,
    own: float,
    scale: float,
    A: Floats,
    x: Floats,
) -> bool:
    """Fit again and again with the weights that the residuals of the last fit say (Welsch's)."""
    terms = 3
    for _ in range(_ROUNDS):
        for p in range(have):
            r = near[p, 2] - _height(x, terms, near[p, 0], near[p, 1])
            r /= scale * np.hypot(near[p, 4], own)
            weight[p] = base[p] * np.exp(-r * r)
        terms = _TERMS
        if not _fit(near, have, weight, terms, _SAG * own, A, x):
            return False
    return True


@njit(cache=True, nogil=True)
def offsets(
    grid: Measured, closed: bool, reach: float, scale: float, alone: bool,
    steps: tuple[int, int], out: Floats, rest: Floats,
) -> None:  # fmt: skip
    """For each point how far along its ray, towards the camera, the surface about it lies, mm.

    The surface is a plane or a gentle bend, fitted to the points within two ``reach`` (steps and
    lines) with weights that fall with their distance in the grid and with their residual in
    ``scale`` noises. ``alone`` leaves the point itself out. Of the profiles from the first of
    ``steps`` to before the second it writes that to ``out`` (s, n), and to ``rest`` the rms
    residual about the point, in noises; neither where there are too few neighbours.
    """
    points, side, eyes, noise = grid
    _, n, _ = points.shape
    most = int(np.ceil(2.0 * reach))
    room = (2 * most + 1) ** 2
    near, base, weight = np.empty((room, 7)), np.empty(room), np.empty(room)
    A, x, best = np.empty((_TERMS, _TERMS)), np.empty(_TERMS), np.empty(_TERMS)
    ray = np.empty(3)
    for k in range(steps[0], steps[1]):
        for j in range(n):
            if np.isnan(points[k, j, 0]):
                continue
            for i in range(3):
                ray[i] = eyes[k, i] - points[k, j, i]
            length = np.sqrt(ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2])
            for i in range(3):
                ray[i] /= length
            have = _around(points, side, noise, closed, k, j, ray, most, reach, near)
            if have < 2 * _TERMS:
                continue
            own = max(noise[k, j], 1e-9)
            for p in range(have):
                base[p] = near[p, 3] / near[p, 4] ** 2
                if alone and near[p, 5] == 0.0 and near[p, 6] == 0.0:
                    base[p] = 0.0
            if _begin(near, have, base, weight, A, x, best) and _settle(
                near, have, base, weight, own, scale, A, x
            ):
                out[k, j] = x[0]
                rest[k, j] = np.sqrt(_spread(near, have, weight, x, _TERMS))


@njit(cache=True, nogil=True)
def off_profile(grid: Measured, asked: Bools, out: Floats) -> None:
    """For each point ``asked`` (s, n) how far along its ray the curve of its own profile lies, in
    what its neighbours scatter about that.

    The curve is a parabola through the lines about the point, without it; residuals beyond two
    usual ones count for less. Lines lie close, however far apart the steps are. Written to ``out``
    (s, n) where there are neighbours enough.
    """
    points, side, eyes, noise = grid
    _, n, _ = points.shape
    near, size = np.zeros((2 * _LINES, 7)), np.empty(2 * _LINES)
    base, weight = np.empty(2 * _LINES), np.empty(2 * _LINES)
    A, x = np.empty((3, 3)), np.empty(3)
    for k in range(len(eyes)):
        for j in range(n):
            if not asked[k, j]:
                continue
            ray = eyes[k] - points[k, j]
            ray /= np.sqrt((ray**2).sum())
            have = 0
            for b in range(max(j - _LINES, 0), min(j + _LINES + 1, n)):
                if b == j or np.isnan(points[k, b, 0]) or side[k, b] != side[k, j]:
                    continue
                t = (b - j) / _LINES
                near[have, 0], near[have, 1] = t, t * t
                near[have, 2] = ((points[k, b] - points[k, j]) * ray).sum()
                near[have, 4] = max(noise[k, b], 1e-9)
                weight[have] = base[have] = 1.0 / near[have, 4] ** 2
                have += 1
            scatter = np.inf
            for _ in range(_ROUNDS if have >= _LINES else 0):
                if not _fit(near, have, weight, 3, 1.0, A, x):
                    scatter = np.inf
                    break
                for p in range(have):
                    off = near[p, 2] - _height(x, 3, near[p, 0], near[p, 1])
                    size[p] = abs(off) / near[p, 4]
                scatter = max(_OF_NORMAL * np.median(size[:have]), 1.0)
                for p in range(have):
                    weight[p] = base[p] * np.exp(-((size[p] / (2.0 * scatter)) ** 2))
            if scatter < np.inf:
                out[k, j] = x[0] / (scatter * max(noise[k, j], 1e-9))
