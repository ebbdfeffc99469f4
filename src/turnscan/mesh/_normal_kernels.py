"""Compiled kernels over the faces of a mesh; imported only when they are used."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.compiled import njit


@njit(cache=True, nogil=True)
def crosses(points: Floats, faces: Ints) -> Floats:
    """(f, 3) the normal of every face, as long as twice its area."""
    out = np.empty((len(faces), 3))
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        u0, u1, u2 = (
            points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
        )  # fmt: skip
        v0, v1, v2 = (
            points[c, 0] - points[a, 0], points[c, 1] - points[a, 1], points[c, 2] - points[a, 2]
        )  # fmt: skip
        out[f, 0], out[f, 1], out[f, 2] = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    return out


@njit(cache=True, nogil=True)
def doubles(points: Floats, faces: Ints) -> Floats:
    """(f,) twice the area of every face."""
    out = np.empty(len(faces))
    cross = crosses(points, faces)
    for f in range(len(faces)):
        x, y, z = cross[f, 0], cross[f, 1], cross[f, 2]
        out[f] = np.sqrt(x * x + y * y + z * z)
    return out


@njit(cache=True, nogil=True)
def level(points: Floats, faces: Ints, normals: Floats, least: float) -> tuple[float, float]:
    """Twice the area of all faces, and of those whose vertices' normals (v, 3) point up or down.

    Those do, whose vertical parts are more than ``least`` in the mean.
    """
    double = doubles(points, faces)
    total, flat = 0.0, 0.0
    for f in range(len(faces)):
        total += double[f]
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        if (abs(normals[a, 2]) + abs(normals[b, 2]) + abs(normals[c, 2])) / 3.0 > least:
            flat += double[f]
    return total, flat


@njit(cache=True, nogil=True)
def _made_unit(vectors: Floats, without: float) -> None:
    for v in range(len(vectors)):
        x, y, z = vectors[v, 0], vectors[v, 1], vectors[v, 2]
        length = np.sqrt(x * x + y * y + z * z)
        for i in range(3):
            vectors[v, i] = vectors[v, i] / length if length > 0.0 else without


@njit(cache=True, nogil=True)
def vertex_normals(points: Floats, faces: Ints) -> Floats:
    """(v, 3) unit normals, faces weighted by area; NaN for a vertex without any."""
    total = np.zeros((len(points), 3))
    cross = crosses(points, faces)
    for f in range(len(faces)):
        for c in range(3):
            for i in range(3):
                total[faces[f, c], i] += cross[f, i]
    _made_unit(total, np.nan)
    return total


@njit(cache=True, nogil=True)
def averaged(normals: Floats, faces: Ints, rounds: int) -> Floats:
    """Unit normals (v, 3) of vertices, averaged over the faces round them, ``rounds`` times."""
    for _ in range(rounds):
        total = np.zeros_like(normals)
        for f in range(len(faces)):
            a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
            for i in range(3):
                mean = normals[a, i] + normals[b, i] + normals[c, i]
                total[a, i] += mean
                total[b, i] += mean
                total[c, i] += mean
        _made_unit(total, 0.0)
        normals = total
    return normals


@njit(cache=True, nogil=True)
def rises(points: Floats, faces: Ints, step: Ints) -> Floats:
    """(m,) mm: differences in height along the sides within one profile, without those of 0."""
    out = np.empty(3 * len(faces))
    made = 0
    for f in range(len(faces)):
        for i in range(3):
            a, b = faces[f, i], faces[f, (i + 1) % 3]
            rise = abs(points[a, 2] - points[b, 2])
            if step[a] == step[b] and rise > 0.0:
                out[made] = rise
                made += 1
    return out[:made].copy()


@njit(cache=True, nogil=True)
def longest_sides(points: Floats, faces: Ints) -> Floats:
    """(v,) mm: the longest side of the faces at each vertex."""
    reach = np.zeros(len(points))
    for f in range(len(faces)):
        for i in range(3):
            a, b = faces[f, i], faces[f, (i + 1) % 3]
            square = 0.0
            for axis in range(3):
                square += (points[a, axis] - points[b, axis]) ** 2
            length = np.sqrt(square)
            reach[a] = max(reach[a], length)
            reach[b] = max(reach[b], length)
    return reach
