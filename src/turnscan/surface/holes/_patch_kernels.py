"""Compiled kernels of filling: a loop → triangles, refined and turned; imported when used.

A patch is `tri` (t, 3) corners and `beside` (t, 3), the triangle across the side from corner i to
the next, −1 on the border. Corners below ``m`` are those of the loop.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.compiled import njit


class Chords(NamedTuple):
    """Best triangles on the chords i to k of a loop: (m, m), and (m, m, 3) the last."""

    bend: Floats
    """How much they bend."""
    area: Floats
    """mm²."""
    apex: Ints
    """Third corner of the triangle on the chord, −1 for none."""
    normal: Floats
    """Unit normal of that triangle."""


@njit(cache=True, nogil=True)
def _normal(a: Floats, b: Floats, c: Floats, out: Floats) -> float:
    """Write the unit normal of a triangle; gives its area."""
    u0, u1, u2 = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    v0, v1, v2 = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    out[0] = u1 * v2 - u2 * v1
    out[1] = u2 * v0 - u0 * v2
    out[2] = u0 * v1 - u1 * v0
    twice = np.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
    if twice > 0.0:
        for i in range(3):
            out[i] /= twice
    return twice / 2.0  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def _bend(n: Floats, o: Floats) -> float:
    """1 − cos of the angle between two normals; 2 where a triangle has no area."""
    d = n[0] * o[0] + n[1] * o[1] + n[2] * o[2]
    size = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) * (o[0] * o[0] + o[1] * o[1] + o[2] * o[2])
    return 1.0 - d if size > 0.5 else 2.0


@njit(cache=True, nogil=True)
def span(points: Floats, outer: Floats, used: Bools, bent: bool) -> tuple[Ints, bool]:
    """A loop (m, 3) → (m − 2, 3) triangles that bend least, then have least area (Liepa 2003).

    Without ``bent`` the area alone counts (Barequet and Sharir 1995).

    ``outer`` (m, 3) is the far corner of the face beyond each side, so that bending is counted
    across the border too. ``used`` (m, m) forbids chords. False where none could avoid these.
    """
    m = len(points)
    bend = np.full((m, m), np.inf)
    area = np.zeros((m, m))
    apex = np.full((m, m), -1, dtype=np.int32)
    normal = np.zeros((m, m, 3))
    chords = Chords(bend, area, apex, normal)
    n = np.empty(3)
    for i in range(m - 1):
        bend[i, i + 1] = 0.0
        _normal(points[i], outer[i], points[i + 1], normal[i, i + 1])
    last = np.empty(3)
    _normal(points[0], points[m - 1], outer[m - 1], last)
    for width in range(2, m):
        for i in range(m - width):
            k = i + width
            whole = i == 0 and k == m - 1
            if used[i, k] and not whole:
                continue
            _best(points, i, k, chords, n, last, whole, bent)
    faces = np.empty((m - 2, 3), dtype=np.int32)
    if apex[0, m - 1] < 0:
        return faces, False
    _unroll(apex, faces)
    return faces, True


@njit(cache=True, nogil=True)
def _best(
    points: Floats,
    i: int,
    k: int,
    chords: Chords,
    n: Floats,
    last: Floats,
    whole: bool,
    bent: bool,
) -> None:
    """Find the best triangle on the chord from i to k, given those of all shorter chords."""
    bend, area, apex, normal = chords
    best_bend, best_area = np.inf, np.inf
    for j in range(i + 1, k):
        b = max(bend[i, j], bend[j, k])
        if not b < np.inf or b > best_bend:  # a chord that is forbidden, or spans nothing
            continue
        s = _normal(points[i], points[j], points[k], n)
        if bent:
            b = max(b, _bend(n, normal[i, j]), _bend(n, normal[j, k]))
            if whole:
                b = max(b, _bend(n, last))
        s += area[i, j] + area[j, k]
        if b < best_bend or (b == best_bend and s < best_area):
            best_bend, best_area = b, s
            apex[i, k] = j
            normal[i, k] = n
    bend[i, k], area[i, k] = best_bend, best_area


@njit(cache=True, nogil=True)
def _unroll(apex: Ints, faces: Ints) -> None:
    """Write the triangles that the chords' apexes stand for."""
    m = len(apex)
    stack = np.empty((m + 2, 2), dtype=np.int32)
    stack[0, 0], stack[0, 1] = 0, m - 1
    top, made = 1, 0
    while top > 0:
        top -= 1
        i, k = stack[top, 0], stack[top, 1]
        if k - i < 2:
            continue
        j = apex[i, k]
        faces[made, 0], faces[made, 1], faces[made, 2] = i, j, k
        made += 1
        stack[top, 0], stack[top, 1] = i, j
        stack[top + 1, 0], stack[top + 1, 1] = j, k
        top += 2


