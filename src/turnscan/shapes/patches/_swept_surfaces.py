"""Surfaces of one profile, a B-spline: drawn along a direction, or turned about an axis.

Both take the height of a profile over a line, so that what the profile counts in is mm along it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from turnscan.arrays import Floats
from turnscan.shapes.patches._fit import Sample, fitted_profile
from turnscan.shapes.patches._surfaces import DEGREE, greville

_ACROSS = 0.5
"""Cosine between the normals of a piece and the direction across its sweep that all must reach,
nearly: where they lean further, its profile is no height."""
_NEARLY = 0.01
"""Share of them that may lean further."""


@dataclass(frozen=True, eq=False)
class _Profile:
    """A frame, and in it a height over a line as a B-spline."""

    origin: Floats
    """(3,) mm."""
    axes: Floats
    """(3, 3): unit rows."""
    knots: Floats
    """mm, clamped."""
    height: Floats
    """(n,) mm of the control points."""

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import BSpline

        return BSpline(self.knots, self.height, DEGREE)

    def _off(self, along: Floats, height: Floats) -> tuple[Floats, Floats, Floats]:
        """(n,) mm above the profile, its slope, and one over the length of (1, slope)."""
        at = np.clip(along, self.knots[0], self.knots[-1])
        slope = np.asarray(self._spline(at, 1))
        return np.asarray(height - self._spline(at)), slope, 1.0 / np.sqrt(1.0 + slope**2)

    def _poles(self, along: Floats, up: Floats) -> Floats:
        flat = greville(self.knots)[:, None] * along
        return np.asarray(self.origin + flat + self.height[:, None] * up)


@dataclass(frozen=True, eq=False)
class ExtrudedPatch(_Profile):
    """A profile drawn along a direction. Rows of ``axes``: along the profile (u), the direction
    (v), and up, which is outward; the surface is linear in u and v but for its height."""

    def parameters(self, points: Floats) -> Floats:
        """(n, 2): u and v, mm, of points (n, 3) mm."""
        uv: Floats = (points - self.origin) @ self.axes[:2].T
        return uv

    def offsets(self, points: Floats) -> tuple[Floats, Floats]:
        """(n,) mm that points lie outside, to first order, and (n, 3) unit normals there."""
        x = (points - self.origin) @ self.axes.T
        up, slope, flat = self._off(x[:, 0], x[:, 2])
        normal = (self.axes[2] - slope[:, None] * self.axes[0]) * flat[:, None]
        return up * flat, normal

    def gaps(self, points: Floats) -> Floats:
        """(n,) mm between points (n, 3) and the places of the surface with their parameters."""
        x = (points - self.origin) @ self.axes.T
        return np.asarray(np.abs(self._off(x[:, 0], x[:, 2])[0]))

    @property
    def profile(self) -> Floats:
        """(n, 3) mm: the control points of the profile at v = 0."""
        return self._poles(self.axes[0], self.axes[2])


@dataclass(frozen=True, eq=False)
class TurnedPatch(_Profile):
    """A radius over an axis. Rows of ``axes``: u turns from the first, on the far side of the
    piece, to the second about the third, along which v counts mm."""

    hollow: bool
    """Whether the material is outside."""

    def parameters(self, points: Floats) -> Floats:
        """(n, 2): u, radians in 0 to 2π, and v, mm, of points (n, 3) mm."""
        x, y, z = ((points - self.origin) @ self.axes.T).T
        return np.column_stack([np.mod(np.arctan2(y, x), 2 * np.pi), z])

    def offsets(self, points: Floats) -> tuple[Floats, Floats]:
        """(n,) mm that points lie outside, to first order, and (n, 3) unit normals there."""
        x = (points - self.origin) @ self.axes.T
        r = np.hypot(x[:, 0], x[:, 1])
        away, slope, flat = self._off(x[:, 2], r)
        out = x[:, :2] / np.maximum(r, 1e-300)[:, None] @ self.axes[:2]
        normal = (out - slope[:, None] * self.axes[2]) * flat[:, None]
        side = -1.0 if self.hollow else 1.0
        return side * away * flat, side * normal

    def gaps(self, points: Floats) -> Floats:
        """(n,) mm between points (n, 3) and the places of the surface with their parameters."""
        x = (points - self.origin) @ self.axes.T
        return np.asarray(np.abs(self._off(x[:, 2], np.hypot(x[:, 0], x[:, 1]))[0]))

    @property
    def profile(self) -> Floats:
        """(n, 3) mm: the control points of the profile at u = 0."""
        return self._poles(self.axes[2], self.axes[0])


SweptPatch = ExtrudedPatch | TurnedPatch


def extruded_patch(sample: Sample, way: Floats, up: Floats) -> ExtrudedPatch | None:
    """The extrusion along the unit vector ``way`` (3,) through a piece that looks ``up`` (3,).

    None where it looks along the sweep, or where its profile is no height.
    """
    up = up - (up @ way) * way
    length = float(np.linalg.norm(up))
    if length < _ACROSS:
        return None
    axes = np.stack([np.cross(way, up / length), way, up / length])
    origin = sample.points.mean(axis=0)
    x = (sample.points - origin) @ axes.T
    fit = _fitted(sample, x[:, 0], x[:, 2], sample.normals @ axes[2])
    return None if fit is None else ExtrudedPatch(origin, axes, *fit)


def turned_patch(sample: Sample, point: Floats, axis: Floats) -> TurnedPatch | None:
    """The surface of revolution about an axis, a unit vector (3,), through a piece beside it.

    None where the piece looks along the axis, goes more than half round it, or has no radius for
    some place of it.
    """
    away = sample.points - point
    out = away - (away @ axis)[:, None] * axis
    r = np.linalg.norm(out, axis=1)
    middle = out.mean(axis=0)
    far = float(np.linalg.norm(middle))
    if r.min() <= 0 or far < _ACROSS * r.mean():
        return None
    x = -middle / far
    axes = np.stack([x, np.cross(axis, x), axis])
    lean = np.einsum("ij,ij->i", sample.normals, out / r[:, None])
    hollow = bool(lean.mean() < 0)
    fit = _fitted(sample, away @ axis, r, -lean if hollow else lean)
    if fit is None or fit[1].min() <= 0:
        return None
    return TurnedPatch(point, axes, *fit, hollow)


def _fitted(
    sample: Sample, along: Floats, height: Floats, lean: Floats
) -> tuple[Floats, Floats] | None:
    """Knots and heights of the profile, of points whose normals have these cosines with up."""
    if float(np.quantile(lean[sample.within], _NEARLY)) < _ACROSS:
        return None
    return fitted_profile(along, height, sample.weight(lean), float(np.median(sample.sigma)))
