"""Form errors of shapes: how flat or round a part is, apart from the noise of its points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Ints
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
    scatter that its own number of points leaves it (`noise_range`).
    """
    out = list[FormError]()
    for k, s in enumerate(found.shapes):
        member = np.flatnonzero(found.used & (found.label == k))
        if len(member) < CELL * CELLS:
            continue
        side = float(np.sqrt(CELL * s.area / len(member)))
        cell = cells_of(mesh.vertices[member], side)
        mean, scatter = cell_means(cell, found.residual[member])
        if len(mean) < CELLS:
            continue
        noise, sigma = noise_range(scatter)
        out.append(FormError(FORMS[s.kind], k, float(np.ptp(mean)), noise, sigma, len(mean), side))
    return tuple(out)


def cells_of(points: Floats, side: float) -> Ints:
    """(n,) number of the cube of a side (mm) that each point lies in; −1 where it has too few."""
    at = np.floor((points - points.min(axis=0)) / side).astype(np.int64)
    wide = at.max(axis=0) + 1
    return full_enough((at[:, 0] * wide[1] + at[:, 1]) * wide[2] + at[:, 2], _LEAST)


def full_enough(keys: npt.NDArray[np.int64], least: int) -> Ints:
    """(n,) cells by their keys, numbered from 0; −1 for those of fewer than ``least`` points."""
    cell, count = np.unique(keys, return_inverse=True, return_counts=True)[1:]
    good = count >= least
    number = np.where(good, np.cumsum(good) - 1, -1)
    return np.asarray(number[cell.ravel()], dtype=np.int32)


def cell_means(cell: Ints, off: Floats) -> tuple[Floats, Floats]:
    """Means (c,) of the values (n,) in each cell, and the scatter (c,) that noise leaves them.

    The noise of a point is that of all cells together, for 15 points do not tell their own well.
    """
    on = cell >= 0
    cell, off = cell[on], off[on]
    if not len(cell):
        return np.zeros(0), np.zeros(0)
    count = np.bincount(cell)
    mean = np.bincount(cell, off) / count
    square = np.bincount(cell, off * off) - count * mean**2
    variance = max(float(square.sum()), 0.0) / max(int((count - 1).sum()), 1)
    return mean, np.sqrt(variance / count)
