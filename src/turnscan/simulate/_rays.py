# mypy: disable-error-code="no-any-return"
"""Numba kernels of where rays meet the scene. It imports numba; import it inside functions only.

Frames: "camera" is the camera's, "object" the table's frame turned with the table. ``R`` (3, 3)
and ``t`` (3,) map object to camera. Image coordinates are the undistorted ones on z = 1.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.compiled import njit
from turnscan.simulate._airy import Numbers, Singles
from turnscan.simulate._cut import reach_of, sheet_distance


@njit(cache=True, nogil=True)
def corner_normals(
    faces: npt.NDArray[np.integer],
    flat: Floats,
    angles: Floats,
    order: npt.NDArray[np.intp],
    starts: npt.NDArray[np.intp],
    crease: float,
) -> Floats:
    """(f, 3, 3): neighbours' normals averaged by their angle, except across edges."""
    out = np.empty((len(faces), 3, 3))
    for f in range(len(faces)):
        for k in range(3):
            x = y = z = 0.0
            for i in range(starts[faces[f, k]], starts[faces[f, k] + 1]):
                g, j = order[i] // 3, order[i] % 3
                n = flat[g]
                if n[0] * flat[f, 0] + n[1] * flat[f, 1] + n[2] * flat[f, 2] > crease:
                    x += angles[g, j] * n[0]
                    y += angles[g, j] * n[1]
                    z += angles[g, j] * n[2]
            length = math.sqrt(x * x + y * y + z * z)
            out[f, k, 0], out[f, k, 1], out[f, k, 2] = x / length, y / length, z / length
    return out


@njit(cache=True, nogil=True)
def rays(numbers: Ints, field: Floats, down: int, across: int, R: Floats, sheared: bool) -> Singles:
    """Directions (n·down·across, 3), object frame, of a grid of rays in each pixel.

    ``numbers`` (n,) count the pixels row by row; ``field`` (H + 1, W + 1, 2) holds the image
    coordinates of their outer corners. In a ``sheared`` grid no two rays of a pixel share a row or
    a column: an edge along these is sampled as finely as there are rays, not rows of them.
    """
    out = np.empty((len(numbers) * down * across, 3), np.float32)
    width = field.shape[1] - 1
    k = 0
    for i in range(len(numbers)):
        row = numbers[i] // width
        column = numbers[i] - row * width
        for y in range(down):
            for x in range(across):
                v = (y + ((x + 0.5) / across if sheared else 0.5)) / down
                u = (x + ((y + 0.5) / down if sheared else 0.5)) / across
                p, q = within(field, row, column, v, u)
                for j in range(3):
                    out[k, j] = R[0, j] * p + R[1, j] * q + R[2, j]
                k += 1
    return out


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def within(field: Floats, row: int, column: int, y: float, x: float) -> tuple[float, float]:
    # Element by element: a view in a loop over cells costs more than all of this arithmetic.
    r, c = row + 1, column + 1
    a, b = (1 - y) * (1 - x), (1 - y) * x
    d, e = y * (1 - x), y * x
    p = a * field[row, column, 0] + b * field[row, c, 0]
    p += d * field[r, column, 0] + e * field[r, c, 0]
    q = a * field[row, column, 1] + b * field[row, c, 1]
    q += d * field[r, column, 1] + e * field[r, c, 1]
    return p, q


@njit(cache=True, nogil=True, error_model="numpy")
def surface(
    face: Ints,
    directions: Singles | Floats,
    origins: Floats,
    v: Floats,
    faces: Ints,
    flat: Floats,
    corners: Floats,
) -> tuple[Floats, Floats]:
    """Where rays meet their faces, and the smooth normals there: (n, 3) each.

    ``origins`` (n, 3), or (1, 3) for all. Object frame; NaN where the ray meets nothing.
    """
    points, normals = np.empty((len(face), 3)), np.empty((len(face), 3))
    for i in range(len(face)):
        f = face[i]
        slope = reach = 0.0
        if f >= 0:
            a, o = faces[f, 0], i if len(origins) > 1 else 0
            for k in range(3):
                slope += flat[f, k] * directions[i, k]
                reach += flat[f, k] * (v[a, k] - origins[o, k])
        if not slope < 0.0:
            points[i] = normals[i] = np.nan
            continue
        for k in range(3):
            points[i, k] = origins[o, k] + directions[i, k] * (reach / slope)
        _smooth_normal(points, i, v, faces, f, corners, normals)
    return points, normals


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def _smooth_normal(
    points: Floats, i: int, v: Floats, faces: Ints, f: int, corners: Floats, out: Floats
) -> None:
    d11 = d12 = d22 = p = q = 0.0
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    for k in range(3):
        e1, e2, w = v[b, k] - v[a, k], v[c, k] - v[a, k], points[i, k] - v[a, k]
        d11 += e1 * e1
        d12 += e1 * e2
        d22 += e2 * e2
        p += w * e1
        q += w * e2
    det = d11 * d22 - d12 * d12
    u = min(max((d22 * p - d12 * q) / det, 0.0), 1.0)
    t = min(max((d11 * q - d12 * p) / det, 0.0), 1.0)
    length = 0.0
    for k in range(3):
        mean = (1 - u - t) * corners[f, 0, k] + u * corners[f, 1, k] + t * corners[f, 2, k]
        out[i, k] = mean
        length += mean * mean
    length = math.sqrt(length)
    for k in range(3):
        out[i, k] /= length


@njit(cache=True, nogil=True)
def near_sheet(
    points: Floats,
    normals: Floats,
    R: Floats,
    t: Floats,
    apex: Numbers,
    sheet: Numbers,
    beam: Numbers,
    widened: float,
) -> Bools:
    """(n,) True where a point faces the laser and lies within reach of its sheet."""
    out = np.zeros(len(points), np.bool_)
    x = np.empty(3)
    for i in range(len(points)):
        if math.isnan(points[i, 0]):
            continue
        facing = 0.0
        for k in range(3):
            x[k] = R[k, 0] * points[i, 0] + R[k, 1] * points[i, 1] + R[k, 2] * points[i, 2] + t[k]
        for k in range(3):
            n = R[k, 0] * normals[i, 0] + R[k, 1] * normals[i, 1] + R[k, 2] * normals[i, 2]
            facing += n * (apex[k] - x[k])
        d = sheet_distance(x[0], x[1], x[2], sheet)
        out[i] = facing > 0.0 and abs(d) < widened * reach_of(x[0], x[1], x[2], apex, beam)
    return out
