# mypy: disable-error-code="no-any-return"
"""Where the laser sheet cuts the bodies, and which pixels see the cut: numba kernels.

This module imports numba; import it inside functions only. Frames as in `_rays`.
"""

from __future__ import annotations

import math

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.compiled import njit
from turnscan.simulate._airy import Numbers

FADED = 2.8
"""Radii of the sheet beyond which there is no light (1.5e-7 of its middle)."""

CLUSTER = 16
"""Triangles that are culled together, and clusters that are."""


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def sheet_distance(x: float, y: float, z: float, sheet: Numbers) -> float:
    """Signed distance from the sheet: its normal, centre, axes e1 and e2, and bow, three each."""
    dx, dy, dz = x - sheet[3], y - sheet[4], z - sheet[5]
    away = dx * sheet[0] + dy * sheet[1] + dz * sheet[2]
    a = dx * sheet[6] + dy * sheet[7] + dz * sheet[8]
    b = dx * sheet[9] + dy * sheet[10] + dz * sheet[11]
    return away - (sheet[12] * a * a + sheet[13] * a * b + sheet[14] * b * b)


@njit(cache=True, nogil=True, error_model="numpy")
def clusters(corners: Floats, normals: Floats) -> Floats:
    """(n, 12) of each `CLUSTER` triangles (f, 3, 3) with their normals (f, 3): the lowest and the
    highest corner of the box round them, and of the box round their normals."""
    out = np.empty(((len(corners) + CLUSTER - 1) // CLUSTER, 12))
    out[:, 0:3] = out[:, 6:9] = np.inf
    out[:, 3:6] = out[:, 9:12] = -np.inf
    for f in range(len(corners)):
        box = out[f // CLUSTER]
        for j in range(3):
            for k in range(3):
                x = corners[f, k, j]
                box[j], box[3 + j] = min(box[j], x), max(box[3 + j], x)
            n = normals[f, j]
            box[6 + j], box[9 + j] = min(box[6 + j], n), max(box[9 + j], n)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def groups(boxes: Floats) -> Floats:
    """(m, 12) what `clusters` gives, of each `CLUSTER` of its boxes (n, 12)."""
    out = np.empty(((len(boxes) + CLUSTER - 1) // CLUSTER, 12))
    out[:, 0:3] = out[:, 6:9] = np.inf
    out[:, 3:6] = out[:, 9:12] = -np.inf
    for b in range(len(boxes)):
        box = out[b // CLUSTER]
        for j in range(3):
            box[j], box[3 + j] = min(box[j], boxes[b, j]), max(box[3 + j], boxes[b, 3 + j])
            box[6 + j] = min(box[6 + j], boxes[b, 6 + j])
            box[9 + j] = max(box[9 + j], boxes[b, 9 + j])
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def sheet_polygons(
    corners: Floats,
    normals: Floats,
    boxes: tuple[Floats, Floats],
    R: Floats,
    t: Floats,
    apex: Numbers,
    sheet: Numbers,
    beam: Numbers,
) -> tuple[Floats, Ints]:
    """Parts of the triangles within reach of the sheet that face both laser and camera.

    ``boxes``: of `clusters` and `groups`; triangles (f, 3, 3) of a box away from the sheet, or all
    turned away, are not looked at. ``beam`` holds waist, waist distance, Rayleigh length, reach in
    radii, the aim (3). Returns corner points (m, 3) in the camera frame and, per polygon, where it
    starts (p + 1,).
    """
    points = np.empty((1024, 3))
    starts = np.zeros(1024, np.int32)
    m = p = 0
    poly, cut = np.empty((8, 4)), np.empty((8, 4))
    for b in _lit_clusters(boxes[0], boxes[1], R, t, apex, sheet, beam):
        for f in range(b * CLUSTER, min((b + 1) * CLUSTER, len(corners))):
            _move(corners, f, R, t, sheet, poly)
            low = min(poly[0, 3], poly[1, 3], poly[2, 3])
            high = max(poly[0, 3], poly[1, 3], poly[2, 3])
            reach = reach_of(poly[0, 0], poly[0, 1], poly[0, 2], apex, beam)
            if low > reach or high < -reach or not _faces_both(poly, normals, f, R, apex):
                continue
            n = 3
            if high > reach or low < -reach:
                n = _clip(poly, n, reach, 1.0, cut)
                n = _clip(cut, n, reach, -1.0, poly)
            if n < 3:
                continue
            if m + n > len(points):
                points = np.concatenate((points, np.empty_like(points)))
            if p + 2 > len(starts):
                starts = np.concatenate((starts, np.empty_like(starts)))
            for k in range(n):
                for j in range(3):
                    points[m + k, j] = poly[k, j]
            m += n
            p += 1
            starts[p] = m
    return points[:m], starts[: p + 1]


@njit(cache=True, nogil=True, error_model="numpy")
def _lit_clusters(
    small: Floats, large: Floats, R: Floats, t: Floats, apex: Numbers, sheet: Numbers, beam: Numbers
) -> Ints:
    """The clusters of triangles, of boxes as of `clusters` and `groups`, that may be lit."""
    eye = _into_object(0.0 - t[0], 0.0 - t[1], 0.0 - t[2], R)
    laser = _into_object(apex[0] - t[0], apex[1] - t[1], apex[2] - t[2], R)
    across = _into_object(sheet[0], sheet[1], sheet[2], R)
    found, count = np.empty(len(small), np.int32), 0
    for g in range(len(large)):
        if not (can_face(large, g, eye) and can_face(large, g, laser)):
            continue
        if not _box_near(large, g, R, t, apex, sheet, across, beam):
            continue
        for b in range(g * CLUSTER, min((g + 1) * CLUSTER, len(small))):
            if not (can_face(small, b, eye) and can_face(small, b, laser)):
                continue
            if _box_near(small, b, R, t, apex, sheet, across, beam):
                found[count] = b
                count += 1
    return found[:count]


@njit(cache=True, nogil=True, inline="always")
def _into_object(x: float, y: float, z: float, R: Floats) -> tuple[float, float, float]:
    return (
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
    )


@njit(cache=True, nogil=True, inline="always")
def _move(corners: Floats, f: int, R: Floats, t: Floats, sheet: Numbers, poly: Floats) -> None:
    """A triangle's corners in the camera frame, and their distance from the sheet, as rows."""
    for k in range(3):
        x, y, z = corners[f, k, 0], corners[f, k, 1], corners[f, k, 2]
        for j in range(3):
            poly[k, j] = (R[j, 0] * x + R[j, 1] * y + R[j, 2] * z) + t[j]
        poly[k, 3] = sheet_distance(poly[k, 0], poly[k, 1], poly[k, 2], sheet)


@njit(cache=True, nogil=True, error_model="numpy")
def can_face(boxes: Floats, i: int, eye: Numbers) -> bool:
    """False where no triangle in box i can look towards a place, object frame: the greatest
    product of any normal and any way in their boxes is below 0."""
    most = 0.0
    for j in range(3):
        low, high = eye[j] - boxes[i, 3 + j], eye[j] - boxes[i, j]
        a, b = boxes[i, 6 + j], boxes[i, 9 + j]
        most += max(max(a * low, a * high), max(b * low, b * high))
    return most > -1e-6


@njit(cache=True, nogil=True, error_model="numpy")
def _box_near(
    boxes: Floats, i: int, R: Floats, t: Floats, apex: Numbers, sheet: Numbers, across: Numbers,
    beam: Numbers,
) -> bool:  # fmt: skip
    """False where nothing in box i can lie within reach of the sheet; ``across`` is the sheet's
    normal in the object's frame."""
    thick = radius = 0.0
    for j in range(3):
        half = 0.5 * (boxes[i, 3 + j] - boxes[i, j])
        thick += half * abs(across[j])
        radius += half * half
    radius = math.sqrt(radius)
    x = 0.5 * (boxes[i, 0] + boxes[i, 3])
    y = 0.5 * (boxes[i, 1] + boxes[i, 4])
    z = 0.5 * (boxes[i, 2] + boxes[i, 5])
    cx = R[0, 0] * x + R[0, 1] * y + R[0, 2] * z + t[0]
    cy = R[1, 0] * x + R[1, 1] * y + R[1, 2] * z + t[1]
    cz = R[2, 0] * x + R[2, 1] * y + R[2, 2] * z + t[2]
    along = _along(cx, cy, cz, apex, beam)
    # The sheet is nowhere thicker between, and the distance from a bowed sheet changes at most
    # by this much per mm more than that from a flat one.
    widest = max(_reach_at(along - radius, beam), _reach_at(along + radius, beam))
    off = abs(cx - sheet[3]) + abs(cy - sheet[4]) + abs(cz - sheet[5]) + radius
    bow = 2.0 * (abs(sheet[12]) + abs(sheet[13]) + abs(sheet[14])) * off * radius
    return abs(sheet_distance(cx, cy, cz, sheet)) <= widest + thick + bow + 1e-6


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def _along(x: float, y: float, z: float, apex: Numbers, beam: Numbers) -> float:
    """Distance from the apex along the aim."""
    return (x - apex[0]) * beam[4] + (y - apex[1]) * beam[5] + (z - apex[2]) * beam[6]


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def _reach_at(z: float, beam: Numbers) -> float:
    far = (z - beam[1]) / beam[2]
    return beam[3] * beam[0] * math.sqrt(1.0 + far * far)


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def reach_of(x: float, y: float, z: float, apex: Numbers, beam: Numbers) -> float:
    return _reach_at(_along(x, y, z, apex, beam), beam)


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def _faces_both(poly: Floats, flat: Floats, f: int, R: Floats, apex: Numbers) -> bool:
    to_eye = to_laser = 0.0
    for i in range(3):
        across = R[i, 0] * flat[f, 0] + R[i, 1] * flat[f, 1] + R[i, 2] * flat[f, 2]
        to_eye -= across * poly[0, i]
        to_laser += across * (apex[i] - poly[0, i])
    return to_eye > 0.0 and to_laser > 0.0


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
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
