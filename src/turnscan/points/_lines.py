"""The lines of a grid that have points: what is done to points need not look at all others.

A sensor has far more lines than a part covers. Lines beside those with points are taken along, so
that nothing ends at the border of what is taken which would not end there anyway.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Flags, Floats
from turnscan.points._grid import RangeGrid

_BESIDE = 16
"""Lines on either side; no kernel looks further along a profile than 12."""


def lines_about(seen: Bools) -> slice:
    """From the first line of which ``seen`` (n,) is True to the last, and some beside them."""
    at = np.flatnonzero(seen)
    if not len(at):
        return slice(0, 0)
    return slice(max(int(at[0]) - _BESIDE, 0), min(int(at[-1]) + 1 + _BESIDE, len(seen)))


def take_lines(grid: RangeGrid, lines: slice) -> RangeGrid:
    """The grid of these lines alone, numbered from 0; not of one that was resampled."""
    if lines == slice(0, grid.flags.shape[1]):
        return grid
    return replace(
        grid,
        points=grid.points[:, lines],
        sigma=grid.sigma[:, lines],
        amplitude=grid.amplitude[:, lines],
        flags=grid.flags[:, lines],
        behind=None if grid.behind is None else grid.behind[:, lines],
    )


def put_lines(part: RangeGrid, lines: slice, light: Floats, flags: Flags) -> RangeGrid:
    """The grid of all lines, which has points in these ``lines`` alone: those of ``part``.

    ``light`` and ``flags`` (s, n) are what is known of all others.
    """
    if part.flags.shape == flags.shape:
        return part

    def all_of(values: npt.NDArray[Any], empty: npt.NDArray[Any]) -> npt.NDArray[Any]:
        empty[:, lines] = values
        return empty

    behind = part.behind
    return replace(
        part,
        points=all_of(part.points, np.full((*flags.shape, 3), np.nan)),
        sigma=all_of(part.sigma, np.full(flags.shape, np.nan)),
        amplitude=all_of(part.amplitude, light.copy()),
        flags=all_of(part.flags, flags.copy()),
        behind=None if behind is None else all_of(behind, np.zeros(flags.shape, np.bool_)),
    )
