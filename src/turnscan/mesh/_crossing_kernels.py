"""Compiled kernels that find faces which cut through each other; imported only when used."""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, Longs, Singles
from turnscan.compiled import njit
from turnscan.mesh._tree_kernels import meet

_FLAT = 1e-12
"""Corners nearer to a plane than this share of a triangle's size lie in it."""
_STEEP = 1e-6
"""Square of the cosine of a face to the mean of those about a vertex, below which it stands on
edge."""


class Faces(NamedTuple):
    """Triangles, and a tree of boxes over them in which those are near that lie near."""

    vertices: Floats
    faces: Ints
    """(f, 3)."""
    asked: Bools
    """(f,) True for those of which one is in each pair that is looked for."""
    spans: Singles
    """Boxes of the triangles."""
    nodes: Singles
    """Boxes of a heap over them."""
    wanted: Bools
    """For each node whether it holds one that is asked for."""
    plain: Bools
    """(v,) True for vertices about which no two triangles cut each other (`plain_fans`)."""


@njit(cache=True, nogil=True)
def plain_fans(vertices: Floats, faces: Ints, twin: Ints) -> Bools:
    """(v,) True where the faces about a vertex are a ring that lies side by side, seen along the
    mean of their normals, so that no two of them have more in common than vertices and edges.

    ``twin`` (3 f,) is the half-edge opposite to each, -1 where there is none. The faces of a closed
    ring that all turn one way about the vertex go round it once where just one of them lies on any
    ray that leaves it.
    """
    mean = np.zeros(vertices.shape)
    for f in range(len(faces)):
        n = _normal(vertices, faces[f, 0], faces[f, 1], faces[f, 2])
        for k in range(3):
            for axis in range(3):
                mean[faces[f, k], axis] += n[axis]
    rounds = np.zeros(len(vertices), dtype=np.int32)
    plain = np.ones(len(vertices), dtype=np.bool_)
    for f in range(len(faces)):
        n = _normal(vertices, faces[f, 0], faces[f, 1], faces[f, 2])
        size = n[0] * n[0] + n[1] * n[1] + n[2] * n[2]
        for k in range(3):
            v = faces[f, k]
            m = mean[v]
            dot = n[0] * m[0] + n[1] * m[1] + n[2] * m[2]
            all_of = m[0] * m[0] + m[1] * m[1] + m[2] * m[2]
            faces_it = dot > 0.0 and dot * dot > _STEEP * size * all_of
            if not faces_it or twin[3 * f + k] < 0 or twin[3 * f + (k + 2) % 3] < 0:
                plain[v] = False
                continue
            leaves = _aside(vertices, m, v, faces[f, (k + 1) % 3]) >= 0.0
            rounds[v] += leaves & (_aside(vertices, m, v, faces[f, (k + 2) % 3]) < 0.0)
    return plain & (rounds == 1)


@njit(cache=True, nogil=True, inline="always")
def _normal(v: Floats, a: int, b: int, c: int) -> tuple[float, float, float]:
    """Of a triangle, twice its area long."""
    p0, p1, p2 = v[b, 0] - v[a, 0], v[b, 1] - v[a, 1], v[b, 2] - v[a, 2]
    q0, q1, q2 = v[c, 0] - v[a, 0], v[c, 1] - v[a, 1], v[c, 2] - v[a, 2]
    return p1 * q2 - q1 * p2, p2 * q0 - q2 * p0, p0 * q1 - q0 * p1


@njit(cache=True, nogil=True, inline="always")
def _aside(v: Floats, m: Floats, at: int, to: int) -> float:
    """On which side of an edge, seen along m, a ray lies that leaves the same vertex across m."""
    e0, e1, e2 = v[to, 0] - v[at, 0], v[to, 1] - v[at, 1], v[to, 2] - v[at, 2]
    # Of m and the axis that it leans least on, crossed, so that it is across m and not short.
    if abs(m[0]) <= abs(m[1]) and abs(m[0]) <= abs(m[2]):
        r0, r1, r2 = 0.0, m[2], -m[1]
    elif abs(m[1]) <= abs(m[2]):
        r0, r1, r2 = -m[2], 0.0, m[0]
    else:
        r0, r1, r2 = m[1], -m[0], 0.0
    a0, a1, a2 = e1 * r2 - e2 * r1, e2 * r0 - e0 * r2, e0 * r1 - e1 * r0
    return a0 * m[0] + a1 * m[1] + a2 * m[2]


