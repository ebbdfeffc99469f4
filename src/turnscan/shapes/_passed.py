"""Measured points that the fillings of a closed surface pass by, and what that says of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.findings import Finding
from turnscan.mesh import Mesh, sample_surface, submesh, vector_areas
from turnscan.shapes._added import usual_side

_FAR = 2.0
"""Usual sides of the surface from which on a point is on no face of it."""
_SUPPORT = 5
"""Such points that lie together, at least: fewer are strays."""
_STRAY = 0.01
"""Of the measured points: so many lie by themselves."""
_FEET = 400
"""Places on the fillings that are asked, about, …"""
_MOST = 200_000
"""… and of their faces, at most."""


class Alone(NamedTuple):
    """Measured points that are on no face of the surface that was made of them."""

    points: Floats
    """(k, 3) mm."""
    side: float
    """mm: the usual side of the faces."""


@dataclass(frozen=True)
class Passed:
    """Points that were measured, are on no face, and lie off what was filled beside them."""

    points: Floats
    """(k, 3) mm."""
    feet: Floats
    """(k, 3) mm: the nearest places on the surface, all of them on fillings."""
    distance: Floats
    """(k,) mm from there, positive outside."""
    side: float
    """mm: as that of `Alone`."""


def alone(points: Floats, surface: Mesh) -> Alone:
    """Those of measured ``points`` (n, 3) mm that lie further than two sides from all vertices of a
    surface's faces, and not by themselves."""
    from scipy.spatial import cKDTree

    if not len(points) or not len(surface.faces):
        return Alone(np.zeros((0, 3)), 0.0)
    side = usual_side(surface.triangles)
    tree = cKDTree(surface.vertices[np.unique(surface.faces)])
    off, _ = tree.query(points, distance_upper_bound=_FAR * side, workers=-1)
    far = points[np.isinf(off)]
    if not len(far):
        return Alone(far, side)
    reach = 2 * _FAR * side
    apart, _ = cKDTree(far).query(far, _SUPPORT, distance_upper_bound=reach, workers=-1)
    return Alone(far[np.isfinite(np.asarray(apart)).all(axis=1)], side)


def passed_by(mesh: Mesh, lone: Alone) -> Passed:
    """Which points that are on no face the fillings of a mesh, which may be thinned, pass by."""
    import igl

    real, points = mesh.measured, lone.points
    if real is None or real.all() or not real.any() or not len(points):
        return Passed(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), lone.side)
    squared, face, feet = igl.point_mesh_squared_distance(
        np.ascontiguousarray(points), np.array(mesh.vertices), mesh.faces.astype(np.int64)
    )
    off = np.sqrt(squared)
    some = ~real[face] & (off > _FAR * lone.side)
    points, feet, face, off = points[some], feet[some], face[some], off[some]
    outside = np.einsum("ij,ij->i", points - feet, vector_areas(mesh.triangles[face])) > 0
    return Passed(points, feet, np.where(outside, off, -off), lone.side)


def passed_findings(mesh: Mesh, lone: Alone, measured: int) -> list[Finding]:
    """A warning where the fillings of a mesh pass by more of the points that are on no face than
    stray, of so many ``measured``."""
    found = passed_by(mesh, lone)
    count = len(found.points)
    if count <= _STRAY * measured:
        return []
    x, y, z = np.median(found.points, axis=0)
    most = float(np.abs(found.distance).max())
    text = (
        f"{count} measured points that are on no face lie up to {most:.1f} mm off what was filled"
    )
    where, hint = f"about ({x:.0f}, {y:.0f}, {z:.0f}) mm", "take finer steps, or scan another pose"
    return [Finding("surface.passed", "warning", text, where, hint)]


def passed_sigma(mesh: Mesh, passed: Passed, faces: Bools | None = None) -> float:
    """mm³ by which the fillings of a closed mesh are too small or too large, at least, as points
    that they pass by say; with ``faces`` (f,) those among these.

    The surface goes through such a point. If it leaves it at no more than 45° to the filling, then
    over a place d mm from the foot of a point h mm off it stands off by h − d at least. What this
    adds outside and takes inside is doubted together, for beyond the points nobody knows more.
    """
    from scipy.spatial import cKDTree

    filled = np.zeros(len(mesh.faces), np.bool_) if mesh.measured is None else ~mesh.measured
    chosen = filled if faces is None else filled & faces
    area = mesh.area_of(chosen)
    if not len(passed.points) or not area > 0.0:
        return 0.0
    count = int(np.clip(area / (passed.side / 2) ** 2, 1.0, _MOST))
    places, _ = sample_surface(submesh(mesh, chosen), count)
    tree, apart = cKDTree(places), max(float(np.sqrt(area / _FEET)), passed.side)
    total = 0.0
    for sign in (1.0, -1.0):
        own = sign * passed.distance > 0
        feet, far = _farthest(passed.feet[own], np.abs(passed.distance[own]), apart)
        height = np.zeros(len(places))
        for foot, h in zip(feet, far, strict=True):
            near = np.asarray(tree.query_ball_point(foot, h), dtype=np.intp)
            off = h - np.linalg.norm(places[near] - foot, axis=1)
            height[near] = np.maximum(height[near], off)
        total += float(height.sum()) * area / count
    return total


def _farthest(feet: Floats, distance: Floats, apart: float) -> tuple[Floats, Floats]:
    """Of feet (k, 3) in each cell ``apart`` mm wide that of the largest ``distance`` (k,)."""
    order = np.argsort(-distance, kind="stable")
    cells = np.floor(feet[order] / apart).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    return feet[order][first], distance[order][first]
