"""Compiled kernels of the grid's mesh; imported only when they are used."""
# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def _edge(points: Any, side: Any, k: int, j: int, m: int, i: int) -> float:
    if side[k, j] != side[m, i]:
        return np.nan
    d0 = points[k, j, 0] - points[m, i, 0]
    d1 = points[k, j, 1] - points[m, i, 1]
    d2 = points[k, j, 2] - points[m, i, 2]
    return np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def edges(points: Any, side: Any, closed: bool) -> tuple[Any, Any]:
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
def usual(lengths: Any, along_steps: bool, wraps: bool, floor: float, ceiling: float) -> Any:
    """Local spacing (s, n): the median of each edge and its two neighbours on either side.

    Between ``floor`` and ``ceiling``; ``floor`` itself where fewer than three of the five exist.
    """
    s, n = lengths.shape
    out = np.full((s, n), floor)
    five = np.empty(5)
    for k in range(s):
        for j in range(n):
            if np.isnan(lengths[k, j]):
                continue
            have = 0
            for o in range(-2, 3):
                a, b = (k + o, j) if along_steps else (k, j + o)
                if along_steps and wraps:
                    a %= s
                if 0 <= a < s and 0 <= b < n and not np.isnan(lengths[a, b]):
                    five[have] = lengths[a, b]
                    have += 1
            if have >= 3:
                # Insertion sort: five numbers at most.
                for x in range(1, have):
                    y = x
                    while y > 0 and five[y] < five[y - 1]:
                        five[y], five[y - 1] = five[y - 1], five[y]
                        y -= 1
                # An even number has two middles; the longer one tears less.
                out[k, j] = min(max(floor, five[have // 2]), ceiling)
    return out


@njit(cache=True, nogil=True)
def triangulate(
    points: Any,
    sigma: Any,
    side: Any,
    eyes: Any,
    to_step: Any,
    to_line: Any,
    usual_step: Any,
    usual_line: Any,
    closed: bool,
    stretch: float,
    jump: float,
    cos_grazing: float,
) -> tuple[Any, int]:
    """Faces (f, 3) of flat grid indices in the grid's own winding, and how many were torn away."""
    s, n, _ = points.shape
    quads = s if closed else s - 1
    faces = np.empty((2 * max(quads, 0) * max(n - 1, 0), 3), dtype=np.int32)
    made = 0
    torn = 0
    ks = np.empty(4, dtype=np.int64)
    js = np.empty(4, dtype=np.int64)
    whole = np.empty((2, 4), dtype=np.bool_)
    for k in range(quads):
        k1 = (k + 1) % s
        for j in range(n - 1):
            ks[0], ks[1], ks[2], ks[3] = k, k, k1, k1
            js[0], js[1], js[2], js[3] = j, j + 1, j + 1, j
            have = 0
            for c in range(4):
                if not np.isnan(points[ks[c], js[c], 0]):
                    have += 1
            if have < 3:
                continue
            across = np.hypot(usual_step[k, j], usual_line[k, j])
            first = _edge(points, side, ks[0], js[0], ks[2], js[2])
            second = _edge(points, side, ks[1], js[1], ks[3], js[3])
            # Sides of the quad in the order of its corners: 0-1, 1-2, 2-3, 3-0.
            ratio0 = to_line[k, j] / usual_line[k, j]
            ratio1 = to_step[k, j + 1] / usual_step[k, j + 1]
            ratio2 = to_line[k1, j] / usual_line[k1, j]
            ratio3 = to_step[k, j] / usual_step[k, j]
            # Triangles of diagonal 0-2: (0,1,2) (0,2,3); of diagonal 1-3: (0,1,3) (1,2,3).
            spans = (
                max(ratio0, ratio1, first / across),
                max(first / across, ratio2, ratio3),
                max(ratio0, second / across, ratio3),
                max(ratio1, ratio2, second / across),
            )
            corners = ((0, 1, 2), (0, 2, 3), (0, 1, 3), (1, 2, 3))
            for t in range(4):
                a, b, c = corners[t]
                whole[t // 2, t % 2] = _sound(
                    points, sigma, side, eyes, ks, js, a, b, c, spans[t], stretch, jump, cos_grazing
                )
            one = int(whole[0, 0]) + int(whole[0, 1])
            two = int(whole[1, 0]) + int(whole[1, 1])
            pick = 0
            if two > one or (two == one and second < first):
                pick = 1
            kept = 0
            for t in range(2):
                if whole[pick, t]:
                    tri = corners[2 * pick + t]
                    for c in range(3):
                        faces[made, c] = ks[tri[c]] * n + js[tri[c]]
                    if side[ks[tri[0]], js[tri[0]]]:
                        faces[made, 1], faces[made, 2] = faces[made, 2], faces[made, 1]
                    made += 1
                    kept += 1
            torn += (have - 2) - kept
    return faces[:made], torn


@njit(cache=True, nogil=True)
def _sound(
    points: Any,
    sigma: Any,
    side: Any,
    eyes: Any,
    ks: Any,
    js: Any,
    a: int,
    b: int,
    c: int,
    span: float,
    stretch: float,
    jump: float,
    cos_grazing: float,
) -> bool:
    """Whether three corners of a quad are one surface."""
    pa, pb, pc = points[ks[a], js[a]], points[ks[b], js[b]], points[ks[c], js[c]]
    if np.isnan(pa[0]) or np.isnan(pb[0]) or np.isnan(pc[0]):
        return False
    here = side[ks[a], js[a]]
    if side[ks[b], js[b]] != here or side[ks[c], js[c]] != here:
        return False
    u, v, w = pb - pa, pc - pb, pa - pc
    uu, vv, ww = (u * u).sum(), (v * v).sum(), (w * w).sum()
    longest = max(uu, vv, ww)
    n0 = u[1] * v[2] - u[2] * v[1]
    n1 = u[2] * v[0] - u[0] * v[2]
    n2 = u[0] * v[1] - u[1] * v[0]
    area = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    if not area > 1e-9 * longest:
        return False
    noise = 0.0
    for t in (a, b, c):
        one = sigma[ks[t], js[t]]
        if one == one:
            noise = max(noise, one)
    limit = jump * np.sqrt(2.0) * noise
    if span > stretch and longest > limit * limit:
        return False
    eye = eyes[ks[a]]
    if np.isnan(eye[0]):
        return True
    r = eye - pa
    length = np.sqrt((r * r).sum())
    cosine = abs(n0 * r[0] + n1 * r[1] + n2 * r[2]) / (area * length)
    depth = max(abs((u * r).sum()), abs((v * r).sum()), abs((w * r).sum())) / length
    return not (cosine < cos_grazing and depth > limit)
