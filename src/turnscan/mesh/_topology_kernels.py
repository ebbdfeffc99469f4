"""Compiled kernels of borders and fans; imported only when they are used.

Side 3f + i runs from corner i of face f to the next, so it also names that corner.
"""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Ints, Longs
from turnscan.compiled import njit


@njit(cache=True, nogil=True)
def _next(h: int) -> int:
    return h - 2 if h % 3 == 2 else h + 1


@njit(cache=True, nogil=True)
def _before(h: int) -> int:
    return h + 2 if h % 3 == 0 else h - 1


@njit(cache=True, nogil=True)
def _ends(faces: Ints, count: int) -> tuple[Ints, Ints]:
    """Of every side the end at which fewer faces are, and the other; its complement if it is first.

    Of equal ends the one with the lower number.
    """
    many = np.zeros(count, dtype=np.int32)
    for f in range(len(faces)):
        for i in range(3):
            many[faces[f, i]] += 1
    home = np.empty(3 * len(faces), dtype=np.int32)
    code = np.empty(3 * len(faces), dtype=np.int32)
    for f in range(len(faces)):
        for i in range(3):
            a, b, h = faces[f, i], faces[f, (i + 1) % 3], 3 * f + i
            if many[a] < many[b] or (many[a] == many[b] and a < b):
                home[h], code[h] = a, b
            else:
                home[h], code[h] = b, ~a
    return home, code


@njit(cache=True, nogil=True)
def _hung(home: Ints, count: int) -> tuple[Ints, Ints]:
    """What hangs on each of ``count`` homes: where its numbers begin (count + 1,), and those."""
    start = np.zeros(count + 1, dtype=np.int32)
    for v in home:
        start[v + 1] += 1
    for v in range(count):
        start[v + 1] += start[v]
    fill = start[:-1].copy()
    numbers = np.empty(len(home), dtype=np.int32)
    for h in range(len(home)):
        numbers[fill[home[h]]] = h
        fill[home[h]] += 1
    return start, numbers


@njit(cache=True, nogil=True)
def opposite_half_edges(faces: Ints) -> Ints:
    """(3f,) the one side that runs the other way, −1 where there is none or several run either way.

    Each side hangs on that of its ends at which fewer sides are, so that no list of them gets
    long where many faces meet in one vertex (Chiba & Nishizeki 1985).
    """
    count = faces.max() + 1 if len(faces) else 0
    home, code = _ends(faces, count)
    start, kept = _hung(home, count)
    codes = code[kept]
    twin = np.full(len(home), -1, dtype=np.int32)
    for v in range(count):
        for at in range(start[v], start[v + 1]):
            same, back, other = 0, 0, at
            # A side from a vertex to itself is its own way back.
            wanted = codes[at] if codes[at] == ~v else ~codes[at]
            for near in range(start[v], start[v + 1]):
                same += codes[near] == codes[at]
                if codes[near] == wanted:
                    back += 1
                    other = near
            if same == 1 and back == 1:
                twin[kept[at]] = kept[other]
    return twin


@njit(cache=True, nogil=True)
def borders(faces: Ints, twin: Ints) -> tuple[Ints, Longs]:
    """The vertices of all borders in a row, and where each border begins."""
    count = 0
    for h in range(len(twin)):
        count += twin[h] < 0
    flat = np.empty(count, dtype=np.int32)
    starts = np.empty(count, dtype=np.int64)
    done = np.zeros(len(twin), dtype=np.bool_)
    made, loops = 0, 0
    for h in range(len(twin)):
        if twin[h] >= 0 or done[h]:
            continue
        starts[loops] = made
        loops += 1
        g = h
        while not done[g]:
            done[g] = True
            flat[made] = faces[g // 3, g % 3]
            made += 1
            g = _next(g)
            while twin[g] >= 0:
                g = _next(twin[g])
    return flat, starts[:loops].copy()


@njit(cache=True, nogil=True)
def fans(twin: Ints) -> tuple[Ints, Ints]:
    """(corners,) the fan of each corner, and (fans,) the first corner of each."""
    fan = np.full(len(twin), -1, dtype=np.int32)
    first = np.empty(len(twin), dtype=np.int32)
    made = 0
    for corner in range(len(twin)):
        if fan[corner] >= 0:
            continue
        first[made] = corner
        c = corner
        while c >= 0 and fan[c] < 0:
            fan[c] = made
            c = twin[_before(c)]
        c = twin[corner]
        while c >= 0 and fan[_next(c)] < 0:
            c = _next(c)
            fan[c] = made
            c = twin[c]
        made += 1
    return fan, first[:made].copy()


@njit(cache=True, nogil=True)
def _root(parent: Ints, v: int) -> int:
    while parent[v] != v:
        parent[v] = parent[parent[v]]
        v = parent[v]
    return v


@njit(cache=True, nogil=True)
def pieces(faces: Ints) -> Ints:
    """(f,) the connected piece of each face, numbered from 0 in the order of their first vertices.

    Each vertex leads to an earlier one of its piece, the first one to itself (Tarjan 1975).
    """
    count = faces.max() + 1 if len(faces) else 0
    parent = np.arange(count).astype(np.int32)
    for f in range(len(faces)):
        a = _root(parent, faces[f, 0])
        for i in range(1, 3):
            b = _root(parent, faces[f, i])
            if a < b:
                parent[b] = a
            else:
                parent[a] = b
                a = b
    out = np.empty(len(faces), np.int32)
    number = np.full(count, -1, np.int32)
    for f in range(len(faces)):
        out[f] = _root(parent, faces[f, 0])
        number[out[f]] = 0
    made = 0
    for v in range(count):
        if number[v] == 0:
            number[v] = made
            made += 1
    for f in range(len(faces)):
        out[f] = number[out[f]]
    return out


@njit(cache=True, nogil=True)
def diameter(points: Floats) -> float:
    """The largest distance between two of the points (m, 3)."""
    most = 0.0
    for i in range(len(points)):
        for j in range(i):
            d = 0.0
            for k in range(3):
                d += (points[i, k] - points[j, k]) ** 2
            most = max(most, d)
    return np.sqrt(most)  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def faces_about(faces: Ints, count: int) -> tuple[Longs, Ints]:
    """See `turnscan.mesh.faces_about`."""
    start = np.zeros(count + 1, dtype=np.int64)
    for f in range(len(faces)):
        for c in range(3):
            start[faces[f, c] + 1] += 1
    for v in range(count):
        start[v + 1] += start[v]
    fill = start[:-1].copy()
    numbers = np.empty(3 * len(faces), dtype=np.int32)
    for f in range(len(faces)):
        for c in range(3):
            v = faces[f, c]
            numbers[fill[v]] = f
            fill[v] += 1
    return start, numbers