@njit(cache=True, nogil=True)
def lace(a: Floats, b: Floats) -> Ints:
    """Two loops (n, 3), (k, 3), side by side and against each other → (n + k, 3) triangles of
    least area between them; vertices of the second count from n. Corners 0 are joined.
    """
    n, k = len(a), len(b)
    cost = np.full((n + 1, k + 1), np.inf)
    along = np.zeros((n + 1, k + 1), dtype=np.bool_)
    out = np.empty(3)
    cost[0, 0] = 0.0
    for i in range(n + 1):
        for j in range(k + 1):
            if i > 0:
                s = cost[i - 1, j] + _normal(a[i - 1], a[i % n], b[-j % k], out)
                if s < cost[i, j]:
                    cost[i, j], along[i, j] = s, True
            if j > 0:
                s = cost[i, j - 1] + _normal(b[-j % k], b[-(j - 1) % k], a[i % n], out)
                if s < cost[i, j]:
                    cost[i, j], along[i, j] = s, False
    faces = np.empty((n + k, 3), dtype=np.int32)
    i, j = n, k
    for t in range(n + k - 1, -1, -1):
        if along[i, j]:
            faces[t, 0], faces[t, 1], faces[t, 2] = i - 1, i % n, n + (-j % k)
            i -= 1
        else:
            faces[t, 0], faces[t, 1], faces[t, 2] = n + (-j % k), n + (-(j - 1) % k), i % n
            j -= 1
    return faces


@njit(cache=True, nogil=True)
def _cosine(p: Floats, a: int, b: int, c: int) -> float:
    """Cosine of the angle at c between a and b; −1 where a side has no length."""
    dot, u, v = 0.0, 0.0, 0.0
    for i in range(3):
        x, y = p[a, i] - p[c, i], p[b, i] - p[c, i]
        dot += x * y
        u += x * x
        v += y * y
    return float(dot / np.sqrt(u * v)) if u > 0.0 and v > 0.0 else -1.0


@njit(cache=True, nogil=True)
def _joined(tri: Ints, beside: Ints, t: int, c: int, d: int) -> bool:
    """Whether the patch has a side between corners c (of triangle t) and d."""
    for forward in (True, False):
        at = t
        while True:
            k = 0
            while tri[at, k] != c:
                k += 1
            if tri[at, (k + 1) % 3] == d or tri[at, (k + 2) % 3] == d:
                return True
            at = beside[at, (k + 2) % 3] if forward else beside[at, k]
            if at == t:
                return False
            if at < 0:
                break
    return False


@njit(cache=True, nogil=True)
def _relink(beside: Ints, t: int, old: int, new: int) -> None:
    if t >= 0:
        for e in range(3):
            if beside[t, e] == old:
                beside[t, e] = new
                return


