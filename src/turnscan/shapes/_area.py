"""The area of the surface that a part has, to which the noise of its points adds nothing."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats
from turnscan.mesh import Mesh, faces_about, vector_areas

_ROUNDS = 8
"""How often normals are averaged: of 6 % of roughness 0.1 to 0.3 % are left then."""
_EDGE = 0.35
"""Normals that differ by more than this (20°), noise aside, are those beside an edge."""
_LEFT = 0.1
"""Share of the roughness taken off that may be left: of spheres and boxes with noise it is 0.02 to
0.07."""
_BENT = 0.2
"""Share of the bend between faces and the normals of their vertices by which a coarse form may be
smoothed away."""


def smooth_normals(mesh: Mesh) -> Floats | None:
    """(f, 3) unit normals of the surface that noise made rough; None where no sigma is known.

    Each is the mean of those about it, weighted by area and by how much they are alike for their
    noise, so that edges stay (after Zheng et al. 2011, Bilateral normal filtering).
    """
    if mesh.provenance is None or not bool(np.nansum(mesh.provenance.sigma) > 0):
        return None
    from turnscan.shapes import _area_kernels as kernels

    vectors = vector_areas(mesh.triangles)
    size = np.linalg.norm(vectors, axis=1)
    fair = np.maximum(size, 1e-12)
    s = np.nan_to_num(mesh.provenance.sigma)[mesh.faces]
    tilts = (s**2 * (_opposite(mesh) ** 2).sum(axis=2)).sum(axis=1) / (4 * fair**2)
    normals = vectors / fair[:, None]
    start, about = faces_about(mesh.faces, len(mesh.vertices))
    found = kernels.smooth_normals(normals, size, tilts, mesh.faces, start, about, _ROUNDS, _EDGE)
    return np.asarray(found)


def smooth_area(mesh: Mesh, chosen: Bools, normals: Floats | None) -> tuple[float, float]:
    """Area of the faces (f,) chosen and its standard uncertainty from noise, mm².

    Each face counts as it looks along its smooth normal (`smooth_normals`): a displacement of
    vertices to and fro, whose sum over a region is nothing, changes no vector area. ``normals``
    None takes the faces as they are, and the uncertainty is NaN.
    """
    vectors = vector_areas(mesh.triangles)
    size = np.linalg.norm(vectors, axis=1)
    if normals is None or mesh.provenance is None:
        return float(size[chosen].sum()), float("nan")
    along = normals[chosen]
    each = np.einsum("ij,ij->i", vectors[chosen], along)
    slope = np.cross(along[:, None], _opposite(mesh)[chosen]) / 2
    noise = _gathered(slope, mesh.faces[chosen], len(mesh.vertices))
    s = np.nan_to_num(mesh.provenance.sigma)
    rough = float(size[chosen].sum() - each.sum())
    bent = _BENT * float((_bend(mesh, normals)[chosen] * each).sum())
    sigma = np.sqrt((noise**2).sum(axis=1) @ s**2 + (_LEFT * rough) ** 2 + bent**2)
    return float(each.sum()), float(sigma)


def _bend(mesh: Mesh, normals: Floats) -> Floats:
    """(f,) one less the mean cosine between the normal of a face and those of its vertices.

    At edges, where nothing is smoothed, it is 0.
    """
    each = np.broadcast_to(normals[:, None], (*mesh.faces.shape, 3))
    corner = _gathered(each, mesh.faces, len(mesh.vertices))
    corner /= np.maximum(np.linalg.norm(corner, axis=1), 1e-12)[:, None]
    bend = 1.0 - np.einsum("fj,fij->fi", normals, corner[mesh.faces]).mean(axis=1)
    return np.where(bend < _EDGE**2 / 2, bend, 0.0)


def _opposite(mesh: Mesh) -> Floats:
    """(f, 3, 3) the edge opposite to each vertex."""
    t = mesh.triangles
    return np.asarray(np.roll(t, -2, axis=1) - np.roll(t, -1, axis=1))


def _gathered(slope: Floats, corners: npt.NDArray[np.int32], count: int) -> Floats:
    """(v, 3) the sum over the faces of what (f, 3, 3) each of their corners adds."""
    flat = slope.reshape(-1, 3)
    parts = [np.bincount(corners.ravel(), flat[:, axis], minlength=count) for axis in range(3)]
    return np.stack(parts, axis=-1)
