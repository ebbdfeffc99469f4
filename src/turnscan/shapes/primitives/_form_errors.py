"""Form errors of shapes: how flat or round a part is, apart from the noise of its points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from turnscan.arrays import Floats
from turnscan.mesh import Mesh
from turnscan.shapes.primitives._shapes import Kind, ShapeSet

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
    that of their noise. Noise alone gives n means of scatter s a range of s (a ± b), with
    a = 2 √(2 ln n) − (ln ln n + ln 4π)/√(2 ln n), b = π/√(6 ln n) (Gumbel's limits of both ends).
    """
    out = list[FormError]()
    for k, s in enumerate(found.shapes):
        member = np.flatnonzero(found.used & (found.label == k))
        if len(member) < _CELL * _CELLS:
            continue
        side = float(np.sqrt(_CELL * s.area / len(member)))
        mean, scatter = _means(mesh.vertices[member], found.residual[member], side)
        n = len(mean)
        if n < _CELLS:
            continue
        deep = np.sqrt(2 * np.log(n))
        usual = 2 * deep - (np.log(np.log(n)) + np.log(4 * np.pi)) / deep
        spread = np.pi / np.sqrt(6 * np.log(n))
        value = float(np.ptp(mean))
        noise, sigma = scatter * float(usual), scatter * float(spread)
        out.append(FormError(FORMS[s.kind], k, value, noise, sigma, n, side))
    return tuple(out)


def _means(points: Floats, off: Floats, side: float) -> tuple[Floats, float]:
    """Means (n,) of the cells that have enough points, and the scatter that noise gives them."""
    at = np.floor((points - points.min(axis=0)) / side).astype(np.int64)
    wide = at.max(axis=0) + 1
    keys = (at[:, 0] * wide[1] + at[:, 1]) * wide[2] + at[:, 2]
    cell = np.unique(keys, return_inverse=True)[1]
    count = np.bincount(cell)
    good = count >= _LEAST
    mean = np.bincount(cell, off)[good] / count[good]
    square = np.bincount(cell, off * off)[good] / count[good] - mean**2
    variance = square / (count[good] - 1)
    return mean, float(np.sqrt(variance.mean())) if len(mean) else 0.0