@njit(cache=True, nogil=True)
def around(vertices: Floats, faces: Ints, asked: Bools) -> Ints:
    """The faces whose boxes meet the box of all those ``asked`` for (f,)."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for f in range(len(faces)):
        if asked[f]:
            for k in range(3):
                for axis in range(3):
                    low[axis] = min(low[axis], vertices[faces[f, k], axis])
                    high[axis] = max(high[axis], vertices[faces[f, k], axis])
    out = np.empty(len(faces), dtype=np.int32)
    have = 0
    for f in range(len(faces)):
        meets = True
        for axis in range(3):
            a = vertices[faces[f, 0], axis]
            b = vertices[faces[f, 1], axis]
            c = vertices[faces[f, 2], axis]
            meets = meets and min(a, b, c) <= high[axis] and max(a, b, c) >= low[axis]
        if meets:
            out[have] = f
            have += 1
    return out[:have].copy()


@njit(cache=True, nogil=True)
def as_they_come(vertices: Floats, faces: Ints, plain: Bools) -> tuple[Floats, Ints, Bools]:
    """The vertices (v, 3) that faces (f, 3) use, in the order in which they use them, the faces
    with their new numbers, and which of the vertices are ``plain``: what is read together lies
    together."""
    number = np.full(len(vertices), -1, dtype=np.int32)
    places, named, is_plain = np.empty_like(vertices), np.empty_like(faces), np.empty_like(plain)
    have = 0
    for f in range(len(faces)):
        for k in range(3):
            old = faces[f, k]
            if number[old] < 0:
                number[old] = have
                for axis in range(3):
                    places[have, axis] = vertices[old, axis]
                is_plain[have] = plain[old]
                have += 1
            named[f, k] = number[old]
    return places[:have], named, is_plain[:have]


@njit(cache=True, nogil=True)
def nodes_with(asked: Bools, leaves: int) -> Bools:
    """(2 · leaves,) True for the nodes that hold a triangle that is asked for."""
    count = len(asked)
    out = np.zeros(2 * leaves, dtype=np.bool_)
    for leaf in range(leaves):
        for f in range(leaf * count // leaves, (leaf + 1) * count // leaves):
            out[leaves + leaf] |= asked[f]
    for node in range(leaves - 1, 0, -1):
        out[node] = out[2 * node] or out[2 * node + 1]
    return out


@njit(cache=True, nogil=True)
def beginnings(nodes: Singles, wanted: Bools, least: int) -> Longs:
    """Pairs (k, 2) of nodes of one level that `crossings` may begin with: ``least`` of them, or so
    many as the leaves have."""
    leaves = len(nodes) // 2
    pairs = np.ones((1, 2), dtype=np.int64)
    while 0 < len(pairs) < least and pairs[0, 0] < leaves:
        below = np.empty((4 * len(pairs), 2), dtype=np.int64)
        have = 0
        for p in range(len(pairs)):
            last = _halves(below, have, pairs[p, 0], pairs[p, 1])
            for q in range(have, last):
                a, b = below[q, 0], below[q, 1]
                if (wanted[a] | wanted[b]) & meet(nodes, a, nodes, b):
                    below[have, 0], below[have, 1] = a, b
                    have += 1
        pairs = below[:have].copy()
    return pairs


@njit(cache=True, nogil=True)
def crossings(given: Faces, starts: Longs, most: int) -> Ints:
    """Pairs (k, 2) of triangles that have more in common than vertices and edges.

    No more than ``most`` of them, within the pairs of nodes ``starts`` (m, 2).
    The tree is laid against itself: pairs of nodes of one level, of which only those go on to their
    halves whose boxes meet, so that the work grows with the number of triangles.
    """
    vertices, faces, asked, spans, nodes, wanted, plain = given
    leaves, count = len(nodes) // 2, len(faces)
    found = np.empty((64, 2), dtype=np.int32)
    made = 0
    top = len(starts)
    stack = np.empty((256 + top, 2), dtype=np.int64)
    for p in range(top):
        stack[p, 0], stack[p, 1] = starts[p, 0], starts[p, 1]
    while top:
        top -= 1
        a, b = stack[top, 0], stack[top, 1]
        if not ((wanted[a] | wanted[b]) & meet(nodes, a, nodes, b)):
            continue
        if a < leaves:
            top = _halves(stack, top, a, b)
            continue
        first, last = (b - leaves) * count // leaves, (b - leaves + 1) * count // leaves
        for i in range((a - leaves) * count // leaves, (a - leaves + 1) * count // leaves):
            for j in range(max(i + 1, first), last):
                if not ((asked[i] | asked[j]) & meet(spans, i, spans, j)):
                    continue
                if _about_plain(faces, plain, i, j):
                    continue
                # The one that is asked for comes first, of two the first in order.
                p, q = (i, j) if asked[i] else (j, i)
                if not _cross(vertices, faces, p, q) or _apart(vertices, faces, p, q):
                    continue
                if made == len(found):
                    more = np.empty((2 * made, 2), dtype=np.int32)
                    more[:made] = found
                    found = more
                found[made, 0], found[made, 1] = p, q
                made += 1
                if made == most:
                    return found[:made].copy()
    return found[:made].copy()


@njit(cache=True, nogil=True)
def _halves(stack: Longs, top: int, a: int, b: int) -> int:
    """Put the pairs of halves of two nodes, or of one with itself, on the stack."""
    for i in range(2):
        for j in range(i if a == b else 0, 2):
            stack[top, 0], stack[top, 1] = 2 * a + i, 2 * b + j
            top += 1
    return top


@njit(cache=True, nogil=True)
def _apart(v: Floats, faces: Ints, i: int, j: int) -> bool:
    """Whether the boxes of two triangles do not meet."""
    a, b, c = faces[i, 0], faces[i, 1], faces[i, 2]
    p, q, r = faces[j, 0], faces[j, 1], faces[j, 2]
    for k in range(3):
        if min(v[a, k], v[b, k], v[c, k]) > max(v[p, k], v[q, k], v[r, k]):
            return True
        if min(v[p, k], v[q, k], v[r, k]) > max(v[a, k], v[b, k], v[c, k]):
            return True
    return False


@njit(cache=True, nogil=True, inline="always")
def _about_plain(faces: Ints, plain: Bools, i: int, j: int) -> bool:
    """Whether two triangles have a vertex in common about which none cut each other."""
    for k in range(3):
        v = faces[i, k]
        if ((v == faces[j, 0]) | (v == faces[j, 1]) | (v == faces[j, 2])) and plain[v]:
            return True
    return False


@njit(cache=True, nogil=True, inline="always")
def _off(v: Floats, x: int, n: tuple[float, float, float], origin: int) -> float:
    """Distance of vertex x from the plane with unit normal n through a vertex."""
    a = n[0] * (v[x, 0] - v[origin, 0])
    b = n[1] * (v[x, 1] - v[origin, 1])
    return a + b + n[2] * (v[x, 2] - v[origin, 2])


@njit(cache=True, nogil=True)
def _cross(v: Floats, faces: Ints, p: int, q: int) -> bool:
    """Whether triangles p and q cut through each other."""
    n, size = _plane(v, faces[p, 0], faces[p, 1], faces[p, 2])
    if not size > 0.0:
        return False
    a0, a1, a2 = faces[p, 0], faces[p, 1], faces[p, 2]
    b0, b1, b2 = faces[q, 0], faces[q, 1], faces[q, 2]
    same_0 = (b0 == a0) | (b0 == a1) | (b0 == a2)
    same_1 = (b1 == a0) | (b1 == a1) | (b1 == a2)
    same_2 = (b2 == a0) | (b2 == a1) | (b2 == a2)
    d0 = 0.0 if same_0 else _off(v, b0, n, a0)
    d1 = 0.0 if same_1 else _off(v, b1, n, a0)
    d2 = 0.0 if same_2 else _off(v, b2, n, a0)
    flat = _FLAT * size
    if max(abs(d0), abs(d1), abs(d2)) <= flat:
        return _overlap(v, faces[p], faces[q], n)
    if np.int64(same_0) + np.int64(same_1) + np.int64(same_2) > 1:
        return False  # every side of either touches the other
    if _on_one_side(same_0, same_1, same_2, d0, d1, d2, flat):
        return False
    shared_0 = (a0 == b0) | (a0 == b1) | (a0 == b2)
    shared_1 = (a1 == b0) | (a1 == b1) | (a1 == b2)
    shared_2 = (a2 == b0) | (a2 == b1) | (a2 == b2)
    e0, e1, e2 = 0.0, 0.0, 0.0
    m, other = _plane(v, b0, b1, b2)
    if other > 0.0:
        e0, e1, e2 = _off(v, a0, m, b0), _off(v, a1, m, b0), _off(v, a2, m, b0)
        # Most pairs end here: the plane of the one or of the other parts them.
        if _on_one_side(shared_0, shared_1, shared_2, e0, e1, e2, _FLAT * other):
            return False
    return (
        (d0 * d1 < 0.0 and not (same_0 | same_1) and _pierced(v, b0, b1, a0, a1, a2))
        or (d1 * d2 < 0.0 and not (same_1 | same_2) and _pierced(v, b1, b2, a0, a1, a2))
        or (d2 * d0 < 0.0 and not (same_2 | same_0) and _pierced(v, b2, b0, a0, a1, a2))
        or (e0 * e1 < 0.0 and not (shared_0 | shared_1) and _pierced(v, a0, a1, b0, b1, b2))
        or (e1 * e2 < 0.0 and not (shared_1 | shared_2) and _pierced(v, a1, a2, b0, b1, b2))
        or (e2 * e0 < 0.0 and not (shared_2 | shared_0) and _pierced(v, a2, a0, b0, b1, b2))
    )


@njit(cache=True, nogil=True, inline="always")
def _on_one_side(
    same_0: bool, same_1: bool, same_2: bool, d0: float, d1: float, d2: float, flat: float
) -> bool:
    """Whether vertices lie beyond doubt on one side of a plane, but for those in common with it."""
    above = (same_0 | (d0 > flat)) & (same_1 | (d1 > flat)) & (same_2 | (d2 > flat))
    below = (same_0 | (d0 < -flat)) & (same_1 | (d1 < -flat)) & (same_2 | (d2 < -flat))
    return above | below


@njit(cache=True, nogil=True, inline="always")
def _plane(v: Floats, a: int, b: int, c: int) -> tuple[tuple[float, float, float], float]:
    """The unit normal of a triangle and its longest side, 0 where there is no area."""
    n = _normal(v, a, b, c)
    longest = 0.0
    for p, q in ((a, b), (b, c), (c, a)):
        s0, s1, s2 = v[q, 0] - v[p, 0], v[q, 1] - v[p, 1], v[q, 2] - v[p, 2]
        longest = max(longest, s0 * s0 + s1 * s1 + s2 * s2)
    twice = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    if not twice > 1e-14 * longest:
        return n, 0.0
    return (n[0] / twice, n[1] / twice, n[2] / twice), np.sqrt(longest)


@njit(cache=True, nogil=True)
def _pierced(v: Floats, p: int, q: int, a: int, b: int, c: int) -> bool:
    """Whether the line from vertex p to q runs through a triangle; its plane parts them."""
    x = _volume(v, p, q, a, b)
    y = _volume(v, p, q, b, c)
    z = _volume(v, p, q, c, a)
    return (x >= 0.0 and y >= 0.0 and z >= 0.0) or (x <= 0.0 and y <= 0.0 and z <= 0.0)


@njit(cache=True, nogil=True, inline="always")
def _volume(v: Floats, p: int, q: int, a: int, b: int) -> float:
    """Six times the signed volume of the tetrahedron."""
    u0, u1, u2 = v[q, 0] - v[p, 0], v[q, 1] - v[p, 1], v[q, 2] - v[p, 2]
    v0, v1, v2 = v[a, 0] - v[p, 0], v[a, 1] - v[p, 1], v[a, 2] - v[p, 2]
    w0, w1, w2 = v[b, 0] - v[p, 0], v[b, 1] - v[p, 1], v[b, 2] - v[p, 2]
    return u0 * (v1 * w2 - v2 * w1) + u1 * (v2 * w0 - v0 * w2) + u2 * (v0 * w1 - v1 * w0)


@njit(cache=True, nogil=True)
def _overlap(v: Floats, of_a: Ints, of_b: Ints, n: tuple[float, float, float]) -> bool:
    """Whether triangles in one plane of normal n overlap: no side of either parts them."""
    k = 0
    for i in range(1, 3):
        if abs(n[i]) > abs(n[k]):
            k = i
    x, y = (k + 1) % 3, (k + 2) % 3
    return not (_parted(v, of_a, of_b, x, y) or _parted(v, of_b, of_a, x, y))


@njit(cache=True, nogil=True)
def _parted(v: Floats, of_a: Ints, of_b: Ints, x: int, y: int) -> bool:
    for i in range(3):
        p, q, o = v[of_a[i]], v[of_a[(i + 1) % 3]], v[of_a[(i + 2) % 3]]
        ux, uy = q[x] - p[x], q[y] - p[y]
        inside = ux * (o[y] - p[y]) - uy * (o[x] - p[x])
        outside = True
        for k in range(3):
            r = v[of_b[k]]
            side = ux * (r[y] - p[y]) - uy * (r[x] - p[x])
            outside = outside and side * inside <= 1e-12 * inside * inside
        if outside:
            return True
    return False
