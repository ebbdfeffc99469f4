"""One pass over the faces of a surface, for the figures shown after every edit."""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.compiled import njit


@njit(cache=True, nogil=True, inline="always")
def _mixed(a: int, b: int) -> np.uint64:
    """A number without pattern for a side from ``a`` to ``b`` (splitmix64)."""
    x = (np.uint64(a) << np.uint64(32)) | np.uint64(b)
    x += np.uint64(0x9E3779B97F4A7C15)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@njit(cache=True, nogil=True, error_model="numpy")
def figures(
    vertices: Floats, faces: Ints, alive: Bools
) -> tuple[int, int, float, Floats, Floats, bool]:
    """Faces, vertices used, volume, lowest and highest corner, and whether it is closed.

    Closed: every side is met as often in one direction as in the other. Their numbers without
    pattern are summed, with opposite signs; a surface that is open comes out closed once in 2⁶⁴.
    """
    used = np.zeros(len(vertices), np.bool_)
    count, volume = 0, 0.0
    balance = np.uint64(0)
    low = np.full(3, np.inf)
    high = np.full(3, -np.inf)
    for f in range(len(faces)):
        if not alive[f]:
            continue
        count += 1
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        p, q, r = vertices[i], vertices[j], vertices[k]
        x = (q[1] - p[1]) * (r[2] - p[2]) - (q[2] - p[2]) * (r[1] - p[1])
        y = (q[2] - p[2]) * (r[0] - p[0]) - (q[0] - p[0]) * (r[2] - p[2])
        z = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
        volume += (p[0] * x + p[1] * y + p[2] * z) / 6.0
        balance += _mixed(i, j) + _mixed(j, k) + _mixed(k, i)
        balance -= _mixed(j, i) + _mixed(k, j) + _mixed(i, k)
        used[i] = used[j] = used[k] = True
    corners = 0
    for v in range(len(vertices)):
        if used[v]:
            corners += 1
            for d in range(3):
                low[d] = min(low[d], vertices[v, d])
                high[d] = max(high[d], vertices[v, d])
    return count, corners, volume, low, high, count > 0 and balance == np.uint64(0)
