"""The volume of a solid, and how well it is known by the surfaces that bound it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.drawings import Facets
from turnscan.mesh import Mesh, is_closed
from turnscan.shapes import Source, deviation, volume_sigma
from turnscan.shapes.primitives import ShapeSet, shapes_volume_sigma
from turnscan.workflows._solids._shapes_table import finite

_SAME = 0.02
"""Of the tolerance of the shapes: vertices of a face lie so near to the shape that it is of."""


@dataclass(frozen=True)
class SolidVolume:
    """mm³ with their standard uncertainties by cause."""

    value: float
    shapes: float
    """By the shapes' own uncertainties, which points and calibration give them."""
    others: float
    """By the points of the surface that lies on no shape, and what that does between them."""
    shared: float
    """By what the calibration and the poses do to that surface."""
    left: float
    """What the solid leaves of measured points that lie on no shape."""
    filled: float
    """By the filled faces on no shape."""
    hollow: float
    """By what fillings may cover."""
    closed: bool = True
    """False of an open mesh: what its holes cover is unknown, and no uncertainty has it."""

    @property
    def measured(self) -> float:
        """Of all that was measured: what the calibration does may be alike on shapes and rest."""
        alike = self.shapes + self.shared
        return float(np.sqrt(alike**2 + self.others**2 + self.left**2))

    @property
    def unmeasured(self) -> float:
        """Of what was filled, and of what may lie behind it."""
        return float(np.hypot(self.filled, self.hollow))

    @property
    def sigma(self) -> float:
        """All together."""
        return float(np.hypot(self.measured, self.unmeasured))

    @property
    def mostly(self) -> str:
        """What the largest part comes from, in words."""
        known = {
            "the shapes": self.shapes,
            "other surfaces": float(np.hypot(self.others, self.shared)),
            "what lies on no shape": self.left,
            "the filled faces": self.filled,
            "what fillings may cover": self.hollow,
        }
        return max(known, key=lambda k: known[k])

    def figures(self) -> dict[str, Any]:
        """By name with the unit."""
        return {
            "volume_sigma_mm3": finite(self.sigma),
            "volume_sigma_shapes_mm3": finite(self.shapes),
            "volume_sigma_measured_mm3": finite(self.measured),
            "volume_sigma_filled_mm3": finite(self.unmeasured),
        }

    def __str__(self) -> str:
        holes = "" if self.closed else "; what the mesh's holes cover is not known"
        return (
            f"{self.value:.1f} ± {self.sigma:.3g} mm³ ({self.measured:.3g} of it measured, "
            f"{self.shapes:.3g} by the shapes; u mostly from {self.mostly}{holes})"
        )


def shapes_of(found: ShapeSet, facets: Facets) -> Ints:
    """(m,) which shape each triangle of faces is of, −1 for none."""
    out = np.full(len(facets.face), -1, dtype=np.int32)
    t = facets.mesh.triangles
    for number, surface in enumerate(facets.surfaces):
        own = np.flatnonzero(facets.face == number)
        if surface is None or not len(own):
            continue
        X = t[own].reshape(-1, 3)
        for k, s in enumerate(found.shapes):
            if s.kind == surface.kind and s.hollow == surface.hollow:
                off = np.abs(s.distances(X))
                if float(off.max()) <= _SAME * found.tolerance:
                    out[own] = k
                    break
    return out


def solid_volume(
    value: float, mesh: Mesh, found: ShapeSet, facets: Facets, source: Source | None
) -> SolidVolume:
    """How well the volume of a solid with these ``facets`` is known that was made of a mesh.

    A face on a shape is known as the shape is. The rest of the mesh counts as `volume_sigma` says,
    and what its points stand off the solid by, added up, is doubted.
    """
    shape = shapes_of(found, facets)
    sigma = shapes_volume_sigma(found, facets.mesh.triangles, shape)
    near = deviation(mesh.triangles.mean(axis=1), facets.mesh)
    rest = shape[near.face] < 0
    left = _left(mesh, found, near.distance, ~rest)
    if not is_closed(mesh):
        return SolidVolume(value, sigma, 0.0, 0.0, left, 0.0, 0.0, closed=False)
    known = volume_sigma(mesh, source, rest)
    parts = (known.noise, known.between, known.alike, known.profiles)
    others = float(np.sqrt(np.square(np.nan_to_num(parts)).sum()))
    return SolidVolume(value, sigma, others, known.shared, left, known.filled, known.hollow)


def _left(mesh: Mesh, found: ShapeSet, distance: Floats, on: Bools) -> float:
    """mm³ between measured faces of the mesh that lie on no shape and the faces of shapes that
    stand in their place, ``on`` (f,), ``distance`` (f,) mm from them."""
    t = mesh.triangles
    area = np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1) / 2
    own = on & (found.label[mesh.faces] < 0).any(axis=1)
    if mesh.measured is not None:
        own &= mesh.measured
    return abs(float(area[own] @ distance[own]))
