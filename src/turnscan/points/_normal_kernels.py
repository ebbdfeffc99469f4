"""Compiled kernel of how the surface lies at each point of a grid; imported only when used."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bools, Floats, Longs, Singles
from turnscan.compiled import njit
from turnscan.points._wholeness_kernels import (
    Vector,
    beside,
    cross,
    dot,
    less,
    ray_of,
    vector,
    way,
)

_MOST = 12
"""Lines to either side that a tangent is taken over, at most."""
_ALL = 4
"""Normals about a point that has neighbours on all sides."""
_RUN = 8
"""Lines to either side, at most, over which a profile tells its direction."""
_STRAIGHT = 0.8
"""Cosine of the bend up to which it does: across a jump it leads along no surface."""
_ON = 2.0
"""Sigma by which a point may lie off a line that it is on."""


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
def by_width(
    places: tuple[Floats, Floats, Floats, Floats],
    walk: Floats,
    wider: float,
    span: tuple[int, int],
    out: Floats,
) -> None:
    """Write the largest cosine (s, n) between the way along which a centre's error moves its point
    and the normals of the two surfaces through its profile on which a pixel leads ``walk`` (s, n)
    mm away from the sheet, or ``wider`` times as far; NaN where nothing is known. ``places`` are
    points (s, n, 3) mm, the camera (s, 3) mm, ∂X/∂u (s, n, 3) mm and the sheet's normals (s, n, 3).
    For the steps of a ``span``."""
    points, eyes, moves, sheets = places
    for k in range(span[0], span[1]):
        for j in range(points.shape[1]):
            out[k, j] = np.nan
            if not walk[k, j] > 0.0:
                continue
            low, high = _run_of(points, k, j)
            before, after = way(points, k, low, k, j), way(points, k, j, k, high)
            size = np.sqrt(dot(before, before) * dot(after, after))
            if not dot(before, after) > _STRAIGHT * size:
                continue
            up, sheet = less(after, before, -1.0), vector(sheets, k, j)
            ray, move = ray_of(points, eyes, k, j), vector(moves, k, j)
            past = dot(sheet, ray)
            if past == 0.0:
                continue  # the camera is in the sheet
            along = less(move, ray, dot(sheet, move) / past)
            size = np.sqrt(dot(along, along))
            best = 0.0
            for part in (1.0, -1.0, wider, -wider):
                on = less(move, ray, (dot(sheet, move) + part * walk[k, j]) / past)
                normal = cross(up, on)
                long = np.sqrt(dot(normal, normal)) * size
                best = max(best, abs(dot(normal, along)) / long if long > 0.0 else 1.0)
            out[k, j] = min(best, 1.0)


@njit(cache=True, nogil=True)
def _run_of(points: Floats, k: int, j: int) -> tuple[int, int]:
    """The lines of the last points of a run about one, no more than `_RUN` lines off."""
    low = high = j
    if not np.isnan(points[k, j, 0]):
        while low > max(0, j - _RUN) and not np.isnan(points[k, low - 1, 0]):
            low -= 1
        while high < min(points.shape[1] - 1, j + _RUN) and not np.isnan(points[k, high + 1, 0]):
            high += 1
    return low, high


@njit(cache=True, nogil=True)
def _runs_on(
    points: Floats, sigma: Floats, step: tuple[int, int, int], j: int, move: Vector
) -> bool:
    """Whether a point of the first ``step`` lies on the line of those of the same line in the other
    two, as far as noise tells; it moves along the unit vector ``move``."""
    k, m, o = step
    v, on = way(points, k, j, m, j), way(points, m, j, o, j)
    long, size = np.sqrt(dot(on, on)), np.sqrt(dot(v, v))
    if not (long > 0.0 and dot(v, on) > 0.0):
        return False
    unit, share = (on[0] / long, on[1] / long, on[2] / long), size / long
    off = np.hypot(sigma[m, j] * (1.0 + share), sigma[o, j] * share)
    off = np.hypot(off, sigma[k, j] * _across_of(move, unit))
    return bool(_across_of(v, unit) < _ON * off)


@njit(cache=True, nogil=True)
def _one_side(
    points: Floats,
    sigma: Floats,
    arc: Floats,
    at: tuple[int, int],
    near: Longs,
    move: Vector,
    least: float,
    closed: bool,
) -> int:
    """0 or 1: the one side on which a point at a step and line goes on the line of those ``near``
    (2,) it, by their steps, and beyond, if it does on one alone; else −1."""
    k, j = at
    found = -1
    for hand in range(2):
        m = near[hand]
        if m < 0:
            continue
        o, there = beside(points, m, j, 1 - 2 * hand, arc, least, closed, True)
        if there and _runs_on(points, sigma, (k, m, o), j, move):
            if found >= 0:
                return -1
            found = hand
    return found


@njit(cache=True, nogil=True)
def _asked(points: Floats, told: Singles, k: int, j: int) -> bool:
    """Whether what the width of a point's stripe tells is believed: the last of a run may be cut,
    whatever its width."""
    if np.isnan(told[k, j]) or not 0 < j < points.shape[1] - 1:
        return False
    return not (np.isnan(points[k, j - 1, 0]) or np.isnan(points[k, j + 1, 0]))


@njit(cache=True, nogil=True)
def shares(
    points: Floats,
    doubt: tuple[Floats, Floats],
    moves: Floats,
    told: Singles,
    arc: Floats,
    limits: tuple[float, float],
    closed: bool,
    span: tuple[int, int],
    out: Floats,
) -> None:
    """Write the cosines (s, n) between the unit vectors ``moves`` (s, n, 3) and the normal.

    The tangents lead to the nearest points of the same profile, and of the same line, that lie
    ``limits[0]`` mm off or more: shorter ones are noise. ``arc`` (s, n) mm is the usual way to the
    next step. ``doubt`` are (s, n) mm how far points may lie off along ``moves`` by more than noise
    and in all. Up and down, before and after have normals of their own. Where all four are there
    and differ by no more than noise makes, or a round part, ``limits[1]`` rad, the normal of the
    neighbours alone counts: one through the point itself turns away from where its error leads, the
    more the larger that is.
    Elsewhere the largest does, so that an edge claims no more than the worse of its two surfaces;
    of a point on the line of those on one side alone, that of this side, but no less than what is
    ``told`` (s, n) by the width of its stripe, NaN where that tells nothing. What is told counts
    where there is no neighbour, and 1 where nothing is. A surface that turns away from the light
    has long steps: over those a line that leads straight on tells, too.
    Steps from the first to before the second of ``span`` are written.
    """
    ups, unsure, side = np.empty((2, 3)), np.zeros(2), np.empty((2, 4))
    near = np.empty(2, np.int64)
    for k in range(span[0], span[1]):
        for j in range(points.shape[1]):
            out[k, j] = 1.0
            if np.isnan(points[k, j, 0]):
                continue
            lines = _tangents(points, doubt[0], k, j, limits[0], ups, unsure)
            move, past, beyond, count = vector(moves, k, j), (0.0, 0.0, 0.0), 0.0, 0
            for hand in range(2):
                sign = 1 - 2 * hand
                side[hand, 0], side[hand, 1], side[hand, 2], side[hand, 3] = 2.0, -1.0, 0.0, -1.0
                m, far = beside(points, k, j, sign, arc, limits[0], closed, True)
                near[hand] = m if far else -1
                if not far:
                    continue
                v = way(points, k, j, m, j)
                past = less(past, v, -sign)
                beyond = np.hypot(beyond, doubt[0][m, j])
                ends = doubt[0][k, j], doubt[0][m, j]
                count += _of_side(ups, unsure, lines, v, move, ends, side[hand])
            if not count:
                out[k, j] = told[k, j] if _asked(points, told, k, j) else 1.0
                continue
            least, most = min(side[0, 0], side[1, 0]), max(side[0, 1], side[1, 1])
            mean, best = min((side[0, 2] + side[1, 2]) / count, 1.0), max(side[0, 3], side[1, 3])
            even = most - least <= limits[1] * np.sqrt(1.0 - mean * mean)
            out[k, j] = best
            if count == _ALL and even:
                up = (ups[0, 0] - ups[1, 0], ups[0, 1] - ups[1, 1], ups[0, 2] - ups[1, 2])
                middle = _share(up, past, move, (np.hypot(unsure[0], unsure[1]), beyond))
                out[k, j] = middle if middle >= 0.0 else best
            elif _asked(points, told, k, j):
                hand = _one_side(points, doubt[1], arc, (k, j), near, move, limits[0], closed)
                if hand >= 0:
                    out[k, j] = min(best, max(side[hand, 3], told[k, j]))


@njit(cache=True, nogil=True)
def _of_side(
    ups: Floats,
    unsure: Floats,
    lines: int,
    across: Vector,
    move: Vector,
    doubt: tuple[float, float],
    out: Floats,
) -> int:
    """How many planes the first ``lines`` of ``ups`` make with the way ``across`` to a neighbour;
    into ``out`` (4,) the least cosine, the largest, the sum of all, and the largest with what the
    ends are in doubt. ``doubt`` are the point's and the neighbour's."""
    count = 0
    for i in range(lines):
        up = ups[i, 0], ups[i, 1], ups[i, 2]
        share = _share(up, across, move, (0.0, 0.0))
        if share < 0.0:
            continue
        ends = np.hypot(doubt[0], unsure[i]), np.hypot(doubt[0], doubt[1])
        out[0], out[1] = min(out[0], share), max(out[1], share)
        out[2], out[3] = out[2] + share, max(out[3], _share(up, across, move, ends))
        count += 1
    return count
