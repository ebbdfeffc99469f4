"""Seat: what a merge guessed beside a measured point goes onto that point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from turnscan.arrays import Bools, Floats, Longs
from turnscan.mesh._mesh import Mesh, Provenance
from turnscan.mesh._normals import vertex_normals
from turnscan.mesh._parts import joined_provenance
from turnscan.mesh._soundness import crossings
from turnscan.points import usual_sigma
from turnscan.surface.fusion._range_surface import RangeSurface

_ALIKE = 0.7
"""Cosine between the normals of a vertex and of the point that it goes onto."""
_TURN = 0.3
"""Cosine: no face may turn further, as in a decimation."""
_DOUBT = 20.0
"""Usual sigma of a point beyond which it takes no vertex: a merge believes no worse."""


def seated(
    mesh: Mesh, guessed: Bools, surfaces: Sequence[RangeSurface], reach: float
) -> tuple[Mesh, Bools]:
    """The mesh with ``guessed`` vertices (v,) moved onto measured points, and (v,) which are left.

    Marching cubes puts its vertices on the sides of voxels, and few of them on a profile; where
    what lies between profiles is not kept, a whole profile would go. So each measured point no
    further than ``reach`` mm away whose nearest vertex is a guessed one takes it, the nearest point
    first, and gives it its sigma and its provenance. A vertex whose faces would turn over, or cut
    through others, stays.
    """
    near = _near(mesh, guessed)
    if not len(near):
        return mesh, guessed
    points, normals, sigma = (
        np.concatenate(every)
        for every in zip(*((s.mesh.vertices, s.normals, s.sigma) for s in surfaces), strict=True)
    )
    from scipy.spatial import cKDTree

    tree = cKDTree(mesh.vertices[near])
    away, nearest = (np.asarray(k) for k in tree.query(points, distance_upper_bound=reach))
    point = np.flatnonzero(np.isfinite(away) & (sigma <= _DOUBT * usual_sigma(sigma)))
    vertex, away = near[nearest[point]], away[point]
    own = vertex_normals(mesh)[vertex]
    good = guessed[vertex] & (np.einsum("ij,ij->i", own, normals[point]) > _ALIKE)
    point, vertex, away = point[good], vertex[good], away[good]
    order = np.lexsort((point, away))
    vertex, first = np.unique(vertex[order], return_index=True)
    source = np.full(len(guessed), -1, dtype=np.int64)
    source[vertex] = point[order][first]
    moved = _moved(mesh, source, points)
    return replace(moved, provenance=_known(mesh, source, surfaces, sigma)), guessed & (source < 0)


def _near(mesh: Mesh, guessed: Bools) -> Longs:
    """Those of the vertices that are guessed, or hang on one by a side."""
    near = np.zeros(len(guessed), dtype=np.bool_)
    near[mesh.faces[guessed[mesh.faces].any(axis=1)]] = True
    return np.flatnonzero(near)


def _moved(mesh: Mesh, source: Longs, points: Floats) -> Mesh:
    """The mesh with vertices on the ``points`` of their ``source`` (v,); −1 there, and from now on
    where a face would turn over or cut through another, for those that stay."""
    before = _area_vectors(mesh)
    while True:
        there = source >= 0
        moved = replace(mesh, vertices=np.where(there[:, None], points[source], mesh.vertices))
        after = _area_vectors(moved)
        size = np.linalg.norm(before, axis=1) * np.linalg.norm(after, axis=1)
        turned = np.einsum("ij,ij->i", before, after) < _TURN * size
        of_moved = np.asarray(there[mesh.faces].any(axis=1))
        wrong = turned & of_moved
        if not wrong.any():
            wrong[crossings(moved, of_moved)] = True
            wrong &= of_moved
        if not wrong.any():
            return moved
        source[mesh.faces[wrong]] = -1


def _area_vectors(mesh: Mesh) -> Floats:
    t = mesh.triangles
    return np.asarray(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]))


def _known(
    mesh: Mesh, source: Longs, surfaces: Sequence[RangeSurface], sigma: Floats
) -> Provenance | None:
    """The provenance of the mesh with that of the points where vertices went onto one."""
    own, whole = mesh.provenance, joined_provenance([s.mesh for s in surfaces])
    if own is None or whole is None:
        return own
    there = source >= 0
    laser, step, line = (
        np.where(there, new[source], old)
        for new, old in (
            (whole.laser, own.laser),
            (whole.step, own.step),
            (whole.line, own.line),
        )
    )
    return Provenance(np.where(there, sigma[source], own.sigma), laser, step, line, own.lasers)
