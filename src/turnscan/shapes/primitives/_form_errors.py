"""Form errors of shapes: how flat or round a part is, apart from the noise of its points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from turnscan.arrays import Bools
from turnscan.mesh import Mesh
from turnscan.shapes._cells import cell_means, cells_of
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
_SURE = 4.0
"""Standard deviations by which a form error must be more than that of noise."""
_DOUBTFUL = 1.5
"""Times the usual sigma: what is known worse was bent by an edge, neighbours alike."""


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