@njit(cache=True, nogil=True)
def _turn(
    p: Floats, tri: Ints, beside: Ints, t: int, e: int, m: int, used: Bools, n: Floats
) -> bool:
    """Turn the side e of triangle t where the other diagonal is better and allowed."""
    u = beside[t, e]
    if u < 0:
        return False
    a, b, c = tri[t, e], tri[t, (e + 1) % 3], tri[t, (e + 2) % 3]
    f = 0
    while not (tri[u, f] == b and tri[u, (f + 1) % 3] == a):
        f += 1
    d = tri[u, (f + 2) % 3]
    # The angles opposite the side make more than half a turn: it is not a Delaunay side.
    if not _cosine(p, a, b, c) + _cosine(p, a, b, d) < -1e-9:
        return False
    if c < m and d < m and used[c, d]:
        return False
    _normal(p[a], p[b], p[c], n[0])
    _normal(p[b], p[a], p[d], n[1])
    _normal(p[c], p[a], p[d], n[2])
    _normal(p[d], p[b], p[c], n[3])
    if _bend(n[2], n[3]) > max(0.3, _bend(n[0], n[1])):
        return False
    if c == d or _joined(tri, beside, t, c, d):
        return False
    ca, bc = beside[t, (e + 2) % 3], beside[t, (e + 1) % 3]
    ad, db = beside[u, (f + 1) % 3], beside[u, (f + 2) % 3]
    tri[t, 0], tri[t, 1], tri[t, 2] = c, a, d
    tri[u, 0], tri[u, 1], tri[u, 2] = d, b, c
    beside[t, 0], beside[t, 1], beside[t, 2] = ca, ad, u
    beside[u, 0], beside[u, 1], beside[u, 2] = db, bc, t
    _relink(beside, ad, u, t)
    _relink(beside, bc, t, u)
    return True


@njit(cache=True, nogil=True)
def relax(p: Floats, tri: Ints, beside: Ints, count: int, m: int, used: Bools) -> None:
    """Turn sides until all are Delaunay sides, as far as they may be turned."""
    n = np.empty((4, 3))
    for _ in range(50):
        turned = 0
        for t in range(count):
            for e in range(3):
                if _turn(p, tri, beside, t, e, m, used, n):
                    turned += 1
        if turned == 0:
            return


@njit(cache=True, nogil=True)
def refine(
    points: Floats, faces: Ints, across: Ints, scale: Floats, used: Bools, limit: int
) -> tuple[Floats, Ints]:
    """Points and triangles of a patch, as dense as its border (Liepa 2003, §4).

    ``across`` (t, 3) is the triangle across each side, −1: none. ``scale`` (m,) is the usual length
    of a side about each corner of the loop. A triangle takes a new corner in its middle while that
    lies further than the scale from its corners; after each round sides are turned. At most about
    ``limit`` corners are added.
    """
    m = len(points)
    room = m + limit + 1
    p = np.empty((room, 3))
    s = np.empty(room)
    p[:m], s[:m] = points, scale
    tri = np.empty((len(faces) + 2 * limit + 2, 3), dtype=np.int32)
    beside = np.full((len(faces) + 2 * limit + 2, 3), -1, dtype=np.int32)
    count, have = len(faces), m
    tri[:count] = faces
    beside[:count] = across
    relax(p, tri, beside, count, m, used)
    while True:
        before = count
        for t in range(before):
            if have >= room - 1:
                break
            a, b, c = tri[t, 0], tri[t, 1], tri[t, 2]
            middle = (p[a] + p[b] + p[c]) / 3.0
            size = (s[a] + s[b] + s[c]) / 3.0
            far = True
            for k in range(3):
                v = tri[t, k]
                d = np.sqrt(2.0 * ((p[v] - middle) ** 2).sum())
                far = far and d > size and d > s[v]
            if not far:
                continue
            v = have
            p[v], s[v] = middle, size
            have += 1
            t1, t2 = count, count + 1
            count += 2
            n0, n1, n2 = beside[t, 0], beside[t, 1], beside[t, 2]
            tri[t, 2] = v
            tri[t1, 0], tri[t1, 1], tri[t1, 2] = b, c, v
            tri[t2, 0], tri[t2, 1], tri[t2, 2] = c, a, v
            beside[t, 0], beside[t, 1], beside[t, 2] = n0, t1, t2
            beside[t1, 0], beside[t1, 1], beside[t1, 2] = n1, t2, t
            beside[t2, 0], beside[t2, 1], beside[t2, 2] = n2, t, t1
            _relink(beside, n1, t, t1)
            _relink(beside, n2, t, t2)
        if count == before:
            return p[:have].copy(), tri[:count].copy()
        relax(p, tri, beside, count, m, used)
