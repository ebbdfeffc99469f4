# mypy: disable-error-code="no-any-return"
"""Ray casting for machines without an Embree wheel: a balanced tree of boxes, by Numba.

Intersection after Möller and Trumbore, 1997.
This module imports numba; import it inside functions only.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Ints
from turnscan.compiled import njit
from turnscan.mesh._tree_kernels import boxes, morton_order, spans

Singles = npt.NDArray[np.float32]

_LEAF = 4
_FAR = 1e30


class TreeScene:
    """The part of Embree's scene that `Caster` needs, with the same meaning."""

    def __init__(self, vertices: Floats, faces: Ints) -> None:
        order = morton_order(vertices, faces)
        self._order = order.astype(np.int32)
        self._corners = vertices[faces[order]]
        depth = max(0, math.ceil(math.log2(max(1, len(faces) / _LEAF))))
        self._boxes = boxes(spans(vertices, faces[order]), 1 << depth)

    def run(
        self, origins: Singles, directions: Singles, dists: Singles | None = None,
        query: str = "INTERSECT",
    ) -> Ints:  # fmt: skip
        """(n,) face that each ray meets (first, or any for OCCLUDED) within ``dists``; −1: none."""
        far = np.full(len(origins), _FAR, np.float32) if dists is None else dists
        any_hit = query == "OCCLUDED"
        found = _run(origins, directions, far, any_hit, self._corners, self._boxes)
        return np.where(found >= 0, self._order[found], -1).astype(np.int32)


@njit(cache=True, nogil=True)
def _run(
    origins: Singles, directions: Singles, far: Singles, any_hit: bool, corners: Floats,
    nodes: Singles,
) -> Ints:  # fmt: skip
    leaves = len(nodes) // 2
    found = np.full(len(origins), -1, np.int32)
    stack = np.empty(64, np.int64)
    for i in range(len(origins)):
        o, d = origins[i], directions[i]
        limit = float(far[i])
        stack[0], n = 1, 1
        while n:
            n -= 1
            node = stack[n]
            if not _meets(o, d, nodes[node], limit):
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
def _meets(o: Singles, d: Singles, box: Singles, limit: float) -> bool:
    near, far = 0.0, limit
    for k in range(3):
        if d[k] == 0.0:
            if o[k] < box[k] or o[k] > box[3 + k]:
                return False
            continue
        a, b = (box[k] - o[k]) / d[k], (box[3 + k] - o[k]) / d[k]
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
