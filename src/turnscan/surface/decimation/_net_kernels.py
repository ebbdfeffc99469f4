"""Compiled kernels of the net in which edges collapse: what is about a vertex, and its quadric.

What is read together lies together: the numbers of a vertex in two lines of the processor's cache,
its links in half a line, a face with its three lists in half a line. The faces about a vertex hang
on it as a list of corners, 4f + i for corner i of face f: ``ids[v, HEAD]`` is the first one,
``tri[f, AFTER + i]`` the next. A face that is gone has −1 for its first vertex.
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
PLACE, OWN = 10, 13
"""Of the numbers of a vertex, after its quadric: where it is, mm, and what its quadric costs there.
"""
HEAD, LOCKED, AHEAD, BACK, FOLLOW, WAITS = 0, 1, 2, 3, 4, 5
"""Of the links of a vertex: its first corner; 1 where it stays; the next vertex along the border as
it is now, and the one before, −1 inside; who follows it in the queue; 1 where it waits there."""
SAMPLE, AFTER = 3, 4
"""Of a face, after its vertices: the first sample that hangs on it, and the corners that follow."""


class Net(NamedTuple):
    """A mesh whose vertices move into their neighbours, and what may not happen then."""

    at: Floats
    """(v, 16) numbers of the vertices: quadric, `PLACE`, `OWN`."""
    ids: Ints
    """(v, 8) links of the vertices, from `HEAD`."""
    tri: Ints
    """(f, 8) the faces: their vertices, `SAMPLE`, `AFTER`."""
    chain: Ints
    """(2, v) the next vertex along the first border, and the one before; −1 inside."""
    samples: Floats
    """(m, 3) points of the first surface, its vertices before others, hung on faces by ``follow``
    (m,)."""
    follow: Ints
    old: Ints
    """(f, 3) faces of the first surface; ``old_head`` (v,) and ``old_after`` (3f,) hang their
    corners, 3f + i, on vertices."""
    old_head: Ints
    old_after: Ints
    limit: float
    """Squared mm: how far samples and border vertices may come to lie from faces and border, and
    faces from the first surface."""


CORNER, LEFT, RIGHT, NEAR, SEEN = 0, 1, 2, 3, 4
"""Rows of what is about one vertex: its corners, the other two vertices of the face of each; its
neighbours, and how many faces the side to each has."""


@njit(cache=True, nogil=True)
def room() -> Ints:
    """For what is about one vertex; kernels that are called often take arrays, as a tuple of them
    has the references to each counted at each use."""
    return np.empty((5, 2 * MOST), dtype=np.int32)


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


@njit(cache=True, nogil=True, forceinline=True)
def _add_plane(at: Floats, v: int, a: float, b: float, c: float, d: float, w: float) -> None:
    at[v, 0] += w * a * a
    at[v, 1] += w * a * b
    at[v, 2] += w * a * c
    at[v, 3] += w * a * d
    at[v, 4] += w * b * b
    at[v, 5] += w * b * c
    at[v, 6] += w * b * d
    at[v, 7] += w * c * c
    at[v, 8] += w * c * d
    at[v, 9] += w * d * d


@njit(cache=True, nogil=True, forceinline=True)
def cost(at: Floats, v: int, u: int) -> float:
    """Weighted squared distance of the place of u from the planes of the quadric of v."""
    x, y, z = at[u, PLACE], at[u, PLACE + 1], at[u, PLACE + 2]
    e = (
        x * (at[v, 0] * x + 2.0 * (at[v, 1] * y + at[v, 2] * z + at[v, 3]))
        + y * (at[v, 4] * y + 2.0 * (at[v, 5] * z + at[v, 6]))
        + z * (at[v, 7] * z + 2.0 * at[v, 8])
        + at[v, 9]
    )
    return max(e, 0.0)  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def fill(at: Floats, ids: Ints, tri: Ints, faces: Ints, rim: Bools) -> None:
    """Write faces with their lists, and the planes about every vertex, faces by area.

    ``rim`` (3f,) is True for sides on a border: a plane through it, upright on its face, keeps it.
    (Garland & Heckbert 1997)
    """
    for f in range(len(faces)):
        tri[f, SAMPLE] = -1
        for i in range(3):
            p = faces[f, i]
            tri[f, i], tri[f, AFTER + i] = p, ids[p, HEAD]
            ids[p, HEAD] = 4 * f + i
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        x, y, z = _normal(at, a, b, c)
        twice = np.sqrt(x * x + y * y + z * z)
        if not twice > 0.0:
            continue
        x, y, z = x / twice, y / twice, z / twice
        d = -(x * at[a, PLACE] + y * at[a, PLACE + 1] + z * at[a, PLACE + 2])
        even = _EVEN * twice / 6.0
        for i in range(3):
            p = faces[f, i]
            _add_plane(at, p, x, y, z, d, twice / 6.0)
            _add_plane(at, p, 1.0, 0.0, 0.0, -at[p, PLACE], even)
            _add_plane(at, p, 0.0, 1.0, 0.0, -at[p, PLACE + 1], even)
            _add_plane(at, p, 0.0, 0.0, 1.0, -at[p, PLACE + 2], even)
            if rim[3 * f + i]:
                _hold_rim(at, p, faces[f, (i + 1) % 3], x, y, z)


@njit(cache=True, nogil=True, forceinline=True)
def _normal(at: Floats, a: int, b: int, c: int) -> tuple[float, float, float]:
    """Normal of a face, as long as twice its area."""
    x, y, z = at[a, PLACE], at[a, PLACE + 1], at[a, PLACE + 2]
    u0, u1, u2 = at[b, PLACE] - x, at[b, PLACE + 1] - y, at[b, PLACE + 2] - z
    v0, v1, v2 = at[c, PLACE] - x, at[c, PLACE + 1] - y, at[c, PLACE + 2] - z
    return u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0


@njit(cache=True, nogil=True)
def _hold_rim(at: Floats, p: int, o: int, x: float, y: float, z: float) -> None:
    """Add the plane through the side p-o, upright on the normal x, y, z, to both its ends."""
    e0, e1, e2 = (
        at[o, PLACE] - at[p, PLACE],
        at[o, PLACE + 1] - at[p, PLACE + 1],
        at[o, PLACE + 2] - at[p, PLACE + 2],
    )
    m0, m1, m2 = e1 * z - e2 * y, e2 * x - e0 * z, e0 * y - e1 * x
    size = np.sqrt(m0 * m0 + m1 * m1 + m2 * m2)
    if size > 0.0:
        d = -(m0 * at[p, PLACE] + m1 * at[p, PLACE + 1] + m2 * at[p, PLACE + 2]) / size
        for v in (p, o):
            _add_plane(at, v, m0 / size, m1 / size, m2 / size, d, _RIM * size * size)


@njit(cache=True, nogil=True, forceinline=True)
def look(ids: Ints, tri: Ints, v: int, ring: Ints) -> tuple[int, int]:
    """Write what is about a vertex; how many corners, −1 for too many, and neighbours.

    Corners of faces that are gone are forgotten.
    """
    count, last = 0, -1
    c = ids[v, HEAD]
    while c >= 0:
        f, i = c >> 2, c & 3
        following = tri[f, AFTER + i]
        if tri[f, 0] < 0:
            if last < 0:
                ids[v, HEAD] = following
            else:
                tri[last >> 2, AFTER + (last & 3)] = following
        elif count == MOST:
            return -1, 0
        else:
            ring[CORNER, count] = c
            ring[LEFT, count] = tri[f, i + 1 if i < 2 else 0]
            ring[RIGHT, count] = tri[f, i - 1 if i > 0 else 2]
            count += 1
            last = c
        c = following
    if ids[v, AHEAD] < 0 and ids[v, LOCKED] == 0:
        # Inside of a manifold every neighbour is the first of the other two in one face.
        for i in range(count):
            ring[NEAR, i], ring[SEEN, i] = ring[LEFT, i], 2
        return count, count
    have = 0
    for k in range(2 * count):
        w = ring[LEFT, k] if k < count else ring[RIGHT, k - count]
        j = 0
        while j < have and ring[NEAR, j] != w:
            j += 1
        if j == have:
            ring[NEAR, j], ring[SEEN, j] = w, 0
            have += 1
        ring[SEEN, j] += 1
    return count, have
