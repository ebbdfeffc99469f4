"""Compiled kernels of points that lie where profiles beside lead straight on; imported only when
they are used."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.compiled import njit
from turnscan.points._wholeness_kernels import LINKED, dot, way

Off = tuple[float, float, float]
"""px along which a point is off a way on, px by which that would bend, and variance of where it
leads, in those of a point."""
_REACH = 12
"""Profiles to one side that are looked at, at most."""
_FEWEST = 4
"""Points that tell where a line leads, at least."""
_FURTHER = 2.0
"""Lengths of such a line that it is believed beyond its end."""
_ODD = 2.0
"""Times what points of a stretch scatter by, beyond which one of them is unlike the others."""
_UP = 4
"""Lines to either side that tell how a profile runs."""


@njit(cache=True, nogil=True)
def bounded(
    off: Floats, noise: Floats, asked: Bools, lines: tuple[int, int], span: tuple[int, int],
    out: Floats,
) -> None:  # fmt: skip
    """How far, px, points are off at most as those about them on their profile are: the median of
    ``off`` (3, 2, k, n) over so many ``lines`` to either side and what it is uncertain by, with
    what their way bends by, and what they scatter by beyond ``noise`` (s, n) and that of the way.

    Of both directions the one that says less, and nothing of a point that is unlike those about
    it. Writes into ``out`` (s, n), full of NaN, for the steps of a ``span``, where it is ``asked``
    (s, n) and the least of ``lines`` tell.
    """
    n, (reach, fewest) = off.shape[3], lines
    some, bend, unsure = np.empty((3, 2 * reach + 1))
    for k in range(span[0], span[1]):
        for j in range(n):
            for hand in range(2):
                here = off[:, hand, k - span[0]]
                if not asked[k, j] or np.isnan(here[0, j]):
                    continue
                count = 0
                for i in range(max(0, j - reach), min(n, j + reach + 1)):
                    if not np.isnan(here[0, i]):
                        some[count], bend[count], unsure[count] = here[:, i]
                        count += 1
                if count < fewest:
                    continue
                middle = np.median(some[:count])
                scatter = 1.4826 * np.median(np.abs(some[:count] - middle))
                if abs(here[0, j] - middle) > _ODD * scatter:
                    continue
                sure = 1.2533 * scatter / np.sqrt(count)
                most = np.hypot(middle, sure) + abs(np.median(bend[:count]))
                parts = 1.0 + np.median(unsure[:count])
                more = scatter * scatter - parts * noise[k, j] * noise[k, j]
                most = np.sqrt(most * most + max(more, 0.0))
                if not out[k, j] <= most:
                    out[k, j] = most


@njit(cache=True, nogil=True)
def off_straight(
    points: Floats, along: Floats, arcs: Floats, sure: Bools, asked: Bools, closed: bool,
    span: tuple[int, int], out: Floats,
) -> None:  # fmt: skip
    """How far each point lies off the straight way on from the profiles before, and after, it.

    ``along`` (s, n, 3) mm is how a centre that is off by one pixel moves its point, ``arcs``
    (s, n) mm the usual way to the next step, ``sure`` (s, n) True for the points that may tell, and
    ``asked`` (s, n) for those of which it is wanted.
    Writes into ``out`` (3, 2, k, n), full of NaN, for the k steps of a ``span``: px that is, px by
    which the way would bend until there, as it does further back, and its variance (`Off`).
    """
    n, some = points.shape[1], np.empty((_REACH, 3))
    for k in range(span[0], span[1]):
        for j in range(n):
            if np.isnan(points[k, j, 0]) or not asked[k, j]:
                continue
            for hand in range(2):
                sign = 2 * hand - 1
                count = _sure_ones(points, arcs, sure, k, j, sign, closed, some)
                if count < _FEWEST:
                    continue
                out[:, hand, k - span[0], j] = _off(points, along, k, j, some[:count])


@njit(cache=True, nogil=True)
def _sure_ones(
    points: Floats, arcs: Floats, sure: Bools, k: int, j: int, sign: int, closed: bool,
    some: Floats,
) -> int:  # fmt: skip
    """How many points of the line to one side are sure, which ``some`` begins with, the nearest
    first; as far as each is linked to the one before."""
    s, count, m = len(points), 0, k
    for _ in range(_REACH):
        before, m = m, m + sign
        if closed:
            m %= s
        if m < 0 or m >= s or m == k:
            break
        gap = way(points, before, j, m, j)
        if not np.sqrt(dot(gap, gap)) <= LINKED * arcs[before, j]:
            break
        if sure[m, j]:
            some[count] = points[m, j]
            count += 1
    return count


@njit(cache=True, nogil=True)
def _off(points: Floats, along: Floats, k: int, j: int, some: Floats) -> Off:
    """How far a point lies off the way on from ``some`` (m, 3), and what is known of that; NaN
    where they do not tell."""
    n, part = points.shape[1], max(len(some) // 3, 1)
    near, middle, far = np.zeros(3), np.zeros(3), np.zeros(3)
    half = (len(some) - part) // 2
    for i in range(part):
        near += some[i] / part
        middle += some[half + i] / part
        far += some[len(some) - 1 - i] / part
    low, high = j, j
    while low > max(0, j - _UP) and not np.isnan(points[k, low - 1, 0]):
        low -= 1
    while high < min(n - 1, j + _UP) and not np.isnan(points[k, high + 1, 0]):
        high += 1
    line, here = near - far, points[k, j] - near
    square = (line * line).sum()
    ahead = (here * line).sum() / max(square, 1e-12)
    back = ((near - middle) * line).sum() / max(square, 1e-12)
    if low == high or not (0.0 < ahead <= _FURTHER and 0.0 < back < 1.0):
        return np.nan, np.nan, np.nan
    normal = np.cross(points[k, high] - points[k, low], line)
    lean = (normal * along[k, j]).sum()
    if lean == 0.0:
        return np.nan, np.nan, np.nan
    # A parabola through all three, which is straight where the middle lies between the others.
    sagitta = (normal * (near - middle)).sum()
    bend = sagitta * ahead * (ahead + 1.0) / (back * (1.0 - back))
    unsure = ((1.0 + ahead) ** 2 + ahead**2) / part
    return (normal * here).sum() / lean, bend / lean, unsure
