"""Compiled kernel of how the surface lies at each point of a grid; imported only when used."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.compiled import njit
from turnscan.points._wholeness_kernels import Vector, beside, cross, dot, way

_MOST = 12
"""Lines to either side that a tangent is taken over, at most."""
_TILT = 0.2
"""rad that noise makes the normals about a point differ by, over the shortest tangents."""
_ALL = 4
"""Normals about a point that has neighbours on all sides."""


@njit(cache=True, nogil=True)
def _tangents(points: Floats, k: int, j: int, least: float, out: Floats) -> int:
    """Write the ways up and down a profile to the nearest points ``least`` mm off; how many."""
    n = points.shape[1]
    count = 0
    for sign in (1, -1):
        for far in range(1, _MOST + 1):
            i = j + sign * far
            if i < 0 or i >= n or np.isnan(points[k, i, 0]):
                break
            gap = way(points, k, j, k, i)
            if np.sqrt(dot(gap, gap)) >= least:
                out[count, 0], out[count, 1], out[count, 2] = gap
                count += 1
                break
    return count


@njit(cache=True, nogil=True)
def _share(up: Vector, across: Vector, move: Vector) -> float:
    """Cosine between the unit vector ``move`` and the normal of two tangents; −1 without one."""
    normal = cross(up, across)
    size = np.sqrt(dot(normal, normal))
    return abs(dot(normal, move)) / size if size > 0.0 else -1.0


@njit(cache=True, nogil=True)
def shares(
    points: Floats,
    moves: Floats,
    arc: Floats,
    least: float,
    closed: bool,
    span: tuple[int, int],
    out: Floats,
) -> None:
    """Write the cosines (s, n) between the unit vectors ``moves`` (s, n, 3) and the normal.

    The tangents lead to the nearest points of the same profile, and of the same line, that lie
    ``least`` mm off or more: shorter ones are noise. ``arc`` (s, n) mm is the usual way to the next
    step. Up and down, before and after have normals of their own. Where all four are there and
    noise may have made all their differences, the normal of the neighbours alone counts: one
    through the point itself turns away from where its error leads, the more the larger that is.
    Elsewhere the largest does, so that an edge claims no more than the worse of its two surfaces.
    1 where nothing is known.
    Steps from the first to before the second of ``span`` are written.
    """
    n = points.shape[1]
    ups = np.empty((2, 3))
    for k in range(span[0], span[1]):
        for j in range(n):
            out[k, j] = 1.0
            if np.isnan(points[k, j, 0]):
                continue
            lines = _tangents(points, k, j, least, ups)
            move = (moves[k, j, 0], moves[k, j, 1], moves[k, j, 2])
            best, low, total, count = -1.0, 2.0, 0.0, 0
            past = (0.0, 0.0, 0.0)
            for sign in (1, -1):
                m, far = beside(points, k, j, sign, arc, least, closed)
                if not far:
                    continue
                v = way(points, k, j, m, j)
                past = (past[0] + sign * v[0], past[1] + sign * v[1], past[2] + sign * v[2])
                for i in range(lines):
                    share = _share((ups[i, 0], ups[i, 1], ups[i, 2]), v, move)
                    if share >= 0.0:
                        best, low = max(best, share), min(low, share)
                        total, count = total + share, count + 1
            if count:
                mean = min(total / count, 1.0)
                even = best - low <= _TILT * np.sqrt(1.0 - mean * mean)
                out[k, j] = best
                if count == _ALL and even:
                    up = (ups[0, 0] - ups[1, 0], ups[0, 1] - ups[1, 1], ups[0, 2] - ups[1, 2])
                    middle = _share(up, past, move)
                    out[k, j] = middle if middle >= 0.0 else best
