"""Compiled kernels of the edge collapse; imported only when they are used.

The faces about a vertex hang on it as a list of corners, 3f + i for corner i of face f: `head` is
the first one, `after` the next. A face that is gone has −1 for its first corner.
"""
# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from turnscan.surface._heap_kernels import drop, put

_WITHIN = (
    (1 / 3, 1 / 3, 1 / 3), (0.6, 0.2, 0.2), (0.2, 0.6, 0.2), (0.2, 0.2, 0.6),
    (0.5, 0.5, 0.0), (0.75, 0.25, 0.0), (0.25, 0.75, 0.0),
)  # fmt: skip
"""Places in a face at which it is compared with the first surface."""
_MOST = 64
"""Vertices with more neighbours than this stay where they are."""
_RIM = 10.0
"""Weight of the planes that hold a border, against the faces beside it."""
_EVEN = 1e-5
"""Weight of the distance itself against that from the planes: flat places are thinned evenly."""
_TURN = 0.3
"""Cosine: no face may turn further at once."""
_SLIM = 0.02
"""A face may become slimmer than this (1 is equilateral) only where it was slimmer before."""


class Net(NamedTuple):
    """A mesh whose vertices move into their neighbours, and what may not happen then."""

    points: Any
    """(v, 3) mm."""
    faces: Any
    """(f, 3)."""
    head: Any
    after: Any
    q: Any
    """(v, 10) quadrics."""
    own: Any
    """(v,) what those cost at the vertex itself."""
    locked: Any
    """(v,) True for vertices that stay."""
    chain: Any
    """(2, v) the next vertex along the first border, and the one before; −1 inside."""
    rim: Any
    """(2, v) the same along the border as it is now."""
    samples: Any
    """(m, 3) points of the first surface, its vertices before others; ``first`` (f,) and
    ``follow`` (m,) hang them on faces."""
    first: Any
    follow: Any
    old: Any
    """(f, 3) faces of the first surface; ``old_head`` (v,) and ``old_after`` (3f,) hang their
    corners on vertices."""
    old_head: Any
    old_after: Any
    limit: float
    """Squared mm: how far samples and border vertices may come to lie from faces and border, and
    faces from the first surface."""


class Queue(NamedTuple):
    """Vertices by what their cheapest move costs (`_heap_kernels`)."""

    heap: Any
    place: Any
    key: Any
    goal: Any
    """(v,) the neighbour that this move leads to; −1 for those that may not move."""


class Ring(NamedTuple):
    """Room for what is about one vertex: its corners, neighbours and their sides' faces, costs."""

    corners: Any
    near: Any
    seen: Any
    costs: Any


@njit(cache=True, nogil=True)
def _room() -> Any:
    return Ring(
        np.empty(_MOST, dtype=np.int32),
        np.empty(2 * _MOST, dtype=np.int32),
        np.empty(2 * _MOST, dtype=np.int32),
        np.empty(2 * _MOST),
    )


@njit(cache=True, nogil=True)
def lists(owners: Any, count: int) -> tuple[Any, Any]:
    """What hangs on each owner, as lists: ``first`` (count,) and ``follow`` (m,)."""
    first = np.full(count, -1, dtype=np.int32)
    follow = np.full(len(owners), -1, dtype=np.int32)
    for s in range(len(owners)):
        if owners[s] >= 0:
            follow[s] = first[owners[s]]
            first[owners[s]] = s
    return first, follow


@njit(cache=True, nogil=True)
def _add_plane(q: Any, a: float, b: float, c: float, d: float, w: float) -> None:
    q[0] += w * a * a
    q[1] += w * a * b
    q[2] += w * a * c
    q[3] += w * a * d
    q[4] += w * b * b
    q[5] += w * b * c
    q[6] += w * b * d
    q[7] += w * c * c
    q[8] += w * c * d
    q[9] += w * d * d


