"""Does the surface go on across a gap: borders that face each other over a smooth arc. Numba."""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import math

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.compiled import njit

_TOWARDS = 0.5
"""Cosine: a border that a patch goes on from looks to the other end by 60° at most."""
_OFF = 0.35
"""Sine by which an arc between two tangent planes may be amiss: 20°."""
_TURN = 0.0
"""Cosine: the arc turns by 90° at most."""


@njit(cache=True, nogil=True)
def facing(X: Floats, n: Floats, outward: Floats) -> Bools:
    """(m,) True for the corners (m, 3) of borders that another one faces over a smooth arc.

    ``n`` (m, 3) are the normals there, ``outward`` (m, 3) the ways along the surface and off it,
    all of length 1. An arc that leaves one tangent plane and comes to the other meets their chord
    at the same angle at both ends, so that the sum of the normals is upright on the chord.
    """
    m = len(X)
    out = np.zeros(m, dtype=np.bool_)
    for i in range(m):
        for j in range(m):
            turn = n[i, 0] * n[j, 0] + n[i, 1] * n[j, 1] + n[i, 2] * n[j, 2]
            if turn < _TURN:
                continue
            dx, dy, dz = X[j, 0] - X[i, 0], X[j, 1] - X[i, 1], X[j, 2] - X[i, 2]
            length = math.sqrt(dx * dx + dy * dy + dz * dz)
            if length < 1e-9:
                continue
            ahead = outward[i, 0] * dx + outward[i, 1] * dy + outward[i, 2] * dz
            back = outward[j, 0] * dx + outward[j, 1] * dy + outward[j, 2] * dz
            if ahead < _TOWARDS * length or -back < _TOWARDS * length:
                continue
            off = (n[i, 0] + n[j, 0]) * dx + (n[i, 1] + n[j, 1]) * dy + (n[i, 2] + n[j, 2]) * dz
            if abs(off) < 2.0 * _OFF * length:
                out[i] = True
                break
    return out
