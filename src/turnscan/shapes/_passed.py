"""Measured points that the fillings of a closed surface pass by, and what that says of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.findings import Finding
from turnscan.mesh import Mesh, vector_areas

_FAR = 2.0
"""Usual sides of what was measured from which on a point lies on no face."""
_STRAY = 0.01
"""Of the measured points: so many lie by themselves."""
_FEET = 400
"""Places on the fillings that are asked, about."""


@dataclass(frozen=True)
class Passed:
    """Points that were measured, made no face, and lie off what was filled beside them."""

    points: Floats
    """(k, 3) mm."""
    feet: Floats
    """(k, 3) mm: the nearest places on the surface, all of them on fillings."""
    distance: Floats
    """(k,) mm from there, positive outside."""


def alone(points: Floats, surface: Mesh) -> Floats:
    """(k, 3) mm: those of measured ``points`` (n, 3) that made no face of a surface."""
    from scipy.spatial import cKDTree

    if not len(points) or not len(surface.faces):
        return np.zeros((0, 3))
    tree = cKDTree(surface.vertices[np.unique(surface.faces)])
    off, _ = tree.query(points, distance_upper_bound=_FAR * _side(surface, None), workers=-1)
    return points[np.isinf(off)]


def passed_by(mesh: Mesh, points: Floats) -> Passed:
    """Which measured ``points`` (n, 3), which are on no face, the fillings of a mesh pass by."""
    import igl

    real = mesh.measured
    if real is None or real.all() or not real.any() or not len(points):
        return Passed(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
    squared, face, feet = igl.point_mesh_squared_distance(
        np.ascontiguousarray(points), np.array(mesh.vertices), mesh.faces.astype(np.int64)
    )
    off = np.sqrt(squared)
    some = ~real[face] & (off > _FAR * _side(mesh, real))
    points, feet, face, off = points[some], feet[some], face[some], off[some]
    outside = np.einsum("ij,ij->i", points - feet, vector_areas(mesh.triangles[face])) > 0
    return Passed(points, feet, np.where(outside, off, -off))


def passed_findings(mesh: Mesh, points: Floats, measured: int) -> list[Finding]:
    """A warning where the fillings of a mesh pass by more of the ``points`` (n, 3) that made no
    face than stray, of so many ``measured``."""
    found = passed_by(mesh, points)
    count = len(found.points)
    if count <= _STRAY * measured:
        return []
    x, y, z = np.median(found.points, axis=0)
    most = float(np.abs(found.distance).max())
    text = f"{count} measured points that made no face lie up to {most:.1f} mm off what was filled"
    where, hint = f"about ({x:.0f}, {y:.0f}, {z:.0f}) mm", "take finer steps, or scan another pose"
    return [Finding("surface.passed", "warning", text, where, hint)]


def passed_sigma(mesh: Mesh, passed: Passed, faces: Bools | None = None) -> float:
    """mm³ by which the fillings of a closed mesh are too small or too large, at least, as points
    that they pass by say; with ``faces`` (f,) those among these.

    The surface goes through such a point. If it leaves it at no more than 45° to the filling, then
    over a place d mm from the foot of a point h mm off it stands off by h − d at least. What this
    adds outside and takes inside is doubted together, for beyond the points nobody knows more.
    """
    filled = np.zeros(0, np.bool_) if mesh.measured is None else ~mesh.measured
    if not len(passed.points) or not filled.any():
        return 0.0
    chosen = filled if faces is None else filled & faces
    middle = mesh.triangles[chosen].mean(axis=1)
    size = np.linalg.norm(vector_areas(mesh.triangles[chosen]), axis=1)
    apart = max(float(np.sqrt(mesh.area_of(filled) / _FEET)), _side(mesh, mesh.measured))
    total = 0.0
    for sign in (1.0, -1.0):
        own = sign * passed.distance > 0
        feet, far = _farthest(passed.feet[own], np.abs(passed.distance[own]), apart)
        height = np.zeros(len(middle))
        for foot, h in zip(feet, far, strict=True):
            np.maximum(height, h - np.linalg.norm(middle - foot, axis=1), out=height)
        total += float(size @ height)
    return total


def _farthest(feet: Floats, distance: Floats, apart: float) -> tuple[Floats, Floats]:
    """Of feet (k, 3) in each cell ``apart`` mm wide that of the largest ``distance`` (k,)."""
    order = np.argsort(-distance, kind="stable")
    cells = np.floor(feet[order] / apart).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    return feet[order][first], distance[order][first]


def _side(mesh: Mesh, real: Bools | None) -> float:
    """mm: the usual side of faces, of those that are ``real`` (f,)."""
    t = mesh.triangles if real is None else mesh.triangles[real]
    return float(np.median(np.linalg.norm(t - np.roll(t, 1, axis=1), axis=2)))
