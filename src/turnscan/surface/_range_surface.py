"""RangeSurface: the mesh of one grid, with what a merge must know about each vertex."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.errors import InputError
from turnscan.points import RangeGrid
from turnscan.surface._grid_mesh import Tears, mesh_grid, vertex_normals
from turnscan.surface._mesh import Mesh

_ROUNDS = 4
"""Rings of neighbours that a normal is averaged over."""


@dataclass(frozen=True)
class RangeSurface:
    """The mesh of one grid, and where the camera stood when it saw each vertex."""

    mesh: Mesh
    eyes: Floats
    """(v, 3) mm."""
    normals: Floats
    """(v, 3) unit normals, steady against noise (`steady_normals`)."""

    @property
    def cosine(self) -> Floats:
        """(v,) cosine of the camera ray's angle to the normal; 0 where not known."""
        ray = self.eyes - self.mesh.vertices
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        cosine: Floats = np.nan_to_num(np.einsum("ij,ij->i", self.normals, ray))
        return cosine

    @property
    def sigma(self) -> Floats:
        """(v,) mm; where it is not known, the usual noise of the surface itself."""
        p = self.mesh.provenance
        sigma = np.full(len(self.mesh.vertices), np.nan) if p is None else p.sigma
        known = sigma[sigma > 0]
        usual = float(np.median(known)) if len(known) else roughness(self.mesh)
        return np.where(sigma > 0, sigma, usual)


def steady_normals(mesh: Mesh) -> Floats:
    """(v, 3) unit normals of the vertices, averaged over a few rings of neighbours.

    Where points lie closer than their noise the faces between them tumble; their mean does not.
    """
    from turnscan.surface import _face_kernels as kernels

    normals: Floats = kernels.averaged(np.nan_to_num(vertex_normals(mesh)), mesh.faces, _ROUNDS)
    return normals


def roughness(mesh: Mesh) -> float:
    """mm: how far vertices usually lie from the middle of their neighbours, along their normals."""
    if not len(mesh.faces):
        return 0.0
    total, count = np.zeros((len(mesh.vertices), 3)), np.zeros(len(mesh.vertices))
    for a, b in ((0, 1), (1, 2), (2, 0)):
        for i, j in ((a, b), (b, a)):
            begin, end = mesh.faces[:, i], mesh.faces[:, j]
            count += np.bincount(begin, minlength=len(count))
            for axis in range(3):
                total[:, axis] += np.bincount(begin, mesh.vertices[end, axis], len(count))
    with np.errstate(invalid="ignore", divide="ignore"):
        off = np.einsum("ij,ij->i", mesh.vertices - total / count[:, None], vertex_normals(mesh))
    off = off[np.isfinite(off)]
    return 1.4826 * float(np.median(np.abs(off))) if len(off) else 0.0


def range_surfaces(grid: RangeGrid, tears: Tears | None = None) -> list[RangeSurface]:
    """The surface of a grid, and apart from it what the sheet met beyond the rotation axis.

    Raises InputError for a grid that does not know where its camera stood.
    """
    behind = np.zeros(grid.flags.shape, bool) if grid.behind is None else grid.behind
    return [_surface(grid, part, tears) for part in (~behind, behind) if (part & grid.found).any()]


def _surface(grid: RangeGrid, keep: Bools, tears: Tears | None) -> RangeSurface:
    if grid.eyes is None:
        raise InputError(
            f"{grid.laser}: where the camera stood is not known", hint="merge with --merge paste"
        )
    points = np.where(keep[..., None], grid.points, np.nan)
    mesh = mesh_grid(replace(grid, points=points), tears)
    if mesh.provenance is None:
        raise TypeError("the mesh of a grid knows its steps")
    order = np.argsort(grid.steps, kind="stable")
    at = order[np.searchsorted(grid.steps[order], mesh.provenance.step)]
    return RangeSurface(mesh, grid.eyes[at], steady_normals(mesh))
