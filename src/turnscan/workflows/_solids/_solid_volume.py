"""The volume of a solid, and how well it is known by the surfaces that bound it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.drawings import Facets
from turnscan.mesh import (
    Mesh,
    components,
    is_closed,
    measured,
    opposite_half_edges,
    submesh,
    vector_areas,
)
from turnscan.shapes import Deviation, VolumeSigma, deviation, volume_sigma
from turnscan.shapes.primitives import ShapeSet, shapes_volume_sigma
from turnscan.workflows._solids._loaded import Loaded
from turnscan.workflows._solids._shapes_table import finite

_SAME = 0.02
"""Of the tolerance of the shapes: vertices of a face lie so near to the shape that it is of."""
_OFF = 2.0
"""Tolerances of the shapes from which a face of the mesh does not lie on the solid."""


@dataclass(frozen=True)
class SolidVolume:
    """A volume, mm³, and what its uncertainty is made of."""

    value: float
    known: VolumeSigma
    closed: bool = True
    """False of an open mesh: what its holes cover is unknown, and no uncertainty has it."""

    @property
    def sigma(self) -> float:
        """Its standard uncertainty."""
        return self.known.total

    def figures(self) -> dict[str, Any]:
        """By name with the unit."""
        return {
            "volume_sigma_mm3": finite(self.sigma),
            "volume_sigma_shapes_mm3": finite(self.known.shapes),
            "volume_sigma_measured_mm3": finite(self.known.measured),
            "volume_sigma_filled_mm3": finite(self.known.unmeasured),
        }

    def __str__(self) -> str:
        holes = "" if self.closed else "; what the mesh's holes cover is not known"
        return (
            f"{self.value:.1f} ± {self.sigma:.3g} mm³ ({self.known.measured:.3g} of it measured, "
            f"{self.known.shapes:.3g} by the shapes; u mostly from {self.known.mostly}{holes})"
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


def solid_volume(value: float, surface: Loaded, found: ShapeSet, facets: Facets) -> SolidVolume:
    """How well the volume of a solid with these ``facets`` is known that was made of a surface.

    A face on a shape is known as the shape is. The rest of the mesh counts as `volume_sigma` says,
    and what its points stand off the solid by, added up, is doubted.
    """
    shape = shapes_of(found, facets)
    mesh = surface.mesh
    sigma = shapes_volume_sigma(found, facets.mesh.triangles, shape)
    near = deviation(mesh.triangles.mean(axis=1), facets.mesh)
    rest = shape[near.face] < 0
    left = _left(mesh, found, near.distance, ~rest)
    left += _in_pockets(mesh, facets, near, ~rest, _OFF * found.tolerance)
    if not is_closed(mesh):
        own = VolumeSigma(0.0, 0.0, 0.0, shapes=sigma, left=left)
        return SolidVolume(value, own, closed=False)
    known = volume_sigma(mesh, surface.source, rest, surface.moves)
    noise = float(np.nan_to_num(known.noise))
    return SolidVolume(value, replace(known, noise=noise, shapes=sigma, left=left))


def _left(mesh: Mesh, found: ShapeSet, distance: Floats, on: Bools) -> float:
    """mm³ between measured faces of the mesh that lie on no shape and the faces of shapes that
    stand in their place, ``on`` (f,), ``distance`` (f,) mm from them."""
    area = np.linalg.norm(vector_areas(mesh.triangles), axis=1)
    own = on & (found.label[mesh.faces] < 0).any(axis=1)
    if mesh.measured is not None:
        own &= mesh.measured
    return abs(float(area[own] @ distance[own]))


def _in_pockets(mesh: Mesh, facets: Facets, near: Deviation, on: Bools, off: float) -> float:
    """mm³ between fillings and the solid that goes on in their stead where it may not.

    Nobody saw whether a face goes on there. Where the points about a filling lie on the solid, it
    does as far as anybody knows; in a pocket they lie further than ``off`` mm from it. The share of
    a filling's rim that does is taken of the volume between it and faces of shapes, ``on`` (f,).
    """
    filled = np.flatnonzero(~measured(mesh))
    if not len(filled):
        return 0.0
    patch = np.full(len(mesh.faces), -1, dtype=np.int32)
    patch[filled] = components(submesh(mesh, ~measured(mesh)))
    out = vector_areas(facets.mesh.triangles)[near.face]
    out /= np.maximum(np.linalg.norm(out, axis=1), 1e-300)[:, None]
    between = np.einsum("ij,ij->i", vector_areas(mesh.triangles), out) * near.distance
    volume = np.bincount(patch[filled], np.where(on, between, 0.0)[filled])
    side = (3 * filled[:, None] + np.arange(3)).ravel()
    twin = opposite_half_edges(mesh.faces)[side]
    side, other = side[twin >= 0], twin[twin >= 0] // 3
    rim = patch[other] < 0
    side, other = side[rim], other[rim]
    face, corner = side // 3, side % 3
    ends = [mesh.vertices[mesh.faces[face, (corner + k) % 3]] for k in (0, 1)]
    length = np.linalg.norm(ends[1] - ends[0], axis=1)
    many = len(volume)
    whole = np.bincount(patch[face], length, many)
    away = np.bincount(patch[face], length * (np.abs(near.distance[other]) > off), many)
    return float(np.abs(volume) @ (away / np.maximum(whole, 1e-300)))
