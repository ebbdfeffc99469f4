"""Compiled kernels of what an edge collapse may not do: tear, turn over, splinter, stray."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.compiled import njit
from turnscan.surface.decimation._net_kernels import (
    AHEAD,
    BACK,
    CORNER,
    LEFT,
    NEAR,
    PLACE,
    RIGHT,
    SAMPLE,
    Net,
)

_WITHIN = (
    (1 / 3, 1 / 3, 1 / 3), (0.6, 0.2, 0.2), (0.2, 0.6, 0.2), (0.2, 0.2, 0.6),
    (0.5, 0.5, 0.0), (0.75, 0.25, 0.0), (0.25, 0.75, 0.0),
)  # fmt: skip
"""Places in a face at which it is compared with the first surface."""
_TURN = 0.3
"""Cosine: no face may turn further at once."""
_SLIM = 0.02
"""A face may become slimmer than this (1 is equilateral) only where it was slimmer before."""


@njit(cache=True, nogil=True, forceinline=True)
def keeps_topology(
    mine: Ints, count: int, have: int, u: int, shared: int, theirs: Ints, others: int, near: int
) -> bool:
    """Whether v may become u: the surface stays as it hangs together, and something of it stays.

    Both have no neighbours in common but those across from their side (Dey et al. 1999), and no
    face comes to lie on the back of another.
    """
    if count == shared and others == shared:
        return False
    common = 0
    for i in range(have):
        for j in range(near):
            common += mine[NEAR, i] == theirs[NEAR, j]
    if common != shared:
        return False
    for i in range(count):
        a, b = mine[LEFT, i], mine[RIGHT, i]
        if a == u or b == u:
            continue
        for j in range(others):
            c, d = theirs[LEFT, j], theirs[RIGHT, j]
            if (a == c and b == d) or (a == d and b == c):
                return False
    return True


@njit(cache=True, nogil=True, forceinline=True)
def keeps_sides(at: Floats, v: int, u: int, ring: Ints, count: int) -> bool:
    """Whether no face turns over, or becomes a splinter, when its corner moves to u."""
    for i in range(count):
        a, b = ring[LEFT, i], ring[RIGHT, i]
        if a == u or b == u:
            continue
        x, y, z = at[a, PLACE], at[a, PLACE + 1], at[a, PLACE + 2]
        s0, s1, s2 = at[b, PLACE] - x, at[b, PLACE + 1] - y, at[b, PLACE + 2] - z
        p0, p1, p2 = at[v, PLACE] - x, at[v, PLACE + 1] - y, at[v, PLACE + 2] - z
        r0, r1, r2 = at[u, PLACE] - x, at[u, PLACE + 1] - y, at[u, PLACE + 2] - z
        n0, n1, n2 = s1 * p2 - s2 * p1, s2 * p0 - s0 * p2, s0 * p1 - s1 * p0
        m0, m1, m2 = s1 * r2 - s2 * r1, s2 * r0 - s0 * r2, s0 * r1 - s1 * r0
        dot = n0 * m0 + n1 * m1 + n2 * m2
        nn = n0 * n0 + n1 * n1 + n2 * n2
        mm = m0 * m0 + m1 * m1 + m2 * m2
        # A face without area has no side to keep.
        if nn > 0.0 and not (dot > 0.0 and dot * dot > _TURN * _TURN * nn * mm):
            return False
        # Twice the area of the face against its sides, squared, as of an equilateral one.
        ss = s0 * s0 + s1 * s1 + s2 * s2
        then = 2.0 * (ss + r0 * r0 + r1 * r1 + r2 * r2 - s0 * r0 - s1 * r1 - s2 * r2)
        if 12.0 * mm < _SLIM * _SLIM * then * then:
            before = 2.0 * (ss + p0 * p0 + p1 * p1 + p2 * p2 - s0 * p0 - s1 * p1 - s2 * p2)
            if mm * before * before <= nn * then * then:
                return False
    return True


@njit(cache=True, nogil=True)
def _off_face(p: Floats, a: Floats, b: Floats, c: Floats) -> float:
    """Squared distance of a point from a triangle (Ericson 2005, §5.1.5).

    Of a triangle whose corners coincide or lie on a line it may be that from one of them: more.
    """
    ab0, ab1, ab2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    ac0, ac1, ac2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    ap0, ap1, ap2 = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    d1 = ab0 * ap0 + ab1 * ap1 + ab2 * ap2
    d2 = ac0 * ap0 + ac1 * ap1 + ac2 * ap2
    aa = ab0 * ab0 + ab1 * ab1 + ab2 * ab2
    bb = ab0 * ac0 + ab1 * ac1 + ab2 * ac2
    cc = ac0 * ac0 + ac1 * ac1 + ac2 * ac2
    d3, d4 = d1 - aa, d2 - bb
    d5, d6 = d1 - bb, d2 - cc
    vc, vb, va = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
    s, t = 0.0, 0.0
    if d1 <= 0.0 and d2 <= 0.0:
        s, t = 0.0, 0.0
    elif d3 >= 0.0 and d4 <= d3:
        s, t = 1.0, 0.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        s = d1 / (d1 - d3) if d1 > d3 else 0.0
    elif d6 >= 0.0 and d5 <= d6:
        s, t = 0.0, 1.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t = d2 / (d2 - d6) if d2 > d6 else 0.0
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        side = (d4 - d3) + (d5 - d6)
        t = (d4 - d3) / side if side > 0.0 else 0.0
        s = 1.0 - t
    else:
        total = va + vb + vc
        if total > 0.0:
            s, t = vb / total, vc / total
    x, y, z = ap0 - s * ab0 - t * ac0, ap1 - s * ab1 - t * ac1, ap2 - s * ab2 - t * ac2
    return x * x + y * y + z * z  # type: ignore[no-any-return]


@njit(cache=True, nogil=True, forceinline=True)
def _place(net: Net, v: int) -> Floats:
    return net.at[v, PLACE : PLACE + 3]


@njit(cache=True, nogil=True)
def keeps_near(net: Net, u: int, ring: Ints, count: int, held: Ints, owner: Ints) -> int:
    """Write the samples about a vertex that moves to u, and the face that each will hang on.

    Gives how many there are, −1 where one would lie too far from all of those faces.
    """
    have = 0
    for i in range(count):
        s = net.tri[ring[CORNER, i] >> 2, SAMPLE]
        while s >= 0:
            best, at = np.inf, -1
            for j in range(count):
                a, b = ring[LEFT, j], ring[RIGHT, j]
                if a == u or b == u:
                    continue
                d = _off_face(net.samples[s], _place(net, u), _place(net, a), _place(net, b))
                if d < best:
                    best, at = d, ring[CORNER, j] >> 2
            if have == len(held) or not best <= net.limit:
                return -1
            held[have], owner[have] = s, at
            have += 1
            s = net.follow[s]
    return have


@njit(cache=True, nogil=True)
def _off_old(net: Net, p: Floats, held: Ints, have: int) -> float:
    """Squared distance of a point from the first surface about the vertex of it that is nearest.

    Looked for among the samples ``held``; infinite where there is no vertex among them.
    """
    points = net.samples
    nearest, best = -1, np.inf
    for i in range(have):
        s = held[i]
        if s < len(net.at):
            d = (p[0] - points[s, 0]) ** 2 + (p[1] - points[s, 1]) ** 2 + (p[2] - points[s, 2]) ** 2
            if d < best:
                nearest, best = s, d
    if nearest < 0:
        return best
    c = net.old_head[nearest]
    while c >= 0:
        a, b = net.old[c // 3, (c + 1) % 3], net.old[c // 3, (c + 2) % 3]
        best = min(best, _off_face(p, points[nearest], points[a], points[b]))
        c = net.old_after[c]
    return best


@njit(cache=True, nogil=True)
def faces_near(net: Net, u: int, ring: Ints, count: int, held: Ints, have: int, p: Floats) -> bool:
    """Whether the faces about a vertex that moves to u lie near the first surface, by samples."""
    for j in range(count):
        a, b = ring[LEFT, j], ring[RIGHT, j]
        if a == u or b == u:
            continue
        for k in range(len(_WITHIN)):
            x, y, z = _WITHIN[k]
            for i in range(3):
                p[i] = (
                    x * net.at[u, PLACE + i] + y * net.at[a, PLACE + i] + z * net.at[b, PLACE + i]
                )
            if not _off_old(net, p, held, have) <= net.limit:
                return False
    return True


@njit(cache=True, nogil=True)
def _off_side(p: Floats, a: Floats, b: Floats) -> float:
    """Squared distance of a point from a side."""
    dot, size = 0.0, 0.0
    for i in range(3):
        dot += (p[i] - a[i]) * (b[i] - a[i])
        size += (b[i] - a[i]) ** 2
    t = min(max(dot / size, 0.0), 1.0) if size > 0.0 else 0.0
    d = 0.0
    for i in range(3):
        d += (p[i] - a[i] - t * (b[i] - a[i])) ** 2
    return d


@njit(cache=True, nogil=True)
def keeps_rim(net: Net, v: int) -> bool:
    """Whether the first border stays near the side that closes the gap where v was."""
    a, b = net.ids[v, BACK], net.ids[v, AHEAD]
    for way in range(2):
        w = v
        while w != (b if way == 0 else a):
            if not _off_side(_place(net, w), _place(net, a), _place(net, b)) <= net.limit:
                return False
            w = net.chain[way, w]
    return True