@njit(cache=True, nogil=True)
def _cost(q: Any, p: Any) -> float:
    """Weighted squared distance of a point from the planes of a quadric."""
    x, y, z = p[0], p[1], p[2]
    e = (
        x * (q[0] * x + 2.0 * (q[1] * y + q[2] * z + q[3]))
        + y * (q[4] * y + 2.0 * (q[5] * z + q[6]))
        + z * (q[7] * z + 2.0 * q[8])
        + q[9]
    )
    return max(e, 0.0)  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def _shape(p: Any, q: Any, r: Any, n: Any) -> float:
    """Write the normal (twice the area long); gives how even the face is, 1 for equilateral."""
    u0, u1, u2 = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    v0, v1, v2 = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    w0, w1, w2 = r[0] - q[0], r[1] - q[1], r[2] - q[2]
    n[0], n[1], n[2] = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    sides = u0 * u0 + u1 * u1 + u2 * u2 + v0 * v0 + v1 * v1 + v2 * v2 + w0 * w0 + w1 * w1 + w2 * w2
    twice = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    return 2.0 * np.sqrt(3.0) * twice / sides if sides > 0.0 else 0.0


@njit(cache=True, nogil=True)
def quadrics(points: Any, faces: Any, rim: Any) -> Any:
    """(v, 10) the planes about every vertex, faces by area (Garland & Heckbert 1997).

    ``rim`` (3f,) is True for sides on a border: a plane through it, upright on its face, keeps it.
    """
    out = np.zeros((len(points), 10))
    n = np.empty(3)
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        _shape(points[a], points[b], points[c], n)
        twice = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
        if not twice > 0.0:
            continue
        x, y, z = n[0] / twice, n[1] / twice, n[2] / twice
        d = -(x * points[a, 0] + y * points[a, 1] + z * points[a, 2])
        for i in range(3):
            p = faces[f, i]
            _add_plane(out[p], x, y, z, d, twice / 6.0)
            for axis in range(3):
                e = (
                    1.0 if axis == 0 else 0.0,
                    1.0 if axis == 1 else 0.0,
                    1.0 if axis == 2 else 0.0,
                )
                _add_plane(out[p], e[0], e[1], e[2], -points[p, axis], _EVEN * twice / 6.0)
            if rim[3 * f + i]:
                _hold_rim(points, out, p, faces[f, (i + 1) % 3], x, y, z)
    return out


@njit(cache=True, nogil=True)
def _hold_rim(points: Any, out: Any, p: int, o: int, x: float, y: float, z: float) -> None:
    """Add the plane through the side p-o, upright on the normal x, y, z, to both its ends."""
    e0, e1, e2 = (
        points[o, 0] - points[p, 0],
        points[o, 1] - points[p, 1],
        points[o, 2] - points[p, 2],
    )
    m0, m1, m2 = e1 * z - e2 * y, e2 * x - e0 * z, e0 * y - e1 * x
    size = np.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
    if size > 0.0:
        d = -(m0 * points[p, 0] + m1 * points[p, 1] + m2 * points[p, 2]) / size
        for v in (p, o):
            _add_plane(out[v], m0 / size, m1 / size, m2 / size, d, _RIM * size * size)


