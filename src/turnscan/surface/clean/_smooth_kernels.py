"""Compiled kernels of smoothing a mesh; imported only when they are used."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.compiled import njit
from turnscan.mesh._normal_kernels import vertex_normals


@njit(cache=True, nogil=True)
def off_ring(points: Floats, faces: Ints) -> Floats:
    """(v,) mm: how far every vertex lies outside the middle of its neighbours, along its normal.

    Neighbours inside the surface count twice, those across a border once. NaN without a face.
    """
    normal = vertex_normals(points, faces)
    total, count = np.zeros_like(points), np.zeros(len(points))
    for f in range(len(faces)):
        for i in range(3):
            a = faces[f, i]
            for o in range(1, 3):
                b = faces[f, (i + o) % 3]
                for c in range(3):
                    total[a, c] += points[b, c]
                count[a] += 1.0
    out = np.full(len(points), np.nan)
    for v in range(len(points)):
        if count[v] > 0.0:
            out[v] = 0.0
            for c in range(3):
                out[v] += normal[v, c] * (points[v, c] - total[v, c] / count[v])
    return out


@njit(cache=True, nogil=True)
def largest_beside(values: Floats, faces: Ints) -> Floats:
    """(v,) the largest absolute value among the neighbours of every vertex."""
    out = np.zeros(len(values))
    for f in range(len(faces)):
        for i in range(3):
            for o in range(1, 3):
                there = abs(values[faces[f, (i + o) % 3]])
                if there > out[faces[f, i]]:
                    out[faces[f, i]] = there
    return out
