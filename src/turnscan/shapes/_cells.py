"""Cells of a surface: whether neighbouring points are off together, and means over them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Ints

_CELL = 25
"""Points of a cell, about."""
_LEAST, _CELLS = 15, 8
"""Points that a cell must have, and cells that a shape must have."""
_JOINED, _LARGER = 1.75, 4
"""Points that are off together from which cells are so many times larger."""
_PART = 3
"""Points that an eighth of a cell's cube must have to tell whether neighbours are off together."""


@dataclass(frozen=True)
class Cells:
    """Points in cubes of equal size."""

    number: Ints
    """(n,) the cell of each point; −1 in a cell of too few points."""
    side: float
    """mm."""
    together: float
    """Neighbours that are off together, about; 1 where each is off by itself."""

    def __len__(self) -> int:
        return int(self.number.max(initial=-1)) + 1


def shared_noise(points: Floats, residual: Floats, area: float) -> float:
    """How many points (n, 3) mm of an ``area`` (mm²) are off together, as their residuals (n,) off
    a shape show, in any unit: so many times the variance has what is fitted to them. 1 where each
    is off by itself, and where there are too few to tell.

    A merge that averages leaves vertices that share measurements, and so does what differs from
    profile to profile.
    """
    cells = cells_of(points, residual, area)
    return 1.0 if cells is None else cells.together


def cells_of(points: Floats, residual: Floats, area: float) -> Cells | None:
    """The cells of points (n, 3) mm that cover an ``area`` (mm²); None where there are too few.

    ``residual`` (n,) mm, of each point, tells whether neighbours are off together.
    """
    if len(points) < _CELL * _CELLS or not area > 0:
        return None
    cells = _cut(points, residual, float(np.sqrt(_CELL * area / len(points))), _LEAST)
    if len(cells) < _CELLS:
        return None
    if cells.together > _JOINED:
        side = cells.side * float(np.sqrt(_LARGER))
        larger = _cut(points, residual, side, _LEAST * _LARGER)
        if len(larger) >= _CELLS:
            return larger
    return cells


def _cut(points: Floats, residual: Floats, side: float, least: int) -> Cells:
    """Cells of a side with ``least`` points each, and how many neighbours are off together.

    The means of the halves of a cell, each way, scatter about the cell's so many times more than
    those of points by themselves would. What neighbours share reaches over the borders of halves:
    K(n) = K∞ (1 − c/√n) of n points, so that of a whole cell it is 3/2 of that of its halves less
    1/2 of that of their halves, which is 1 at least.
    """
    number = full_enough(_keys(points, side), least)
    on = number >= 0
    if not on.any():
        return Cells(number, side, 1.0)
    cell, off = number[on], residual[on]
    count = np.bincount(cell)
    off = off - (np.bincount(cell, off) / count)[cell]
    variance = float(off @ off) / max(int((count - 1).sum()), 1)
    first, part, many = np.unique(
        _keys(points, side, 2)[on], return_index=True, return_inverse=True, return_counts=True
    )[1:]
    part = part.ravel()
    mean = np.bincount(part, off) / many
    due = variance * (1 / many - 1 / count[cell[first]])
    told = many >= _PART
    if not due[told].sum() > 0:
        return Cells(number, side, 1.0)
    halves = float((mean[told] ** 2).sum() / due[told].sum())
    return Cells(number, side, max(1.0, 1.5 * halves - 0.5))


def _keys(points: Floats, side: float, parts: int = 1) -> npt.NDArray[np.int64]:
    """(n,) a number for the cube of a side (mm), or the part of it each way, of each point."""
    at = np.floor((points - points.min(axis=0)) * (parts / side)).astype(np.int64)
    wide = at.max(axis=0) + 1
    return np.asarray((at[:, 0] * wide[1] + at[:, 1]) * wide[2] + at[:, 2])


def full_enough(keys: npt.NDArray[np.int64], least: int) -> Ints:
    """(n,) cells by their keys, numbered from 0; −1 for those of fewer than ``least`` points."""
    cell, count = np.unique(keys, return_inverse=True, return_counts=True)[1:]
    good = count >= least
    number = np.where(good, np.cumsum(good) - 1, -1)
    return np.asarray(number[cell.ravel()], dtype=np.int32)


def cell_means(cell: Ints, off: Floats, together: float = 1.0) -> tuple[Floats, Floats]:
    """Means (c,) of the values (n,) in each cell, and the scatter (c,) that noise leaves them.

    The noise of a point is that of all cells together, for 15 points do not tell their own well;
    so many are off ``together``.
    """
    on = cell >= 0
    cell, off = cell[on], off[on]
    if not len(cell):
        return np.zeros(0), np.zeros(0)
    count = np.bincount(cell)
    mean = np.bincount(cell, off) / count
    square = np.bincount(cell, off * off) - count * mean**2
    variance = max(float(square.sum()), 0.0) / max(int((count - 1).sum()), 1)
    return mean, np.sqrt(together * variance / count)
