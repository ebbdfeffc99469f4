"""The table of marching cubes, derived rather than typed: no holes, no side with three faces."""

from __future__ import annotations

from functools import cache
from itertools import combinations

import numpy as np
import numpy.typing as npt

Index = npt.NDArray[np.int64]

CORNERS: Index = np.array([[c & 1, c >> 1 & 1, c >> 2 & 1] for c in range(8)])
"""(8, 3) vertices of the cube, voxels."""


def _edges() -> Index:
    out = []
    for a, b in combinations(range(8), 2):
        apart = np.flatnonzero(CORNERS[a] != CORNERS[b])
        if len(apart) == 1:
            out.append((a, b, int(apart[0])))
    return np.array(out)


EDGES: Index = _edges()
"""(12, 3) lower corner, upper corner and axis of each edge."""
_EDGE_OF = {(int(a), int(b)): e for e, (a, b, _) in enumerate(EDGES)}
_EDGE_OF |= {(b, a): e for (a, b), e in list(_EDGE_OF.items())}


def _sides() -> list[tuple[int, ...]]:
    """The six sides: their four corners in order, counter-clockwise seen from outside."""
    out = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for level in (0, 1):
            ring = []
            for du, dv in ((0, 0), (1, 0), (1, 1), (0, 1)):
                place = [0, 0, 0]
                place[axis], place[u], place[v] = level, du, dv
                ring.append(place[0] + 2 * place[1] + 4 * place[2])
            out.append(tuple(ring if level else ring[::-1]))
    return out


_SIDES = _sides()
_ON = [{e for e, (a, b, _) in enumerate(EDGES) if {int(a), int(b)} <= set(s)} for s in _SIDES]


def _loops(case: int) -> list[list[int]]:
    """Closed loops of edges that the surface crosses; outside (bit 0) lies to their front.

    On a side with two corners inside that face each other, each is cut off by itself. That hangs
    on the side alone, so the cube beyond it does the same and no crack opens.
    """
    after = {}
    for ring in _SIDES:
        inside = [bool(case >> c & 1) for c in ring]
        for i in range(4):
            # A corner run inside begins here: the line leaves where it ends.
            if inside[i] and not inside[i - 1]:
                j = i
                while inside[(j + 1) % 4]:
                    j += 1
                enter = _EDGE_OF[ring[i - 1], ring[i]]
                leave = _EDGE_OF[ring[j % 4], ring[(j + 1) % 4]]
                after[enter] = leave
    loops = []
    while after:
        first, here = next(iter(after.items()))
        del after[first]
        loop = [first]
        while here != first:
            loop.append(here)
            here = after.pop(here)
        loops.append(loop)
    return loops


def _cut(loop: list[int]) -> list[tuple[int, int, int]] | None:
    """Triangles of a loop of which no inner side lies in a side of the cube.

    There the cube beyond could make the same side, and it would have four faces.
    """
    if len(loop) == 3:
        return [(loop[0], loop[1], loop[2])]
    for i in range(len(loop)):
        a, b, c = loop[i - 1], loop[i], loop[(i + 1) % len(loop)]
        if any(a in on and c in on for on in _ON):
            continue
        rest = _cut([e for e in loop if e != b])
        if rest is not None:
            return [(a, b, c), *rest]
    return None


@cache
def table() -> tuple[npt.NDArray[np.int8], npt.NDArray[np.int8]]:
    """Triangles (256, most, 3) as edge numbers for every pattern of corners inside, and how many.

    Bit c of the pattern is set where corner c is inside (negative). Faces run counter-clockwise
    seen from outside (Lorensen & Cline 1987; sides cut alike from both cubes).
    """
    cases = []
    for case in range(256):
        faces: list[tuple[int, int, int]] = []
        for loop in _loops(case):
            cut = _cut(loop)
            if cut is None:
                raise ArithmeticError(f"case {case} of marching cubes has no triangulation")
            faces += cut
        cases.append(faces)
    sizes = np.array([len(f) for f in cases], dtype=np.int8)
    out = np.zeros((256, int(sizes.max()), 3), dtype=np.int8)
    for case, faces in enumerate(cases):
        if faces:
            out[case, : len(faces)] = faces
    return out, sizes
