"""Compiled kernels of the net in which edges collapse: what is about a vertex, and its quadric.

The faces about a vertex hang on it as a list of corners, 3f + i for corner i of face f: `head` is
the first one, `after` the next. A face that is gone has −1 for its first corner.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.compiled import njit

MOST = 64
"""Vertices with more neighbours than this stay where they are."""
_RIM = 10.0
"""Weight of the planes that hold a border, against the faces beside it."""
_EVEN = 1e-5
"""Weight of the distance itself against that from the planes: flat places are thinned evenly."""


class Net(NamedTuple):
    """A mesh whose vertices move into their neighbours, and what may not happen then."""

    points: Floats
    """(v, 3) mm."""
    faces: Ints
    """(f, 3)."""
    head: Ints
    after: Ints
    q: Floats
    """(v, 10) quadrics."""
    own: Floats
    """(v,) what those cost at the vertex itself."""
    locked: Bools
    """(v,) True for vertices that stay."""
    chain: Ints
    """(2, v) the next vertex along the first border, and the one before; −1 inside."""
    rim: Ints
    """(2, v) the same along the border as it is now."""
    samples: Floats
    """(m, 3) points of the first surface, its vertices before others; ``first`` (f,) and
    ``follow`` (m,) hang them on faces."""
    first: Ints
    follow: Ints
    old: Ints
    """(f, 3) faces of the first surface; ``old_head`` (v,) and ``old_after`` (3f,) hang their
    corners on vertices."""
    old_head: Ints
    old_after: Ints
    limit: float
    """Squared mm: how far samples and border vertices may come to lie from faces and border, and
    faces from the first surface."""


class Ring(NamedTuple):
    """Room for what is about one vertex: its corners, neighbours and their sides' faces, costs."""

    corners: Ints
    near: Ints
    seen: Ints
    costs: Floats


@njit(cache=True, nogil=True)
def room() -> Ring:
    return Ring(
        np.empty(MOST, dtype=np.int32),
        np.empty(2 * MOST, dtype=np.int32),
        np.empty(2 * MOST, dtype=np.int32),
        np.empty(2 * MOST),
    )


@njit(cache=True, nogil=True)
def lists(owners: Ints, count: int) -> tuple[Ints, Ints]:
    """What hangs on each owner, as lists: ``first`` (count,) and ``follow`` (m,)."""
    first = np.full(count, -1, dtype=np.int32)
    follow = np.full(len(owners), -1, dtype=np.int32)
    for s in range(len(owners)):
        if owners[s] >= 0:
            follow[s] = first[owners[s]]
            first[owners[s]] = s
    return first, follow


@njit(cache=True, nogil=True)
def _add_plane(q: Floats, a: float, b: float, c: float, d: float, w: float) -> None:
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
def cost(q: Floats, p: Floats) -> float:
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
def shape(p: Floats, q: Floats, r: Floats, n: Floats) -> float:
    """Write the normal (twice the area long); gives how even the face is, 1 for equilateral."""
    u0, u1, u2 = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    v0, v1, v2 = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    w0, w1, w2 = r[0] - q[0], r[1] - q[1], r[2] - q[2]
    n[0], n[1], n[2] = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    sides = u0 * u0 + u1 * u1 + u2 * u2 + v0 * v0 + v1 * v1 + v2 * v2 + w0 * w0 + w1 * w1 + w2 * w2
    twice = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    return 2.0 * np.sqrt(3.0) * twice / sides if sides > 0.0 else 0.0


@njit(cache=True, nogil=True)
def quadrics(points: Floats, faces: Ints, rim: Bools) -> Floats:
    """(v, 10) the planes about every vertex, faces by area (Garland & Heckbert 1997).

    ``rim`` (3f,) is True for sides on a border: a plane through it, upright on its face, keeps it.
    """
    out = np.zeros((len(points), 10))
    n = np.empty(3)
    for f in range(len(faces)):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        shape(points[a], points[b], points[c], n)
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
def _hold_rim(points: Floats, out: Floats, p: int, o: int, x: float, y: float, z: float) -> None:
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
def _star(net: Net, v: int, corners: Ints) -> int:
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
        elif count == MOST:
            return -1
        else:
            corners[count] = c
            count += 1
            last = c
        c = following
    return count


@njit(cache=True, nogil=True)
def ends(faces: Ints, corner: int) -> tuple[int, int]:
    """The other two vertices of a face, in its winding."""
    f, i = corner // 3, corner % 3
    return faces[f, (i + 1) % 3], faces[f, (i + 2) % 3]


@njit(cache=True, nogil=True)
def look(net: Net, v: int, ring: Ring) -> tuple[int, int]:
    """Write corners, neighbours, and how many faces each side to them has; how many of either."""
    count = _star(net, v, ring.corners)
    if net.rim[0, v] < 0 and not net.locked[v]:
        # Inside of a manifold every neighbour is the first of the other two in one face.
        for i in range(count):
            ring.near[i], ring.seen[i] = ends(net.faces, ring.corners[i])[0], 2
        return count, count
    have = 0
    for i in range(count):
        for w in ends(net.faces, ring.corners[i]):
            j = 0
            while j < have and ring.near[j] != w:
                j += 1
            if j == have:
                ring.near[j], ring.seen[j] = w, 0
                have += 1
            ring.seen[j] += 1
    return count, have
