"""Compiled kernels of the cut; imported only when they are used."""
# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

from typing import Any

import numpy as np

from turnscan.compiled import njit


@njit(cache=True, nogil=True)
def chains(begin: Any, end: Any, vertices: Any) -> Any:
    """Directed sides → loops: their corners in a row, and where each begins.

    A chain that is open, because the surface is, goes on at the nearest beginning of one, which may
    be its own: the section is closed across the gap.
    """
    n = len(begin)
    order = np.argsort(begin)
    sorted_begin = begin[order]
    taken = np.zeros(n, dtype=np.bool_)
    # Chains that begin where no side ends come first: they are the open ones.
    ends = np.sort(end)
    at = np.minimum(np.searchsorted(ends, begin), n - 1)
    heads = np.flatnonzero(ends[at] != begin)
    corners = np.empty(2 * n, dtype=np.int32)
    starts = np.empty(n, dtype=np.int64)
    made = 0
    loops = 0
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
            k = np.searchsorted(sorted_begin, here)
            ahead = -1
            while k < n and sorted_begin[k] == here:
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
def _away(vertices: Any, a: int, b: int) -> float:
    d = vertices[a] - vertices[b]
    return float(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])


@njit(cache=True, nogil=True)
def contains(loop: Any, point: Any) -> bool:
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


@njit(cache=True, nogil=True)
def bridged(ring: Any, hole: Any, xy: Any) -> Any:
    """A polygon that goes along ``ring``, over a bridge round ``hole``, and back over the bridge.

    From the rightmost corner of the hole a ray to the right meets a side of the ring; the bridge
    goes to an end of that side, or to a corner in between that hides it (Eberly, Triangulation by
    ear clipping, 2002).
    """
    h = 0
    for i in range(len(hole)):
        if xy[hole[i], 0] > xy[hole[h], 0]:
            h = i
    x, y = xy[hole[h]]
    m = len(ring)
    at, reach = _met(ring, xy, x, y)
    target = _seen(ring, xy, x, y, at, reach)
    out = np.empty(m + len(hole) + 2, dtype=ring.dtype)
    out[: target + 1] = ring[: target + 1]
    made = target + 1
    for i in range(len(hole) + 1):
        out[made] = hole[(h + i) % len(hole)]
        made += 1
    out[made:] = ring[target:]
    return out


@njit(cache=True, nogil=True)
def _met(ring: Any, xy: Any, x: float, y: float) -> Any:
    """The right end of the side that the ray meets, as a place in the ring, and where it does."""
    m = len(ring)
    best = np.inf
    at = 0
    for i in range(m):
        x0, y0 = xy[ring[i]]
        x1, y1 = xy[ring[(i + 1) % m]]
        # A counter-clockwise ring passes upwards where it bounds the inside on its left.
        if y0 <= y <= y1 and y0 < y1:
            meets = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
            if x <= meets < best:
                best = meets
                at = i if x0 > x1 else (i + 1) % m
    return at, best


@njit(cache=True, nogil=True)
def _seen(ring: Any, xy: Any, x: float, y: float, at: int, reach: float) -> int:
    """The place in the ring to bridge to: ``at``, or a corner that is in the way of it."""
    m = len(ring)
    px, py = xy[ring[at]]
    flattest = np.inf
    target = at
    for i in range(m):
        cx, cy = xy[ring[i]]
        if cx < x or (cx == px and cy == py):
            continue
        slope = abs(cy - y) / max(cx - x, 1e-300)
        hides = slope < flattest and _within(cx, cy, x, y, reach, y, px, py)
        if hides and _opens(ring, xy, i, x, y):
            flattest = slope
            target = i
    if target == at:
        # The same corner may stand in the ring twice, by an earlier bridge: take what faces us.
        for i in range(m):
            if ring[i] == ring[at] and _opens(ring, xy, i, x, y):
                return i
    return target


@njit(cache=True, nogil=True)
def _within(
    cx: float, cy: float, ax: float, ay: float, bx: float, by: float, px: float, py: float
) -> bool:
    d0 = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    d1 = (px - bx) * (cy - by) - (py - by) * (cx - bx)
    d2 = (ax - px) * (cy - py) - (ay - py) * (cx - px)
    return bool((d0 >= 0 and d1 >= 0 and d2 >= 0) or (d0 <= 0 and d1 <= 0 and d2 <= 0))


@njit(cache=True, nogil=True)
def _opens(ring: Any, xy: Any, i: int, x: float, y: float) -> bool:
    """Whether the inside of the ring at corner ``i`` is towards a point."""
    m = len(ring)
    ax, ay = xy[ring[(i - 1) % m]]
    bx, by = xy[ring[i]]
    cx, cy = xy[ring[(i + 1) % m]]
    turn = (bx - ax) * (cy - by) - (by - ay) * (cx - bx)
    after = (cx - bx) * (y - by) - (cy - by) * (x - bx)
    before = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
    if turn >= 0:
        return bool(after >= 0 and before >= 0)
    return bool(after >= 0 or before >= 0)
