"""Compiled kernels of the cut; imported only when they are used."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Ints, Longs
from turnscan.compiled import njit


@njit(cache=True, nogil=True)
def chains(
    begin: Longs, end: Longs, order: Longs, following: Longs, heads: Longs, vertices: Floats
) -> tuple[Ints, Longs]:
    """Directed sides → loops: their corners in a row, and where each begins.

    ``order`` sorts the sides by where they begin; ``following`` is the place of the first in it
    that begins where each ends, or where it would be. ``heads`` begin where no side ends. A chain
    that is open, because the surface is, goes on at the nearest beginning of one, which may be its
    own: the section is closed across the gap. (NumPy sorts outside: it takes a few seconds to
    compile here.)
    """
    n = len(begin)
    taken = np.zeros(n, dtype=np.bool_)
    corners = np.empty(2 * n, dtype=np.int32)
    starts = np.empty(n, dtype=np.int64)
    made = 0
    loops = 0
    # Open chains come first.
    for turn in range(n + len(heads)):
        side = int(heads[turn]) if turn < len(heads) else turn - len(heads)
        if taken[side]:
            continue
        starts[loops] = made
        loops += 1
        first = begin[side]
        while True:
            taken[side] = True
            corners[made] = begin[side]
            made += 1
            here = end[side]
            if here == first:
                break
            k = following[side]
            ahead = -1
            while k < n and begin[order[k]] == here:
                if not taken[order[k]]:
                    ahead = int(order[k])
                    break
                k += 1
            if ahead < 0:
                corners[made] = here
                made += 1
                gap = _away(vertices, here, first)
                for h in heads:
                    if not taken[h] and _away(vertices, here, begin[h]) < gap:
                        gap = _away(vertices, here, begin[h])
                        ahead = int(h)
                if ahead < 0:
                    break
            side = ahead
    return corners[:made], starts[:loops]


@njit(cache=True, nogil=True)
def _away(vertices: Floats, a: int, b: int) -> float:
    d = vertices[a] - vertices[b]
    return float(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])


@njit(cache=True, nogil=True)
def contains(loop: Floats, point: Floats) -> bool:
    """Whether a point lies within a loop (m, 2)."""
    inside = False
    m = len(loop)
    for i in range(m):
        x0, y0 = loop[i]
        x1, y1 = loop[(i + 1) % m]
        spans = (y0 > point[1]) != (y1 > point[1])
        if spans and point[0] < x0 + (point[1] - y0) / (y1 - y0) * (x1 - x0):
            inside = not inside
    return inside
