"""Sizes between shapes, with the uncertainty that their joint covariance gives them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

from turnscan.arrays import Floats
from turnscan.mesh import Mesh
from turnscan.shapes.primitives import _surface_kernels as surface
from turnscan.shapes.primitives._shapes import ShapeSet

SizeKind = Literal[
    "diameter", "tube diameter", "cone angle", "distance", "axis distance", "axis to plane", "angle"
]
_ORDER: tuple[SizeKind, ...] = (
    "distance", "diameter", "tube diameter", "cone angle", "angle", "axis distance",
    "axis to plane",
)  # fmt: skip
"""What a drawing gives first."""
LOOK = float(np.radians(3.0))
"""Directions within this of parallel or square are compared with it."""
_CLEAR = 3.0
"""Standard uncertainties from which on the direction of a distance is known."""
_FIXED = 0.01
"""Of the standard uncertainty before relations: an angle that is known so well is fixed by them."""
_EDGES = 4
"""Sides of faces between two shapes that make them neighbours."""


@dataclass(frozen=True)
class ShapeSize:
    """A size of a shape, or between two."""

    kind: SizeKind
    first: int
    second: int | None
    """Index of the shapes; None where the size is of one alone."""
    value: float
    """mm; radians for angles: between outward normals, or the whole angle of a cone."""
    sigma: float
    """Standard uncertainty, same unit."""

    def named(self, found: ShapeSet) -> str:
        """What a drawing calls it: the distance of two planes that look one way is a step height,
        that of two which look at each other a gap width."""
        if self.kind != "distance" or self.second is None:
            return self.kind
        one, other = found.measured[self.first], found.measured[self.second]
        if float(one.axis @ other.axis) > 0:
            return "step height"
        return "gap width" if float((other.point - one.point) @ one.axis) > 0 else "distance"


def neighbours_of(mesh: Mesh, found: ShapeSet) -> set[tuple[int, int]]:
    """Pairs of shapes (lower index first) that meet along the mesh."""
    a, b = (found.label[mesh.faces[:, k]].ravel() for k in ([0, 1, 2], [1, 2, 0]))
    both = (a >= 0) & (b >= 0) & (a != b)
    pairs = np.sort(np.column_stack([a[both], b[both]]), axis=1)
    unique, count = np.unique(pairs, axis=0, return_counts=True)
    return {(int(i), int(j)) for (i, j), n in zip(unique, count, strict=True) if n >= _EDGES}


def sizes_between(mesh: Mesh, found: ShapeSet) -> list[ShapeSize]:
    """Distances of parallel planes, diameters and cone angles, angles at edges, distances of axes,
    and how far axes are from planes along them, in this order."""
    out = list[ShapeSize]()
    for k, s in enumerate(found.shapes):
        C = s.covariance
        if s.kind in ("sphere", "cylinder", "torus"):
            out.append(ShapeSize("diameter", k, None, 2 * s.radius, 2 * s.radius_sigma))
        if s.kind == "torus":
            out.append(ShapeSize("tube diameter", k, None, 2 * s.second, 2 * s.second_sigma))
        if s.kind == "cone":
            sigma = 2 * float(np.sqrt(C[6, 6]))
            out.append(ShapeSize("cone angle", k, None, 2 * abs(s.second), sigma))
    meet = neighbours_of(mesh, found)
    for i, j in combinations(range(len(found.shapes)), 2):
        size = _between(found, i, j, (i, j) in meet)
        if size is not None:
            out.append(size)
    return sorted(out, key=lambda size: _ORDER.index(size.kind))


def _between(found: ShapeSet, i: int, j: int, meet: bool) -> ShapeSize | None:
    """The size that two shapes have between them, if they have one."""
    a, b = found.shapes[i], found.shapes[j]
    if "sphere" in (a.kind, b.kind):
        return None
    dot = abs(float(a.axis @ b.axis))
    if a.kind == b.kind == "plane":
        if dot > np.cos(LOOK):
            return _size(found, "distance", i, j, _between_planes)
        return _plane_angle(found, i, j) if meet else None
    if "plane" in (a.kind, b.kind):
        if dot > np.sin(LOOK):
            return None
        return _size(found, "axis to plane", i, j, _axis_to_plane(a.kind == "plane"))
    if dot < np.cos(LOOK):
        return None
    return _axis_distance(found, i, j)


def _size(
    found: ShapeSet, kind: SizeKind, i: int, j: int, of: Callable[[Floats, Floats], float]
) -> ShapeSize:
    q = (found.shapes[i].numbers, found.shapes[j].numbers)
    slope = slope_of(q, lambda a, b: np.array([of(a, b)]))[0]
    variance = float(slope @ joint(found.covariance, i, j) @ slope)
    return ShapeSize(kind, i, j, of(*q), float(np.sqrt(max(variance, 0.0))))


def _plane_angle(found: ShapeSet, i: int, j: int) -> ShapeSize:
    """The angle of two planes; where relations leave nothing unknown of it, that before them, for
    a square that was adopted is no measured angle."""
    q = (found.measured[i].numbers, found.measured[j].numbers)
    slope = slope_of(q, lambda a, b: np.array([_angle(a, b)]))[0]
    own = float(np.sqrt(max(float(slope @ joint(found.own_covariance, i, j) @ slope), 0.0)))
    size = _size(found, "angle", i, j, _angle)
    return size if size.sigma > _FIXED * own else ShapeSize("angle", i, j, _angle(*q), own)


def _axis_distance(found: ShapeSet, i: int, j: int) -> ShapeSize:
    """The distance of two axes before relations: coaxial ones have none after.

    Its uncertainty is that along the way from one to the other; where the way is hardly longer than
    its uncertainty it may go anywhere, and the worst direction counts.
    """
    q = (found.measured[i].numbers, found.measured[j].numbers)
    across: Floats = np.stack(surface.frame(q[0][3:6]))
    slope = slope_of(q, lambda a, b: np.asarray(across @ between_axes(a, b)))
    C = slope @ joint(found.own_covariance, i, j) @ slope.T
    away = across @ between_axes(*q)
    value, worst = float(np.linalg.norm(away)), float(np.sqrt(max(np.linalg.eigvalsh(C)[-1], 0.0)))
    along = float(np.sqrt(max(float(away @ C @ away), 0.0))) / max(value, 1e-12)
    return ShapeSize("axis distance", i, j, value, along if value > _CLEAR * worst else worst)


def slope_of(q: tuple[Floats, Floats], of: Callable[[Floats, Floats], Floats]) -> Floats:
    """(m, 14) how a function (m,) of two shapes' numbers changes with their parameters."""
    slope = np.zeros((len(of(*q)), 14))
    for k in range(14):
        step = np.zeros(7)
        step[k % 7] = 1e-5
        there, back = list(q), list(q)
        there[k // 7] = surface.moved(q[k // 7], step)
        back[k // 7] = surface.moved(q[k // 7], -step)
        slope[:, k] = (of(*there) - of(*back)) / 2e-5
    return slope


def joint(covariance: Floats, i: int, j: int) -> Floats:
    """(14, 14) of two shapes."""
    rows = np.concatenate([np.arange(7) + 7 * i, np.arange(7) + 7 * j])
    return np.asarray(covariance[np.ix_(rows, rows)])


def _between_planes(a: Floats, b: Floats) -> float:
    """Mean of the distances of each plane's middle from the other plane."""
    away = b[:3] - a[:3]
    return (abs(float(away @ a[3:6])) + abs(float(away @ b[3:6]))) / 2


def _axis_to_plane(plane_first: bool) -> Callable[[Floats, Floats], float]:
    """Distance of a plane from an axis along it, in the middle of what was measured of that."""

    def apart(a: Floats, b: Floats) -> float:
        plane, axis = (a, b) if plane_first else (b, a)
        return abs(float((axis[:3] - plane[:3]) @ plane[3:6]))

    return apart


def between_axes(a: Floats, b: Floats) -> Floats:
    """(3,) mm from one axis to the other in the middle between their points."""
    middle = (a[:3] + b[:3]) / 2
    one = a[:3] + ((middle - a[:3]) @ a[3:6]) * a[3:6]
    other = b[:3] + ((middle - b[:3]) @ b[3:6]) * b[3:6]
    return np.asarray(other - one)


def _angle(a: Floats, b: Floats) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a[3:6], b[3:6])), a[3:6] @ b[3:6]))
