"""Surfaces that faces of a solid lie on: B-splines over a plane, analytic shapes, and facets.

All tell where a point lies on them in their own parameters, which is what a trimmed face needs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from turnscan.arrays import Floats
from turnscan.shapes.primitives import Shape, normals_and_distances

DEGREE = 3
_LINE = 1e-9
"""Of the square of its longest side: a triangle of less area is a line."""


def greville(knots: Floats) -> Floats:
    """(n,) where control points stand over a line that a B-spline runs along evenly."""
    return np.asarray(np.convolve(knots[1:-1], np.ones(DEGREE), "valid") / DEGREE)


@dataclass(frozen=True, eq=False)
class SplinePatch:
    """A height over a plane as a tensor-product B-spline: (u, v) are mm in the plane.

    So the surface is linear in u and v but for its height, and the projection of a space curve
    onto the plane is its parameter curve, exactly.
    """

    origin: Floats
    """(3,) mm."""
    axes: Floats
    """(3, 3): unit rows along u, along v, and up, which is outward."""
    knots: tuple[Floats, Floats]
    """Of u and of v, mm, clamped."""
    height: Floats
    """(nu, nv) mm: heights of the control points."""

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import NdBSpline

        return NdBSpline(self.knots, self.height, DEGREE)

    def parameters(self, points: Floats) -> Floats:
        """(n, 2): u and v of points (n, 3) mm."""
        uv: Floats = (points - self.origin) @ self.axes[:2].T
        return uv

    def offsets(self, points: Floats) -> tuple[Floats, Floats]:
        """(n,) mm that points lie outside, to first order, and (n, 3) unit normals there."""
        uv = self._inside(points)
        up = (points - self.origin) @ self.axes[2] - self._spline(uv)
        slope = np.column_stack([self._spline(uv, nu=(1, 0)), self._spline(uv, nu=(0, 1))])
        steep = np.sqrt(1.0 + np.sum(slope**2, axis=1))
        normal = (self.axes[2] - slope @ self.axes[:2]) / steep[:, None]
        return up / steep, normal

    def gaps(self, points: Floats) -> Floats:
        """(n,) mm between points (n, 3) and the places of the surface with their parameters."""
        up = (points - self.origin) @ self.axes[2]
        return np.asarray(np.abs(up - self._spline(self._inside(points))))

    def _inside(self, points: Floats) -> Floats:
        """(n, 2): parameters, those off the end of the surface moved to it."""
        low, high = np.array([(t[0], t[-1]) for t in self.knots]).T
        return np.clip(self.parameters(points), low, high)

    @property
    def control(self) -> Floats:
        """(nu, nv, 3) mm: the control points."""
        u, v = map(greville, self.knots)
        plane = u[:, None, None] * self.axes[0] + v[None, :, None] * self.axes[1]
        return np.asarray(self.origin + plane + self.height[..., None] * self.axes[2])


@dataclass(frozen=True, eq=False)
class ShapePatch:
    """A part of an analytic shape, with the seam of its parameters on the far side."""

    shape: Shape
    origin: Floats
    """(3,) mm: a point of a plane or an axis, a centre."""
    axes: Floats
    """(3, 3): unit rows; u runs from the first to the second about the third."""

    def parameters(self, points: Floats) -> Floats:
        """(n, 2): u and v of points (n, 3) mm, as OpenCASCADE counts them."""
        x, y, z = ((points - self.origin) @ self.axes.T).T
        s = self.shape
        if s.kind == "plane":
            return np.column_stack([x, y])
        u, r = np.mod(np.arctan2(y, x), 2 * np.pi), np.hypot(x, y)
        if s.kind == "cylinder":
            v = z
        elif s.kind == "cone":
            v = z * np.cos(s.second) + (r - s.radius) * np.sin(s.second)
        elif s.kind == "sphere":
            v = np.arctan2(z, r)
        else:
            v = np.arctan2(z, r - s.radius)
            v = v[0] + np.mod(v - v[0] + np.pi, 2 * np.pi) - np.pi
        return np.column_stack([u, v])

    def offsets(self, points: Floats) -> tuple[Floats, Floats]:
        """(n,) mm that points lie outside of the material, and (n, 3) unit normals there."""
        return normals_and_distances(self.shape, points)

    def gaps(self, points: Floats) -> Floats:
        """(n,) mm between points (n, 3) and the places of the surface with their parameters."""
        return np.abs(self.offsets(points)[0])


@dataclass(frozen=True, eq=False)
class FlatPatch:
    """The plane of a triangle: a facet."""

    origin: Floats
    """(3,) mm."""
    axes: Floats
    """(3, 3): unit rows along u, along v, and outward."""

    def parameters(self, points: Floats) -> Floats:
        """(n, 2): u and v, mm, of points (n, 3) mm."""
        uv: Floats = (points - self.origin) @ self.axes[:2].T
        return uv

    def offsets(self, points: Floats) -> tuple[Floats, Floats]:
        """(n,) mm that points lie outside of the material, and (n, 3) unit normals there."""
        off: Floats = (points - self.origin) @ self.axes[2]
        return off, np.tile(self.axes[2], (len(points), 1))

    def gaps(self, points: Floats) -> Floats:
        """(n,) mm between points (n, 3) and the plane."""
        return np.asarray(np.abs((points - self.origin) @ self.axes[2]))


def flat_patch(corners: Floats) -> FlatPatch | None:
    """The plane of a triangle (3, 3) mm, counter-clockwise from outside; None where its corners
    lie on a line."""
    a, b = corners[1] - corners[0], corners[2] - corners[0]
    across = np.cross(a, b)
    length = float(np.linalg.norm(across))
    if length <= _LINE * float(max(a @ a, b @ b)):
        return None
    return FlatPatch(corners[0], _frame(across / length, a))


def patch_of_shape(shape: Shape, points: Floats) -> ShapePatch:
    """The part of a shape about points (n, 3) mm on it, which turn by less than half a turn."""
    middle = points.mean(axis=0)
    if shape.kind == "plane":
        return ShapePatch(shape, shape.point, _frame(shape.axis, None))
    away = middle - shape.point
    if shape.kind == "sphere":
        out = away / max(float(np.linalg.norm(away)), 1e-300)
        return ShapePatch(shape, shape.point, _frame(_frame(out, None)[0], -out))
    away = away - (away @ shape.axis) * shape.axis
    return ShapePatch(shape, shape.point, _frame(shape.axis, -away))


def _frame(axis: Floats, first: Floats | None) -> Floats:
    """(3, 3) right-handed unit rows, the last ``axis``, the first towards ``first`` if given."""
    if first is None:
        first = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = first - (first @ axis) * axis
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis])
