"""Normals of vertices, as they are and smoothed, and how rough the surface is along them."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.mesh._mesh import Mesh

_ROUNDS = 4
"""Rings of neighbours that a normal is averaged over."""


def vertex_normals(mesh: Mesh) -> Floats:
    """(v, 3) unit normals of the vertices, their faces weighted by area; NaN without a face."""
    from turnscan.mesh import _normal_kernels as kernels

    normals: Floats = kernels.vertex_normals(mesh.vertices, mesh.faces)
    return normals


def smoothed_normals(mesh: Mesh) -> Floats:
    """(v, 3) unit normals of the vertices, averaged over a few rings of neighbours.

    Where points lie closer than their noise the faces between them tumble; their mean does not.
    """
    from turnscan.mesh import _normal_kernels as kernels

    normals: Floats = kernels.averaged(np.nan_to_num(vertex_normals(mesh)), mesh.faces, _ROUNDS)
    return normals


def roughness(mesh: Mesh, *, about_middle: bool = False) -> float:
    """mm: how far vertices usually lie from the middle of their neighbours, along their normals.

    ``about_middle`` leaves out what all have in common, as on a ball, whose facets are no noise.
    """
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
    if not len(off):
        return 0.0
    middle = float(np.median(off)) if about_middle else 0.0
    return 1.4826 * float(np.median(np.abs(off - middle)))
