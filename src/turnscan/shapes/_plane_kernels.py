"""Compiled kernels of plane finding; imported only when they are used."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Ints, Longs
from turnscan.compiled import njit

_MOST = 400
"""Vertices that a local plane looks at."""


@njit(cache=True, nogil=True)
def local_planes(
    vertices: Floats, first: Floats, start: Ints, near: Ints, reach: float
) -> tuple[Floats, Floats]:
    """Local plane of every vertex: normals (v, 3) on the side of ``first``, roughness (v,) mm.

    The plane goes through the vertices that are connected within ``reach`` mm; inf where fewer
    than six are.
    """
    count = len(vertices)
    normals = first.copy()
    rough = np.full(count, np.inf)
    seen = np.full(count, -1, dtype=np.int64)
    queue = np.empty(_MOST, dtype=np.int64)
    for i in range(count):
        queue[0] = i
        seen[i] = i
        filled, at = 1, 0
        while at < filled and filled < _MOST:
            here = queue[at]
            at += 1
            for e in range(start[here], start[here + 1]):
                k = near[e]
                if seen[k] == i or filled >= _MOST:
                    continue
                seen[k] = i
                d = vertices[k] - vertices[i]
                if (d * d).sum() <= reach * reach:
                    queue[filled] = k
                    filled += 1
        if filled < 6:
            continue
        centre = np.zeros(3)
        for q in range(filled):
            centre += vertices[queue[q]]
        centre /= filled
        moments = np.zeros((3, 3))
        for q in range(filled):
            d = vertices[queue[q]] - centre
            for a in range(3):
                for b in range(3):
                    moments[a, b] += d[a] * d[b]
        values, axes = np.linalg.eigh(moments)
        rough[i] = np.sqrt(max(values[0], 0.0) / max(filled - 3, 1))
        n = axes[:, 0]
        facing = n[0] * first[i, 0] + n[1] * first[i, 1] + n[2] * first[i, 2]
        for a in range(3):
            normals[i, a] = n[a] if facing >= 0 else -n[a]
    return normals, rough


@njit(cache=True, nogil=True)
def grow(
    vertices: Floats,
    normals: Floats,
    start: Ints,
    near: Ints,
    label: Ints,
    seed: int,
    centre: Floats,
    normal: Floats,
    limit: float,
    cos_turn: float,
) -> Longs:
    """Vertices connected to the seed that lie on the plane and belong to no region (label < 0)."""
    taken = np.zeros(len(vertices), dtype=np.bool_)
    queue = np.empty(len(vertices), dtype=np.int64)
    queue[0] = seed
    taken[seed] = True
    filled, at = 1, 0
    while at < filled:
        here = queue[at]
        at += 1
        for e in range(start[here], start[here + 1]):
            k = near[e]
            if taken[k] or label[k] >= 0:
                continue
            away = 0.0
            turn = 0.0
            for a in range(3):
                away += (vertices[k, a] - centre[a]) * normal[a]
                turn += normals[k, a] * normal[a]
            if abs(away) <= limit and turn >= cos_turn:
                taken[k] = True
                queue[filled] = k
                filled += 1
    return queue[:filled].copy()
