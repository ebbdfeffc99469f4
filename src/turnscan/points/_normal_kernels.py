"""Compiled kernel of how the surface lies at each point of a grid; imported only when used."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.compiled import njit
from turnscan.points._wholeness_kernels import Vector, beside, cross, dot, way

_MOST = 12
"""Lines to either side that a tangent is taken over, at most."""
_ALL = 4
"""Normals about a point that has neighbours on all sides."""


@njit(cache=True, nogil=True)
def _tangents(
    points: Floats, doubt: Floats, k: int, j: int, least: float, out: Floats, unsure: Floats
) -> int:
    """Write the ways up and down a profile to the nearest points ``least`` mm off, and the most
    that these and those on the way are in doubt; how many."""
    n = points.shape[1]
    count = 0
    for sign in (1, -1):
        worst = 0.0
        for far in range(1, _MOST + 1):
            i = j + sign * far
            if i < 0 or i >= n or np.isnan(points[k, i, 0]):
                break
            worst = max(worst, doubt[k, i])
            gap = way(points, k, j, k, i)
            if np.sqrt(dot(gap, gap)) >= least:
                out[count, 0], out[count, 1], out[count, 2] = gap
                unsure[count] = worst
                count += 1
                break
    return count


@njit(cache=True, nogil=True)
def _across_of(a: Vector, unit: Vector) -> float:
    """How long the part of a vector is that is square to a unit one."""
    along = dot(a, unit)
    return float(np.sqrt(max(dot(a, a) - along * along, 0.0)))


@njit(cache=True, nogil=True)
def _share(up: Vector, across: Vector, move: Vector, unsure: tuple[float, float]) -> float:
    """Cosine between the unit vector ``move`` and the normal of two tangents; −1 without one.

    The ends of both may lie ``unsure`` mm off along ``move``. That changes nothing of the part of
    their vector product along it, and as much as they do of that across it: the largest cosine of
    all these counts.
    """
    normal = cross(up, across)
    size = np.sqrt(dot(normal, normal))
    if not size > 0.0:
        return -1.0
    along = abs(dot(normal, move))
    tilt = np.hypot(unsure[0] * _across_of(across, move), unsure[1] * _across_of(up, move))
    if tilt > 0.0:
        size = np.hypot(along, max(_across_of(normal, move) - tilt, 0.0))
    return along / size if size > 0.0 else 1.0


@njit(cache=True, nogil=True)
def seconds(
    points: Floats, moves: Floats, lag: int, span: tuple[int, int], out: tuple[Floats, Floats]
) -> None:
    """Write (s, n) mm: along ``moves`` (s, n, 3), the second differences of each profile, ``lag``
    lines apart, and how long the two chords are in the mean; NaN where a point is missing. For the
    steps of a ``span``."""
    n = points.shape[1]
    second, long = out
    for k in range(span[0], span[1]):
        for j in range(n):
            second[k, j] = np.nan
            if lag <= j < n - lag:
                up, down = way(points, k, j, k, j + lag), way(points, k, j, k, j - lag)
                move = (moves[k, j, 0], moves[k, j, 1], moves[k, j, 2])
                second[k, j] = dot(up, move) + dot(down, move)
                long[k, j] = 0.5 * (np.sqrt(dot(up, up)) + np.sqrt(dot(down, down)))


@njit(cache=True, nogil=True)
def bent(
    chords: tuple[Floats, Floats],
    noise: Floats,
    about: int,
    least: tuple[float, float],
    closed: bool,
    span: tuple[int, int],
    out: Bools,
) -> None:
    """Make (s, n) True where the mean of second differences over ``about`` profiles to either side
    is more than the first of ``least`` times what ``noise`` (s, n) mm of the points makes of it,
    and tilts the chords by more than the second; no less than half of the profiles must be there.
    ``chords`` as `seconds` writes them. For the steps of a ``span``."""
    second, long = chords
    s, n = second.shape
    total, count = np.empty(n), np.empty(n)
    for k in range(span[0], span[1]):
        total[:], count[:] = 0.0, 0.0
        for far in range(-about, about + 1):
            m = (k + far) % s if closed else k + far
            if 0 <= m < s:
                for j in range(n):  # a whole row at a time, which a processor does fastest
                    there = not np.isnan(second[m, j])
                    total[j] += second[m, j] if there else 0.0
                    count[j] += there
        for j in range(n):
            many, size = count[j], abs(total[j])
            if np.isnan(second[k, j]) or many <= about:
                continue
            sure = size > least[0] * noise[k, j] * np.sqrt(6.0 * many)
            out[k, j] = out[k, j] or (sure and size > least[1] * many * long[k, j])


@njit(cache=True, nogil=True)
def shares(
    points: Floats,
    doubt: Floats,
    moves: Floats,
    arc: Floats,
    limits: tuple[float, float],
    closed: bool,
    span: tuple[int, int],
    out: Floats,
) -> None:
    """Write the cosines (s, n) between the unit vectors ``moves`` (s, n, 3) and the normal.

    The tangents lead to the nearest points of the same profile, and of the same line, that lie
    ``limits[0]`` mm off or more: shorter ones are noise. ``arc`` (s, n) mm is the usual way to the
    next step. ``doubt`` (s, n) mm is how far points may lie off along ``moves`` by more than noise.
    Up and down, before and after have normals of their own. Where all four are there and differ by
    no more than noise makes, or a round part, ``limits[1]`` rad, the normal of the neighbours alone
    counts: one through the point itself turns away from where its error leads, the more the larger
    that is.
    Elsewhere the largest does, so that an edge claims no more than the worse of its two surfaces.
    1 where nothing is known. A surface that turns away from the light has long steps: over those a
    line that leads straight on tells, too.
    Steps from the first to before the second of ``span`` are written.
    """
    least, tilt = limits
    n = points.shape[1]
    ups, unsure = np.empty((2, 3)), np.zeros(2)
    for k in range(span[0], span[1]):
        for j in range(n):
            out[k, j] = 1.0
            if np.isnan(points[k, j, 0]):
                continue
            lines = _tangents(points, doubt, k, j, least, ups, unsure)
            move, own = (moves[k, j, 0], moves[k, j, 1], moves[k, j, 2]), doubt[k, j]
            best, low, high, total, count = -1.0, 2.0, -1.0, 0.0, 0
            past, beyond = (0.0, 0.0, 0.0), 0.0
            for sign in (1, -1):
                m, far = beside(points, k, j, sign, arc, least, closed, True)
                if not far:
                    continue
                v = way(points, k, j, m, j)
                past = (past[0] + sign * v[0], past[1] + sign * v[1], past[2] + sign * v[2])
                beyond = np.hypot(beyond, doubt[m, j])
                for i in range(lines):
                    up, ends = (ups[i, 0], ups[i, 1], ups[i, 2]), np.hypot(own, unsure[i])
                    share = _share(up, v, move, (0.0, 0.0))
                    if share >= 0.0:
                        high, low = max(high, share), min(low, share)
                        total, count = total + share, count + 1
                        best = max(best, _share(up, v, move, (ends, np.hypot(own, doubt[m, j]))))
            if count:
                mean = min(total / count, 1.0)
                even = high - low <= tilt * np.sqrt(1.0 - mean * mean)
                out[k, j] = best
                if count == _ALL and even:
                    up = (ups[0, 0] - ups[1, 0], ups[0, 1] - ups[1, 1], ups[0, 2] - ups[1, 2])
                    middle = _share(up, past, move, (np.hypot(unsure[0], unsure[1]), beyond))
                    out[k, j] = middle if middle >= 0.0 else best
