"""Compiled kernel of smooth normals; imported only when it is used."""

from __future__ import annotations

import math

import numpy as np

from turnscan.arrays import Floats, Ints, Longs
from turnscan.compiled import njit


@njit(cache=True, nogil=True, error_model="numpy")
def smooth_normals(
    normals: Floats,
    areas: Floats,
    tilts: Floats,
    faces: Ints,
    start: Longs,
    about: Ints,
    rounds: int,
    edge: float,
) -> Floats:
    """(f, 3) unit normals (f, 3), each the mean of those about it that are alike, again and again.

    ``tilts`` (f,) are the variances of the normals' noise; normals that differ by more than
    ``edge`` and twice the noise of both are those of another side of an edge. A face counts up to
    three times as much as the one that takes it, so that a lid of a few large faces tilts no wall.
    ``start`` and ``about`` are those of `turnscan.mesh.faces_about`.
    """
    old, noise = normals.copy(), tilts.copy()
    new, less = np.empty_like(old), np.empty_like(noise)
    for _ in range(rounds):
        for f in range(len(faces)):
            x, y, z, whole, spread = 0.0, 0.0, 0.0, 0.0, 0.0
            for i in range(3):
                for k in range(start[faces[f, i]], start[faces[f, i] + 1]):
                    g = about[k]
                    a, b, c = old[g, 0], old[g, 1], old[g, 2]
                    apart = (a - old[f, 0]) ** 2 + (b - old[f, 1]) ** 2 + (c - old[f, 2]) ** 2
                    wide = 2.0 * (edge * edge + 2.0 * (noise[f] + noise[g]))
                    w = min(areas[g], 3.0 * areas[f]) * math.exp(-apart / wide)
                    x, y, z = x + w * a, y + w * b, z + w * c
                    whole += w
                    spread += w * w * noise[g]
            length = math.sqrt(x * x + y * y + z * z)
            if length > 0.0:
                new[f, 0], new[f, 1], new[f, 2] = x / length, y / length, z / length
                less[f] = spread / (whole * whole)
            else:
                new[f], less[f] = old[f], noise[f]
        old, new = new, old
        noise, less = less, noise
    return old