@njit(cache=True, nogil=True)
def _star(net: Any, v: int, corners: Any) -> int:
    """Write the live corners at a vertex, forget the dead ones; −1 where there are too many."""
    count, last = 0, -1
    c = net.head[v]
    while c >= 0:
        following = net.after[c]
        if net.faces[c // 3, 0] < 0:
            if last < 0:
                net.head[v] = following
            else:
                net.after[last] = following
        elif count == _MOST:
            return -1
        else:
            corners[count] = c
            count += 1
            last = c
        c = following
    return count


@njit(cache=True, nogil=True)
def _ends(faces: Any, corner: int) -> tuple[int, int]:
    """The other two corners of a face, in its winding."""
    f, i = corner // 3, corner % 3
    return faces[f, (i + 1) % 3], faces[f, (i + 2) % 3]


@njit(cache=True, nogil=True)
def _look(net: Any, v: int, ring: Any) -> tuple[int, int]:
    """Write corners, neighbours, and how many faces each side to them has; how many of either."""
    count = _star(net, v, ring.corners)
    if net.rim[0, v] < 0 and not net.locked[v]:
        # Inside of a manifold every neighbour is the first of the other two in one face.
        for i in range(count):
            ring.near[i], ring.seen[i] = _ends(net.faces, ring.corners[i])[0], 2
        return count, count
    have = 0
    for i in range(count):
        for w in _ends(net.faces, ring.corners[i]):
            j = 0
            while j < have and ring.near[j] != w:
                j += 1
            if j == have:
                ring.near[j], ring.seen[j] = w, 0
                have += 1
            ring.seen[j] += 1
    return count, have


@njit(cache=True, nogil=True)
def _price(net: Any, line: Any, v: int, ring: Any) -> tuple[int, int]:
    """Look about v and write what each of its moves costs, infinite where it may not be made.

    Gives how many corners and neighbours there are.
    """
    line.key[v], line.goal[v] = np.inf, -1
    if net.locked[v]:
        return 0, 0
    count, have = _look(net, v, ring)
    for i in range(have):
        u = ring.near[i]
        ring.costs[i] = np.inf
        # A border vertex moves along its border only.
        if net.rim[0, v] < 0 or ring.seen[i] == 1:
            ring.costs[i] = _cost(net.q[v], net.points[u]) + net.own[u]
            if ring.costs[i] < line.key[v]:
                line.key[v], line.goal[v] = ring.costs[i], u
    return count, have


@njit(cache=True, nogil=True)
def _wait(line: Any, size: int, v: int) -> int:
    """Put v where its key belongs, or take it out; gives the new size."""
    if line.goal[v] < 0:
        return drop(line.heap, line.place, line.key, size, v)  # type: ignore[no-any-return]
    return put(line.heap, line.place, line.key, size, v)  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def _wait_again(net: Any, line: Any, size: int, v: int, u: int, ring: Any, spare: Any) -> int:
    """Put u, that v has become, and its neighbours where they now belong; gives the new size.

    Of a neighbour's moves that to v is gone and that to u costs something else. The others cost
    what they did, so that inside the surface only those whose cheapest was one of the two have to
    be looked at as a whole.
    """
    _, near = _look(net, u, ring)
    _price(net, line, u, spare)
    size = _wait(line, size, u)
    for j in range(near):
        w = ring.near[j]
        goal = line.goal[w]
        if goal < 0 or goal in (v, u) or net.rim[0, w] >= 0:
            _price(net, line, w, spare)
        else:
            cost = _cost(net.q[w], net.points[u]) + net.own[u]
            if cost < line.key[w]:
                line.key[w], line.goal[w] = cost, u
            elif line.place[w] >= 0:
                continue
        size = _wait(line, size, w)
    return size


@njit(cache=True, nogil=True)
def _keeps_topology(
    faces: Any, mine: Any, count: int, have: int, u: int, shared: int, theirs: Any, others: int,
    near: int,
) -> bool:  # fmt: skip
    """Whether v may become u: the surface stays as it hangs together, and something of it stays.

    Both have no neighbours in common but those across from their side (Dey et al. 1999), and no
    face comes to lie on the back of another.
    """
    if count == shared and others == shared:
        return False
    common = 0
    for i in range(have):
        for j in range(near):
            common += mine.near[i] == theirs.near[j]
    if common != shared:
        return False
    for i in range(count):
        a, b = _ends(faces, mine.corners[i])
        if a == u or b == u:
            continue
        for j in range(others):
            c, d = _ends(faces, theirs.corners[j])
            if (a == c and b == d) or (a == d and b == c):
                return False
    return True


@njit(cache=True, nogil=True)
def _keeps_sides(net: Any, v: int, u: int, ring: Any, count: int, n: Any, m: Any) -> bool:
    """Whether no face turns over, or becomes a splinter, when its corner moves to u."""
    points = net.points
    for i in range(count):
        a, b = _ends(net.faces, ring.corners[i])
        if a == u or b == u:
            continue
        before = _shape(points[v], points[a], points[b], n)
        then = _shape(points[u], points[a], points[b], m)
        if then < _SLIM and then <= before:
            return False
        dot = n[0] * m[0] + n[1] * m[1] + n[2] * m[2]
        nn = n[0] * n[0] + n[1] * n[1] + n[2] * n[2]
        mm = m[0] * m[0] + m[1] * m[1] + m[2] * m[2]
        # A face without area has no side to keep.
        if nn > 0.0 and not dot > _TURN * np.sqrt(nn * mm):
            return False
    return True


@njit(cache=True, nogil=True)
def off_face(p: Any, a: Any, b: Any, c: Any) -> float:
    """Squared distance of a point from a triangle (Ericson 2005, §5.1.5)."""
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
        s = d1 / (d1 - d3)
    elif d6 >= 0.0 and d5 <= d6:
        s, t = 0.0, 1.0
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        t = d2 / (d2 - d6)
    elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        s = 1.0 - t
    else:
        total = va + vb + vc
        s, t = vb / total, vc / total
    x, y, z = ap0 - s * ab0 - t * ac0, ap1 - s * ab1 - t * ac1, ap2 - s * ab2 - t * ac2
    return x * x + y * y + z * z  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def _keeps_near(net: Any, u: int, ring: Any, count: int, held: Any, owner: Any) -> int:
    """Write the samples about a vertex that moves to u, and the face that each will hang on.

    Gives how many there are, −1 where one would lie too far from all of those faces.
    """
    have = 0
    for i in range(count):
        s = net.first[ring.corners[i] // 3]
        while s >= 0:
            best, at = np.inf, -1
            for j in range(count):
                a, b = _ends(net.faces, ring.corners[j])
                if a == u or b == u:
                    continue
                d = off_face(net.samples[s], net.points[u], net.points[a], net.points[b])
                if d < best:
                    best, at = d, ring.corners[j] // 3
            if have == len(held) or not best <= net.limit:
                return -1
            held[have], owner[have] = s, at
            have += 1
            s = net.follow[s]
    return have


@njit(cache=True, nogil=True)
def _off_old(net: Any, p: Any, held: Any, have: int) -> float:
    """Squared distance of a point from the first surface about the vertex of it that is nearest.

    Looked for among the samples ``held``; infinite where there is no vertex among them.
    """
    points = net.points
    nearest, best = -1, np.inf
    for i in range(have):
        s = held[i]
        if s < len(points):
            d = (p[0] - points[s, 0]) ** 2 + (p[1] - points[s, 1]) ** 2 + (p[2] - points[s, 2]) ** 2
            if d < best:
                nearest, best = s, d
    if nearest < 0:
        return best
    c = net.old_head[nearest]
    while c >= 0:
        a, b = _ends(net.old, c)
        best = min(best, off_face(p, points[nearest], points[a], points[b]))
        c = net.old_after[c]
    return best


@njit(cache=True, nogil=True)
def _faces_near(net: Any, u: int, ring: Any, count: int, held: Any, have: int, p: Any) -> bool:
    """Whether the faces about a vertex that moves to u lie near the first surface, by samples."""
    for j in range(count):
        a, b = _ends(net.faces, ring.corners[j])
        if a == u or b == u:
            continue
        for k in range(len(_WITHIN)):
            x, y, z = _WITHIN[k]
            for i in range(3):
                p[i] = x * net.points[u, i] + y * net.points[a, i] + z * net.points[b, i]
            if not _off_old(net, p, held, have) <= net.limit:
                return False
    return True


@njit(cache=True, nogil=True)
def _off_side(p: Any, a: Any, b: Any) -> float:
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
def _keeps_rim(net: Any, v: int) -> bool:
    """Whether the first border stays near the side that closes the gap where v was."""
    a, b = net.rim[1, v], net.rim[0, v]
    for way in range(2):
        w = v
        while w != (b if way == 0 else a):
            if not _off_side(net.points[w], net.points[a], net.points[b]) <= net.limit:
                return False
            w = net.chain[way, w]
    return True


@njit(cache=True, nogil=True)
def _move(net: Any, v: int, u: int, ring: Any, count: int, held: Any, owner: Any, hang: int) -> int:
    """v becomes u; gives how many faces vanish."""
    gone = 0
    for i in range(count):
        c = ring.corners[i]
        f = c // 3
        net.first[f] = -1
        a, b = _ends(net.faces, c)
        if a == u or b == u:
            net.faces[f, 0] = -1
            gone += 1
        else:
            net.faces[f, c % 3] = u
            net.after[c] = net.head[u]
            net.head[u] = c
    for i in range(hang):
        net.follow[held[i]] = net.first[owner[i]]
        net.first[owner[i]] = held[i]
    net.own[u] += _cost(net.q[v], net.points[u])
    for i in range(10):
        net.q[u, i] += net.q[v, i]
    if net.rim[0, v] >= 0:
        a, b = net.rim[1, v], net.rim[0, v]
        net.rim[0, a], net.rim[1, b] = b, a
    net.head[v] = -1
    return gone


@njit(cache=True, nogil=True)
def queue(net: Any) -> tuple[Any, int]:
    """All vertices that may move, the cheapest first, and how many."""
    mine = _room()
    total = len(net.points)
    line = Queue(
        heap=np.empty(total, dtype=np.int32),
        place=np.full(total, -1, dtype=np.int32),
        key=np.empty(total),
        goal=np.empty(total, dtype=np.int32),
    )
    size = 0
    for v in range(total):
        _price(net, line, v, mine)
        size = _wait(line, size, v)
    return line, size


@njit(cache=True, nogil=True)
def collapse(net: Any, line: Any, size: int, left: int, wanted: int, most: int) -> tuple[int, int]:
    """Move vertices into their neighbours, the cheapest first; the arrays of ``net`` change.

    ``size`` vertices stand in ``line`` and ``left`` faces are there. It ends at ``wanted`` faces,
    when no move is allowed, or after ``most`` vertices. Returns the new size and faces left.
    """
    mine, theirs = _room(), _room()
    held, owner = np.empty(1 << 14, dtype=np.int32), np.empty(1 << 14, dtype=np.int32)
    n, m = np.empty(3), np.empty(3)
    for _ in range(most):
        if size == 0 or left <= wanted:
            break
        v = line.heap[0]
        size = drop(line.heap, line.place, line.key, size, v)
        count, have = _price(net, line, v, mine)
        for _ in range(have):
            i = np.argmin(mine.costs[:have])
            if mine.costs[i] == np.inf:
                break
            mine.costs[i] = np.inf
            u = mine.near[i]
            others, near = _look(net, u, theirs)
            if others < 0 or count + others > _MOST:
                continue
            if not (
                _keeps_topology(net.faces, mine, count, have, u, mine.seen[i], theirs, others, near)
                and _keeps_sides(net, v, u, mine, count, n, m)
                and (net.rim[0, v] < 0 or net.limit == np.inf or _keeps_rim(net, v))
            ):
                continue
            hang = 0
            if net.limit < np.inf:
                hang = _keeps_near(net, u, mine, count, held, owner)
                if hang < 0 or not _faces_near(net, u, mine, count, held, hang, n):
                    continue
            left -= _move(net, v, u, mine, count, held, owner, hang)
            size = _wait_again(net, line, size, v, u, theirs, mine)
            break
    return size, left
