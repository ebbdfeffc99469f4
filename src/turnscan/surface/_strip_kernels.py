"""Compiled kernels of resampled profiles; imported only when they are used."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.compiled import njit


@njit(cache=True, nogil=True)
def used_vertices(faces: Ints, s: int, n: int) -> Bools:
    """(s, n, 4) True where the faces (f, 3) between profile k and the next, and between line j and
    the next, use the vertices (k, j), (k, j + 1), (k + 1, j) and (k + 1, j + 1) of their quad.
    """
    used = np.zeros((s, n, 4), dtype=np.bool_)
    for f in range(len(faces)):
        k, j = s, n
        last = False
        for i in range(3):
            step = faces[f, i] // n
            k, j = min(k, step), min(j, faces[f, i] % n)
            last |= step == s - 1
        if k == 0 and last and s > 2:
            k = s - 1
        for i in range(3):
            step, line = faces[f, i] // n, faces[f, i] % n
            used[k, j, 2 * (step != k) + (line != j)] = True
    return used


@njit(cache=True, nogil=True)
def _next_chain(used: Bools, j: int) -> tuple[int, int, int, int, int, int]:
    """The next chain of faces in a strip (n, 4), from quad ``j`` on.

    Gives its first and last quad, the lines at which its border begins and ends on the profile, and
    those on the next profile. The first quad is n where no chain is left.
    """
    n = len(used)
    while j < n and not (used[j, 0] or used[j, 1]):
        j += 1
    if j == n:
        return n, n, n, n, n, n
    last = j
    while last + 1 < n and (
        used[last, 1] and used[last, 3] and used[last + 1, 0] and used[last + 1, 2]
    ):
        last += 1
    begin = j if used[j, 0] else j + 1
    begin_next = j if used[j, 2] else j + 1
    end = last + 1 if used[last, 1] else last
    end_next = last + 1 if used[last, 3] else last
    return j, last, begin, end, begin_next, end_next


@njit(cache=True, nogil=True)
def joints(used: Bools) -> tuple[Bools, Bools]:
    """Where profiles are one with the line before, and which of their points end a chain of faces.

    Both (s, n); of the vertices (s, n, 4) that faces use, as `used_vertices` gives them.
    """
    s, n, _ = used.shape
    joined = np.zeros((s, n), dtype=np.bool_)
    ends = np.zeros((s, n), dtype=np.bool_)
    for k in range(s):
        k1 = (k + 1) % s
        j, last, begin, end, begin_next, end_next = _next_chain(used[k], 0)
        while j < n:
            ends[k, begin] = ends[k, end] = True
            ends[k1, begin_next] = ends[k1, end_next] = True
            for i in range(j, last + 1):
                joined[k, i + 1] |= used[k, i, 0] and used[k, i, 1]
                joined[k1, i + 1] |= used[k, i, 2] and used[k, i, 3]
            j, last, begin, end, begin_next, end_next = _next_chain(used[k], last + 1)
    return joined, ends


@njit(cache=True, nogil=True)
def zipped(points: Floats, lines: Floats, behind: Bools, used: Bools) -> Ints:
    """Faces (f, 3) of flat indices of resampled points (s, m, 3), one strip for each chain.

    ``lines`` (s, m) is the line of the original grid at which each lies, ascending, NaN where there
    is none; ``used`` (s, n, 4) that grid's `used_vertices`. A chain's border stays where it was.
    """
    s, m = lines.shape
    n = used.shape[1]
    faces = np.empty((2 * s * m, 3), dtype=np.int32)
    made = 0
    order = np.empty((s, m), dtype=np.int32)
    size = np.zeros(s, dtype=np.int64)
    for k in range(s):
        for i in range(m):
            if not np.isnan(lines[k, i]):
                order[k, size[k]] = i
                size[k] += 1
    for k in range(s):
        k1 = (k + 1) % s
        a, b = 0, 0
        j, last, begin, end, begin_next, end_next = _next_chain(used[k], 0)
        while j < n:
            a = _first(lines[k], order[k], size[k], a, begin)
            b = _first(lines[k1], order[k1], size[k1], b, begin_next)
            while True:
                more_a = a + 1 < size[k] and lines[k, order[k, a + 1]] <= end
                more_b = b + 1 < size[k1] and lines[k1, order[k1, b + 1]] <= end_next
                if not (more_a or more_b):
                    break
                x, y = k * m + order[k, a], k1 * m + order[k1, b]
                if more_a and (not more_b or _left(points, lines, order, k, k1, a, b)):
                    a += 1
                    z = k * m + order[k, a]
                    made = _face(faces, made, points, x, z, y, behind[k, order[k, a]])
                else:
                    b += 1
                    z = k1 * m + order[k1, b]
                    made = _face(faces, made, points, x, z, y, behind[k1, order[k1, b]])
            j, last, begin, end, begin_next, end_next = _next_chain(used[k], last + 1)
    return faces[:made].copy()


@njit(cache=True, nogil=True)
def _first(lines: Floats, order: Ints, size: int, at: int, line: int) -> int:
    """The first place from ``at`` on whose line is not before ``line``."""
    while at + 1 < size and lines[order[at]] < line:
        at += 1
    return at


@njit(cache=True, nogil=True)
def _left(points: Floats, lines: Floats, order: Ints, k: int, k1: int, a: int, b: int) -> bool:
    """Whether the strip goes on with the profile ``k``: its next point comes before the other's,
    or, where both come alike, makes the shorter edge."""
    near = lines[k, order[k, a + 1]] - lines[k1, order[k1, b + 1]]
    if abs(near) > 1e-9:
        return near < 0  # type: ignore[no-any-return]
    one = points[k, order[k, a + 1]] - points[k1, order[k1, b]]
    other = points[k, order[k, a]] - points[k1, order[k1, b + 1]]
    return (one * one).sum() <= (other * other).sum()  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def _face(faces: Ints, made: int, points: Floats, x: int, y: int, z: int, behind: bool) -> int:
    """Add a face whose three vertices are there; returns the number of faces made."""
    m = points.shape[1]
    for p in (x, y, z):
        if np.isnan(points[p // m, p % m, 0]):
            return made
    faces[made, 0] = x
    faces[made, 1] = z if behind else y
    faces[made, 2] = y if behind else z
    return made + 1
