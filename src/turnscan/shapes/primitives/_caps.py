"""Planes of what was filled: they close a solid, although they were not measured."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.mesh import Mesh, measured_vertices, opposite_half_edges, vector_areas
from turnscan.shapes.primitives._shapes import Shape

_SMALLEST = 1e-3
"""Of the surface: smaller fillings are no faces of a part."""
_CREASE = float(np.cos(np.deg2rad(20.0)))
"""Fillings end where faces meet at a greater angle: a wall goes down to the floor, and both are
fillings."""


def filled_planes(mesh: Mesh, tolerance: float) -> list[tuple[Shape, Floats]]:
    """Flat pieces of what was filled: their plane, normal outward, and their points (n, 3) mm.

    A piece is flat where nine tenths of its vertices lie within ``tolerance`` mm of its plane.
    Nothing is known of how far it is from the part: covariances are 0.
    """
    known = measured_vertices(mesh)
    added = ~np.asarray(known[mesh.faces].all(axis=1), dtype=np.bool_)
    if mesh.measured is not None:
        added |= ~mesh.measured
    area = vector_areas(mesh.triangles)
    size = np.linalg.norm(area, axis=1)
    least = _SMALLEST * float(size.sum())
    out = []
    piece = _pieces(mesh, area / np.maximum(size, 1e-300)[:, None], added)
    order = np.argsort(piece, kind="stable")[int((~added).sum()) :]
    ends = np.flatnonzero(np.diff(piece[order])) + 1
    for mine in np.split(order, ends) if len(order) else []:
        total = area[mine].sum(axis=0)
        if np.linalg.norm(total) > max(0.9 * float(size[mine].sum()), least):
            middle = np.average(mesh.triangles[mine].mean(axis=1), axis=0, weights=size[mine])
            out.append(_plane(mesh.vertices[np.unique(mesh.faces[mine])], middle, total, tolerance))
    return [one for one in out if one is not None]


def _plane(
    X: Floats, middle: Floats, across: Floats, tolerance: float
) -> tuple[Shape, Floats] | None:
    """The plane through ``middle`` across a vector area (3,) mm², if points (n, 3) lie on it."""
    area = float(np.linalg.norm(across))
    d = np.abs((X - middle) @ across) / area
    if float(np.quantile(d, 0.9)) > tolerance:
        return None
    rms = float(np.sqrt(np.mean(d**2)))
    none = np.zeros((7, 7))
    return Shape("plane", middle, across / area, 0.0, 0.0, False, none, 0, area, rms, 0.0), X


def _pieces(mesh: Mesh, normal: Floats, added: Bools) -> Ints:
    """(f,) number of the smooth piece of a filling that a face is in; −1 for the others."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    twin = opposite_half_edges(mesh.faces)
    side = np.flatnonzero(twin >= 0)
    a, b = side // 3, twin[side] // 3
    flat = np.einsum("ij,ij->i", normal[a], normal[b]) > _CREASE
    on = flat & added[a] & added[b]
    link = coo_array((np.ones(int(on.sum()), np.int8), (a[on], b[on])), shape=2 * (len(added),))
    piece: Ints = connected_components(link, directed=False)[1].astype(np.int32)
    return np.where(added, piece, np.int32(-1))
