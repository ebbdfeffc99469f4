# mypy: disable-error-code="untyped-decorator,no-any-return"
"""Ray casting for machines without an Embree wheel: a balanced tree of boxes, by Numba.

Triangles are sorted along a Morton curve, so that neighbours in the list are neighbours in space;
the tree halves the list. Intersection after Möller and Trumbore, 1997.
This module imports numba; import it inside functions only.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Ints
from turnscan.compiled import njit

Singles = npt.NDArray[np.float32]

_LEAF = 4
_FAR = 1e30


class TreeScene:
    """The part of Embree's scene that `Caster` needs, with the same meaning."""

    def __init__(self, vertices: Floats, faces: Ints) -> None:
        corners = vertices[faces]
        order = morton_order(corners.mean(axis=1))
        self._order = order.astype(np.int32)
        self._corners = np.ascontiguousarray(corners[order])
        depth = max(0, math.ceil(math.log2(max(1, len(faces) / _LEAF))))
        self._low, self._high = boxes(self._corners, 1 << depth)

    def run(
        self, origins: Singles, directions: Singles, dists: Singles | None = None,
        query: str = "INTERSECT",
    ) -> Ints:  # fmt: skip
        """(n,) face that each ray meets (first, or any for OCCLUDED) within ``dists``; −1: none."""
        far = np.full(len(origins), _FAR, np.float32) if dists is None else dists
        any_hit = query == "OCCLUDED"
        found = _run(origins, directions, far, any_hit, self._corners, self._low, self._high)
        return np.where(found >= 0, self._order[found], -1).astype(np.int32)


def morton_order(points: Floats) -> npt.NDArray[np.int64]:
    low = points.min(axis=0)
    cells = ((points - low) / max(float(np.ptp(points, axis=0).max()), 1e-9) * 1023).astype(int)
    code = np.zeros(len(points), np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def boxes(corners: Floats, leaves: int) -> tuple[Floats, Floats]:
    """Boxes of a heap: node 1 is the root, 2i and 2i + 1 the halves of i."""
    low = np.full((2 * leaves, 3), _FAR)
    high = np.full((2 * leaves, 3), -_FAR)
    ends = np.arange(leaves + 1) * len(corners) // leaves
    for k in range(3):
        np.minimum.at(low, leaves + _leaf_of(ends), corners[:, k])
        np.maximum.at(high, leaves + _leaf_of(ends), corners[:, k])
    level = leaves
    while level > 1:
        low[level // 2 : level] = low[level : 2 * level].reshape(-1, 2, 3).min(axis=1)
        high[level // 2 : level] = high[level : 2 * level].reshape(-1, 2, 3).max(axis=1)
        level //= 2
    return low, high


def _leaf_of(ends: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    return np.repeat(np.arange(len(ends) - 1), np.diff(ends))


@njit(cache=True, nogil=True)
def _run(
    origins: Singles, directions: Singles, far: Singles, any_hit: bool, corners: Floats,
    low: Floats, high: Floats,
) -> Ints:  # fmt: skip
    leaves = len(low) // 2
    found = np.full(len(origins), -1, np.int32)
    stack = np.empty(64, np.int64)
    for i in range(len(origins)):
        o, d = origins[i], directions[i]
        limit = float(far[i])
        stack[0], n = 1, 1
        while n:
            n -= 1
            node = stack[n]
            if not _meets(o, d, low[node], high[node], limit):
                continue
            if node < leaves:
                stack[n], stack[n + 1] = 2 * node, 2 * node + 1
                n += 2
                continue
            a = (node - leaves) * len(corners) // leaves
            b = (node - leaves + 1) * len(corners) // leaves
            for f in range(a, b):
                t = _distance(o, d, corners[f])
                if 0.0 < t < limit:
                    limit, found[i] = t, f
            if any_hit and found[i] >= 0:
                break
    return found


@njit(cache=True, nogil=True, inline="always")
def _meets(o: Singles, d: Singles, low: Floats, high: Floats, limit: float) -> bool:
    near, far = 0.0, limit
    for k in range(3):
        if d[k] == 0.0:
            if o[k] < low[k] or o[k] > high[k]:
                return False
            continue
        a, b = (low[k] - o[k]) / d[k], (high[k] - o[k]) / d[k]
        near, far = max(near, min(a, b)), min(far, max(a, b))
    return near <= far


@njit(cache=True, nogil=True, inline="always")
def _distance(o: Singles, d: Singles, corners: Floats) -> float:
    """Distance along the ray to the triangle in units of d, −1 where it misses."""
    ux, uy, uz = (
        corners[1, 0] - corners[0, 0],
        corners[1, 1] - corners[0, 1],
        corners[1, 2] - corners[0, 2],
    )
    vx, vy, vz = (
        corners[2, 0] - corners[0, 0],
        corners[2, 1] - corners[0, 1],
        corners[2, 2] - corners[0, 2],
    )
    px, py, pz = d[1] * vz - d[2] * vy, d[2] * vx - d[0] * vz, d[0] * vy - d[1] * vx
    det = ux * px + uy * py + uz * pz
    if abs(det) < 1e-15:
        return -1.0
    sx, sy, sz = o[0] - corners[0, 0], o[1] - corners[0, 1], o[2] - corners[0, 2]
    u = (sx * px + sy * py + sz * pz) / det
    if u < 0.0 or u > 1.0:
        return -1.0
    qx, qy, qz = sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux
    v = (d[0] * qx + d[1] * qy + d[2] * qz) / det
    if v < 0.0 or u + v > 1.0:
        return -1.0
    return (vx * qx + vy * qy + vz * qz) / det
