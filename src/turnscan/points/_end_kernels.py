"""Compiled kernels of stripes near an end of what is seen: how wide they are beside those further
in; imported only when they are used."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.compiled import njit
from turnscan.points._wholeness_kernels import LINKED, Pair, Places, dot, ray_of, vector, way

_CUT_OFF, _MOST_IN = 2.0, 6
"""Thicknesses of the sheet beside an end of what is seen within which something may cut a stripe,
and points that are looked at for an end, at most."""
_ALONG = 4.0
"""Usual ways that two points of a profile may lie apart on one surface."""
_TAIL = 3.0
"""Thicknesses of the sheet beyond its middle as far as a tail of its light is seen."""


@njit(cache=True, nogil=True)
def _next_on_surface(
    places: Places, limits: Pair, at: tuple[int, int], axis: int, sign: int, closed: bool
) -> tuple[int, int]:
    """The next place of a grid in a direction, if its point may lie on one surface with that at
    (step, line), or in the tail of its stripe; else (−1, −1).

    Where a near surface ends, its tail is seen on it while the sheet passes on, and its points move
    along the ray. They lie as far beside it as the sheet is thick. ``limits``, mm: how far apart
    along a profile, and how thick the sheet is as far as its tails reach.
    """
    points, eyes, sheets, arc = places
    (s, n, _), (k, j) = points.shape, at
    m, i = (k + sign, j) if axis == 0 else (k, j + sign)
    if closed:
        m %= s
    if m < 0 or m >= s or i < 0 or i >= n:
        return -1, -1
    gap = way(points, k, j, m, i)
    size = np.sqrt(dot(gap, gap))
    if axis == 1:
        return (m, i) if size <= limits[0] else (-1, -1)
    ray = ray_of(points, eyes, k, j)
    far = np.sqrt(dot(ray, ray))
    along = abs(dot(gap, ray)) / far
    lean = abs(dot(vector(sheets, k, j), ray)) / far
    aside = np.sqrt(max(size * size - along * along, 0.0))
    linked = max(LINKED * max(arc[k, j], arc[m, i]), limits[1] / _TAIL)
    goes_on = aside <= linked and along <= max(linked, limits[1] / max(lean, 1e-9))
    return (m, i) if goes_on else (-1, -1)


@njit(cache=True, nogil=True)
def _ends_within(
    places: Places, limits: Pair, at: tuple[int, int], axis: int, sign: int, closed: bool,
    reach: int,
) -> bool:  # fmt: skip
    """Whether what is seen ends in a direction, fewer than ``reach`` points on."""
    for _ in range(reach):
        at = _next_on_surface(places, limits, at, axis, sign, closed)
        if at[0] < 0:
            return True
    return False


@njit(cache=True, nogil=True)
def _width_further_in(
    places: Places, limits: Pair, at: tuple[int, int], axis: int, sign: int, closed: bool,
    reach: int, width: Floats,
) -> float:  # fmt: skip
    """The median width of the points ``reach`` places on, and one and two more; NaN for none."""
    some, count = np.empty(3), 0
    for far in range(1, reach + 3):
        at = _next_on_surface(places, limits, at, axis, sign, closed)
        if at[0] < 0:
            break
        if far >= reach and not np.isnan(width[at]):
            some[count] = width[at]
            count += 1
    return np.median(some[:count]) if count else np.nan


@njit(cache=True, nogil=True)
def _on_line(
    places: Places, limits: Pair, at: tuple[int, int], closed: bool, width: Floats
) -> float:
    """The median of a width and those before and after it on its line."""
    some, count = np.empty(3), 1
    some[0] = width[at]
    for sign in (1, -1):
        beside = _next_on_surface(places, limits, at, 0, sign, closed)
        if beside[0] >= 0 and not np.isnan(width[beside]):
            some[count] = width[beside]
            count += 1
    return np.median(some[:count])


@njit(cache=True, nogil=True)
def whole_widths(
    places: Places,
    widths: tuple[Floats, Floats],
    still: Bools,
    sizes: Pair,
    closed: bool,
    span: tuple[int, int],
    out: Floats,
) -> None:
    """How wide stripes are near an end of what is seen, and how wide those further in.

    ``widths`` two times (s, n) px are those of single stripes, and those of `steady`. Of points
    that no turn moves, ``still`` (s, n), the profiles before and after tell nothing. ``sizes`` mm:
    how far apart points of a profile usually are, and how thick the sheet is. Ends are looked for
    along lines and along profiles as far as two thicknesses, and not further than `_MOST_IN`
    points; beyond that three points inwards have a median width. Writes both widths of the
    direction in which they differ most into ``out`` (2, s, n) px, full of NaN, for the steps of a
    ``span``.
    """
    (apart, thickness), (width, steadied) = sizes, widths
    for k in range(span[0], span[1]):
        for j in range(width.shape[1]):
            at = (k, j)
            if np.isnan(places[0][k, j, 0]):
                continue
            limits = (_ALONG * apart, _TAIL * thickness)
            for axis in range(2):
                if axis == 0 and still[at]:
                    continue
                step = places[3][at] if axis == 0 else apart
                if step > _CUT_OFF * thickness:  # what is further in is no longer the same surface
                    continue
                steps = np.ceil(_CUT_OFF * thickness / max(step, 1e-9))
                reach = int(min(max(steps, 2.0), _MOST_IN))
                for sign in (1, -1):
                    if not _ends_within(places, limits, at, axis, sign, closed, reach):
                        continue
                    whole = _width_further_in(
                        places, limits, at, axis, -sign, closed, reach, steadied
                    )
                    own = steadied[at]
                    if axis == 1:  # along the profile a median would even its end out
                        own = _on_line(places, limits, at, closed, width)
                    if whole > 0.0 and not out[1, k, j] * own >= out[0, k, j] * whole:
                        out[0, k, j], out[1, k, j] = own, whole
