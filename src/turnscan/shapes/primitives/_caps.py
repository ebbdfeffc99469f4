"""Planes of what was filled: they close a solid, although they were not measured."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats
from turnscan.mesh import Mesh, components, measured_vertices, submesh
from turnscan.shapes.primitives._shapes import Shape

_LEAST = 3


def filled_planes(mesh: Mesh, tolerance: float) -> list[tuple[Shape, Floats]]:
    """Flat pieces of what was filled: their plane, normal outward, and their points (n, 3) mm.

    A piece is flat where nine tenths of its vertices lie within ``tolerance`` mm of its plane.
    Nothing is known of how far it is from the part: covariances are 0.
    """
    known = measured_vertices(mesh)
    added = ~np.asarray(known[mesh.faces].all(axis=1), dtype=np.bool_)
    if mesh.measured is not None:
        added |= ~mesh.measured
    if not added.any():
        return []
    part = submesh(mesh, added)
    out = []
    piece = components(part)
    for k in range(int(piece.max()) + 1):
        faces = part.faces[piece == k]
        X = part.vertices[np.unique(faces)]
        if len(X) < _LEAST:
            continue
        t = part.vertices[faces]
        normals = np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]) / 2
        size = np.linalg.norm(normals, axis=1)
        total = normals.sum(axis=0)
        if not np.linalg.norm(total) > 0.9 * size.sum() > 0:
            continue
        middle = (t.mean(axis=1) * size[:, None]).sum(axis=0) / size.sum()
        n = total / np.linalg.norm(total)
        d = np.abs((X - middle) @ n)
        if float(np.quantile(d, 0.9)) > tolerance:
            continue
        plane = Shape(
            "plane", middle, n, 0.0, 0.0, False, np.zeros((7, 7)), 0, float(size.sum()),
            float(np.sqrt(np.mean(d**2))), 0.0,
        )  # fmt: skip
        out.append((plane, X))
    return out
