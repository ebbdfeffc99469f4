"""Form errors of shapes: how flat or round a part is, apart from the noise of its points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from turnscan.arrays import Floats
from turnscan.mesh import Mesh
from turnscan.shapes.primitives._shapes import Kind, ShapeSet
from turnscan.shapes.verification._statistics import noise_range

FormKind = Literal["flatness", "sphericity", "cylindricity", "conicity", "torus form"]
FORMS: dict[Kind, FormKind] = {
    "plane": "flatness",
    "sphere": "sphericity",
    "cylinder": "cylindricity",
    "cone": "conicity",
    "torus": "torus form",
}
_CELL = 25
"""Points of a cell, about."""
_LEAST, _CELLS = 15, 8
"""Points that a cell must have, and cells that a shape must have."""
_SURE = 4.0
"""Standard deviations by which a form error must be more than that of noise."""


@dataclass(frozen=True)
class FormError:
    """The width of the zone about a shape that holds the surface, as far as noise lets it show."""

    kind: FormKind
    shape: int
    """Index of the shape."""
    value: float
    """mm from the lowest to the highest mean of a cell of neighbouring points, off the
    least-squares shape."""
    noise: float
    """mm that independent noise of the points makes of a perfect shape, on average."""
    sigma: float
    """mm: the standard uncertainty that this noise leaves."""
    cells: int
    """How many cells there are."""
    side: float
    """mm: side of a cell; narrower waves of the surface are averaged out."""

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
        if len(member) < _CELL * _CELLS:
            continue
        side = float(np.sqrt(_CELL * s.area / len(member)))
        mean, scatter = _means(mesh.vertices[member], found.residual[member], side)
        if len(mean) < _CELLS:
            continue
        noise, sigma = noise_range(scatter)
        out.append(FormError(FORMS[s.kind], k, float(np.ptp(mean)), noise, sigma, len(mean), side))
    return tuple(out)


def _means(points: Floats, off: Floats, side: float) -> tuple[Floats, Floats]:
    """Means (n,) of the cells that have enough points, and the scatter (n,) that noise leaves them.

    The noise of a point is that of all cells together, for 15 points do not tell their own well.
    """
    at = np.floor((points - points.min(axis=0)) / side).astype(np.int64)
    wide = at.max(axis=0) + 1
    keys = (at[:, 0] * wide[1] + at[:, 1]) * wide[2] + at[:, 2]
    cell = np.unique(keys, return_inverse=True)[1]
    count = np.bincount(cell)
    good = count >= _LEAST
    count = count[good]
    mean = np.bincount(cell, off)[good] / count
    square = np.bincount(cell, off * off)[good] - count * mean**2
    variance = float(square.sum()) / max(int((count - 1).sum()), 1)
    return mean, np.sqrt(variance / count)
