# mypy: disable-error-code="no-any-return"
"""Where the laser sheet cuts the bodies, and which pixels see the cut: numba kernels.

This module imports numba; import it inside functions only. Frames as in `_rays`.
"""

from __future__ import annotations

import math

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.compiled import njit

FADED = 2.8
"""Radii of the sheet beyond which there is no light (1.5e-7 of its middle)."""

CLUSTER = 64
"""Triangles that are culled together."""


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def sheet_distance(x: float, y: float, z: float, sheet: Floats) -> float:
    """Signed distance from the sheet (n, c, e1, e2, bow as five rows of three)."""
    dx, dy, dz = x - sheet[1, 0], y - sheet[1, 1], z - sheet[1, 2]
    away = dx * sheet[0, 0] + dy * sheet[0, 1] + dz * sheet[0, 2]
    a = dx * sheet[2, 0] + dy * sheet[2, 1] + dz * sheet[2, 2]
    b = dx * sheet[3, 0] + dy * sheet[3, 1] + dz * sheet[3, 2]
    return away - (sheet[4, 0] * a * a + sheet[4, 1] * a * b + sheet[4, 2] * b * b)


@njit(cache=True, nogil=True)
def clusters(vertices: Floats, faces: Ints, order: Ints) -> Floats:
    """(n, 4) centre and radius of a ball round each `CLUSTER` triangles, taken in some order."""
    out = np.zeros(((len(order) + CLUSTER - 1) // CLUSTER, 4))
    for i in range(len(out)):
        a, b = i * CLUSTER, min((i + 1) * CLUSTER, len(order))
        for j in range(3):
            low, high = np.inf, -np.inf
            for f in order[a:b]:
                for k in range(3):
                    x = vertices[faces[f, k], j]
                    low, high = min(low, x), max(high, x)
            out[i, j] = 0.5 * (low + high)
        for f in order[a:b]:
            for k in range(3):
                d = 0.0
                for j in range(3):
                    d += (vertices[faces[f, k], j] - out[i, j]) ** 2
                out[i, 3] = max(out[i, 3], math.sqrt(d))
    return out


@njit(cache=True, nogil=True)
def sheet_polygons(
    vertices: Floats,
    faces: Ints,
    flat: Floats,
    order: Ints,
    balls: Floats,
    R: Floats,
    t: Floats,
    apex: Floats,
    sheet: Floats,
    beam: Floats,
) -> tuple[Floats, Ints]:
    """Parts of the triangles within reach of the sheet that face both laser and camera.

    ``order`` and ``balls``: see `clusters`; triangles of a ball away from the sheet are not
    looked at. ``beam`` holds waist, waist distance, Rayleigh length, reach in radii, the aim (3).
    Returns corner points (m, 3) in the camera frame and, per polygon, where it starts (p + 1,).
    """
    bow = 2.0 * (abs(sheet[4, 0]) + abs(sheet[4, 1]) + abs(sheet[4, 2]))
    points = np.empty((1024, 3))
    starts = np.zeros(1024, np.int32)
    m = p = 0
    poly, cut = np.empty((8, 4)), np.empty((8, 4))
    for i in range(len(order)):
        if i % CLUSTER == 0:
            near = _ball_near(balls, i // CLUSTER, R, t, apex, sheet, beam, bow)
        if not near:
            continue
        f = order[i]
        _move(vertices, faces, f, R, t, sheet, poly)
        low, high = min(poly[0, 3], poly[1, 3], poly[2, 3]), max(poly[0, 3], poly[1, 3], poly[2, 3])
        reach = reach_of(poly[0, 0], poly[0, 1], poly[0, 2], apex, beam)
        if low > reach or high < -reach or not _faces_both(poly, flat, f, R, apex):
            continue
        n = _clip(poly, 3, reach, 1.0, cut)
        n = _clip(cut, n, reach, -1.0, poly)
        if n < 3:
            continue
        if m + n > len(points):
            points = np.concatenate((points, np.empty_like(points)))
        if p + 2 > len(starts):
            starts = np.concatenate((starts, np.empty_like(starts)))
        _copy(poly, n, points, m)
        m += n
        p += 1
        starts[p] = m
    return points[:m], starts[: p + 1]


@njit(cache=True, nogil=True)
def _move(
    vertices: Floats, faces: Ints, f: int, R: Floats, t: Floats, sheet: Floats, poly: Floats
) -> None:
    """A triangle's corners in the camera frame, and their distance from the sheet, as rows."""
    for k in range(3):
        v = faces[f, k]
        for j in range(3):
            poly[k, j] = (
                R[j, 0] * vertices[v, 0] + R[j, 1] * vertices[v, 1] + R[j, 2] * vertices[v, 2]
            ) + t[j]
        poly[k, 3] = sheet_distance(poly[k, 0], poly[k, 1], poly[k, 2], sheet)


@njit(cache=True, nogil=True)
def _copy(poly: Floats, n: int, points: Floats, start: int) -> None:
    for k in range(n):
        for j in range(3):
            points[start + k, j] = poly[k, j]


@njit(cache=True, nogil=True)
def _ball_near(
    balls: Floats, i: int, R: Floats, t: Floats, apex: Floats, sheet: Floats, beam: Floats,
    bow: float,
) -> bool:  # fmt: skip
    """False where nothing in ball i (centre, radius) can lie within reach of the sheet."""
    x, y, z, radius = balls[i, 0], balls[i, 1], balls[i, 2], balls[i, 3]
    cx = R[0, 0] * x + R[0, 1] * y + R[0, 2] * z + t[0]
    cy = R[1, 0] * x + R[1, 1] * y + R[1, 2] * z + t[1]
    cz = R[2, 0] * x + R[2, 1] * y + R[2, 2] * z + t[2]
    along = _along(cx, cy, cz, apex, beam)
    # The sheet is nowhere thicker between, and the distance from a bowed sheet changes at most
    # by this much per mm.
    widest = max(_reach_at(along - radius, beam), _reach_at(along + radius, beam))
    off = abs(cx - sheet[1, 0]) + abs(cy - sheet[1, 1]) + abs(cz - sheet[1, 2]) + radius
    return abs(sheet_distance(cx, cy, cz, sheet)) <= widest + (1.0 + bow * off) * radius


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def _along(x: float, y: float, z: float, apex: Floats, beam: Floats) -> float:
    """Distance from the apex along the aim."""
    return (x - apex[0]) * beam[4] + (y - apex[1]) * beam[5] + (z - apex[2]) * beam[6]


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def _reach_at(z: float, beam: Floats) -> float:
    far = (z - beam[1]) / beam[2]
    return beam[3] * beam[0] * math.sqrt(1.0 + far * far)


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def reach_of(x: float, y: float, z: float, apex: Floats, beam: Floats) -> float:
    return _reach_at(_along(x, y, z, apex, beam), beam)


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def _faces_both(poly: Floats, flat: Floats, f: int, R: Floats, apex: Floats) -> bool:
    to_eye = to_laser = 0.0
    for i in range(3):
        across = R[i, 0] * flat[f, 0] + R[i, 1] * flat[f, 1] + R[i, 2] * flat[f, 2]
        to_eye -= across * poly[0, i]
        to_laser += across * (apex[i] - poly[0, i])
    return to_eye > 0.0 and to_laser > 0.0


@njit(cache=True, nogil=True)
def _clip(poly: Floats, n: int, reach: float, side: float, out: Floats) -> int:
    """Keep the part of a polygon where side · distance ≤ reach (Sutherland-Hodgman)."""
    m = 0
    for i in range(n):
        j = (i + 1) % n
        di, dj = side * poly[i, 3] - reach, side * poly[j, 3] - reach
        if di <= 0.0:
            for k in range(4):
                out[m, k] = poly[i, k]
            m += 1
        if (di < 0.0 < dj) or (dj < 0.0 < di):
            for k in range(4):
                out[m, k] = poly[i, k] + (poly[j, k] - poly[i, k]) * (di / (di - dj))
            m += 1
    return m


@njit(cache=True, nogil=True)
def fill(pixels: Floats, starts: Ints, pad: float, mask: Bools) -> None:
    """Mark the pixels of convex polygons, grown by ``pad``, in the mask (H, W)."""
    H, W = mask.shape
    for p in range(len(starts) - 1):
        a, b = starts[p], starts[p + 1]
        low, high = np.inf, -np.inf
        for i in range(a, b):
            low, high = min(low, pixels[i, 1]), max(high, pixels[i, 1])
        if not (high >= low):
            continue
        for row in range(max(0, math.ceil(low - pad)), min(H - 1, math.floor(high + pad)) + 1):
            left, right = _span(pixels, a, b, row - pad, row + pad)
            c0, c1 = max(0.0, left - pad), min(W - 1.0, right + pad)
            for c in range(math.ceil(c0), math.floor(c1) + 1):
                mask[row, c] = True


@njit(cache=True, nogil=True)
def _span(pixels: Floats, a: int, b: int, top: float, bottom: float) -> tuple[float, float]:
    left, right = np.inf, -np.inf
    for i in range(a, b):
        j = i + 1 if i + 1 < b else a
        u0, v0, u1, v1 = pixels[i, 0], pixels[i, 1], pixels[j, 0], pixels[j, 1]
        for limit in (top, bottom):
            if (v0 - limit) * (v1 - limit) < 0.0:
                u = u0 + (u1 - u0) * (limit - v0) / (v1 - v0)
                left, right = min(left, u), max(right, u)
        if top <= v0 <= bottom:
            left, right = min(left, u0), max(right, u0)
    return left, right
