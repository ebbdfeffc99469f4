"""Form errors of shapes: how flat or round a part is, apart from the noise of its points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh import Mesh
from turnscan.shapes.primitives._shapes import Kind, ShapeSet
from turnscan.shapes.verification._statistics import noise_range

FormKind = Literal[
    "flatness", "sphericity", "cylindricity", "conicity", "torus form",
    "roundness", "parallelism", "perpendicularity", "run-out", "total run-out",
]  # fmt: skip
FORMS: dict[Kind, FormKind] = {
    "plane": "flatness",
    "sphere": "sphericity",
    "cylinder": "cylindricity",
    "cone": "conicity",
    "torus": "torus form",
}
CELL = 25
"""Points of a cell, about."""
_LEAST, CELLS = 15, 8
"""Points that a cell must have, and cells that a shape must have."""
_SURE = 4.0
"""Standard deviations by which a form error must be more than that of noise."""
_DOUBTFUL = 1.5
"""Times the usual sigma: what is known worse was bent by an edge, neighbours alike."""
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


@dataclass(frozen=True)
class FormError:
    """The width of the zone that holds a surface or an axis, as far as noise lets it show: about
    the shape itself (form), or square, parallel or coaxial to another one (ISO 1101)."""

    kind: FormKind
    shape: int
    """Index of the shape."""
    value: float
    """mm from the lowest to the highest mean of a cell of neighbouring points, off the
    least-squares shape or along the zone; of an axis how far it leans over its length."""
    noise: float
    """mm that chance makes of a perfect shape, on average: independent noise of the points, and
    what is not known of both directions or axes."""
    sigma: float
    """mm: the standard uncertainty that these leave."""
    cells: int
    """How many cells there are; 0 of an axis."""
    side: float
    """mm: side of a cell, as narrower waves of the surface are averaged out; of an axis its
    length."""
    datum: int | None = None
    """Index of the shape that gives the zone its direction or axis; None for a form."""

    @property
    def shown(self) -> bool:
        """Whether it is more than noise: four standard deviations, as ranges have long tails."""
        return self.value > self.noise + _SURE * self.sigma


def form_errors(mesh: Mesh, found: ShapeSet) -> tuple[FormError, ...]:
    """The form error of each shape that has enough points.

    Means over cells of about 25 points stand for the surface, since the range of single points is
    that of their noise. What noise alone gives is the expected range of those means, each with the
    scatter that its own number of points leaves it (`noise_range`). Points that are known worse
    than usual do not count, and neighbours that are off together, as a merge of several lasers
    leaves them, count as fewer and make larger cells (`cells_of`).
    """
    out = list[FormError]()
    known = well_known(mesh, found)
    for k, s in enumerate(found.shapes):
        member = np.flatnonzero(known & (found.label == k))
        cells = cells_of(mesh.vertices[member], found.residual[member], s.area)
        if cells is None:
            continue
        mean, scatter = cell_means(cells.number, found.residual[member], cells.together)
        noise, sigma = noise_range(scatter)
        value = float(np.ptp(mean))
        out.append(FormError(FORMS[s.kind], k, value, noise, sigma, len(mean), cells.side))
    return tuple(out)


def well_known(mesh: Mesh, found: ShapeSet) -> Bools:
    """(v,) True for the vertices that shapes were fitted to and that are known as well as usual."""
    used = np.array(found.used)
    if mesh.provenance is not None:
        sigma = mesh.provenance.sigma
        usual = float(np.nanmedian(sigma[used])) if np.isfinite(sigma[used]).any() else np.nan
        used &= ~(sigma > _DOUBTFUL * usual)
    return used


def cells_of(points: Floats, residual: Floats, area: float) -> Cells | None:
    """The cells of points (n, 3) mm that cover an ``area`` (mm²); None where there are too few.

    ``residual`` (n,) mm, of each point, tells whether neighbours are off together.
    """
    if len(points) < CELL * CELLS:
        return None
    cells = _cut(points, residual, float(np.sqrt(CELL * area / len(points))), _LEAST)
    if len(cells) < CELLS:
        return None
    if cells.together > _JOINED:
        side = cells.side * float(np.sqrt(_LARGER))
        larger = _cut(points, residual, side, _LEAST * _LARGER)
        if len(larger) >= CELLS:
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
