"""One measure for all: distances, borders, origin of the vertices, soundness."""

from __future__ import annotations

from typing import Any

import igl
import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from turnscan.mesh import Mesh, crossings

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
_INSIDE = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / np.array([[3], [6], [6], [6]])


def mesh_of(made: dict[str, Any], prefix: str = "") -> Mesh:
    """The mesh among the arrays of a result."""
    return Mesh(made[prefix + "vertices"].astype(np.float64), made[prefix + "faces"])


def distances(points: Floats, mesh: Mesh) -> Floats:
    """(n,) mm from points to a surface, exact (libigl)."""
    squared, *_ = igl.point_mesh_squared_distance(
        np.asfortranarray(points),
        np.asfortranarray(mesh.vertices),
        np.asfortranarray(mesh.faces, np.int64),
    )
    found: Floats = np.sqrt(np.maximum(squared, 0.0))
    return found


def samples(mesh: Mesh) -> Floats:
    """Vertices that are used and four places in each face, (m, 3) mm."""
    within = np.einsum("ij,fjk->fik", _INSIDE, mesh.triangles).reshape(-1, 3)
    return np.concatenate([mesh.vertices[np.unique(mesh.faces)], within])


def hausdorff(one: Mesh, other: Mesh) -> tuple[float, float]:
    """Largest and rms distance of each surface's samples from the other, both ways, mm."""
    both = np.concatenate([distances(samples(one), other), distances(samples(other), one)])
    return float(both.max()), float(np.sqrt((both**2).mean()))


def open_edges(mesh: Mesh) -> Ints:
    """(e, 2) sides with one face, as that face winds."""
    sides = mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).astype(np.int64)
    key = np.sort(sides, axis=1)
    _, which, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    lonely: Ints = sides[count[which.ravel()] == 1]
    return lonely


def crowded_edges(mesh: Mesh) -> int:
    """Sides with more than two faces."""
    sides = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return int((np.unique(sides, axis=0, return_counts=True)[1] > 2).sum())


def border_shift(old: Mesh, new: Mesh) -> float:
    """mm: the farthest that a border vertex of ``old`` lies from the border of ``new``."""
    ends = open_edges(new)
    if not len(ends):
        return float("inf")
    steps = np.linspace(0.0, 1.0, 41)[:, None, None]
    a, b = new.vertices[ends[:, 0]], new.vertices[ends[:, 1]]
    dense = (a + steps * (b - a)).reshape(-1, 3)
    away, _ = cKDTree(dense).query(old.vertices[np.unique(open_edges(old))])
    return float(np.max(away))


def kept(old: Mesh, new: Mesh) -> float:
    """Share of the vertices of ``new`` that stand where one of ``old`` was measured (32 bits)."""
    there = {p.tobytes() for p in old.vertices.astype(np.float32)}
    used = new.vertices[np.unique(new.faces)].astype(np.float32)
    return sum(p.tobytes() in there for p in used) / max(1, len(used))


def faults(mesh: Mesh) -> str:
    """Sides with more than two faces, and pairs of faces that cut through each other."""
    return f"{crowded_edges(mesh)} / {len(crossings(mesh))}"
