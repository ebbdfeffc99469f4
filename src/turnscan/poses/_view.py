"""View: what one pose of a part measured, as points with normals, and from where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, Longs, frozen
from turnscan.errors import InputError
from turnscan.mesh import half_edges
from turnscan.poses._near import cubes_of
from turnscan.surface.fusion import RangeSurface

if TYPE_CHECKING:
    from turnscan.poses._near_kernels import Cubes

_SMOOTH = 2.0
"""Usual spacings over which normals are averaged, at least …"""
_NOISE = 40.0
"""… and this many sigma: a normal is then good to about a degree."""
EDGE = 0.9
"""Length of the mean of normals below which they belong to an edge, not to a surface."""
_COARSE = 30.0
"""Samples across the part, for finding where a view belongs."""


@dataclass(frozen=True)
class View:
    """The surface that one pose measured, in its own frame."""

    name: str
    points: Floats
    """(n, 3) mm."""
    normals: Floats
    """(n, 3) unit, outward; steady against noise."""
    sigma: Floats
    """(n,) mm."""
    eyes: Floats
    """(n, 3) mm: where the camera stood."""
    inner: Bools
    """(n,) True away from borders and edges, where a normal can be trusted."""
    spacing: float
    """mm: the usual distance between points."""

    def __post_init__(self) -> None:
        n = len(self.points)
        put = object.__setattr__
        for name in ("points", "normals", "eyes"):
            put(self, name, frozen(getattr(self, name), (n, 3), f"View.{name}"))
        put(self, "sigma", frozen(self.sigma, (n,), "View.sigma"))
        put(self, "inner", frozen(self.inner, (n,), "View.inner", np.bool_))

    @cached_property
    def cubes(self) -> Cubes:
        """The points by cubes, for the nearest of them."""
        return cubes_of(self.points, self.spacing)

    def nearest(self, places: Floats, reach: float) -> tuple[Floats, Longs]:
        """Distance (m,) mm to the nearest point and its number (m,), of places (m, 3) mm in the
        view's frame; infinite and -1 where none is nearer than ``reach`` mm."""
        from turnscan.poses import _near_kernels as kernels

        return kernels.nearest(self.cubes, np.ascontiguousarray(places), reach)

    @cached_property
    def middle(self) -> Floats:
        """(3,) mm: the mean of the points."""
        middle: Floats = self.points.mean(axis=0)
        return middle

    @property
    def size(self) -> float:
        """mm: diagonal of the box round the points."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))


def view(name: str, surfaces: Sequence[RangeSurface]) -> View:
    """The surfaces of one pose (several lasers, both sides of the axis) as one view.

    Raises InputError where they hold no surface.
    """
    parts = [s for s in surfaces if len(s.mesh.faces)]
    if not parts:
        raise InputError(f"{name}: no surface was measured in this pose", hint="scan it again")
    points = np.concatenate([s.mesh.vertices for s in parts])
    normals = np.concatenate([s.normals for s in parts])
    sigma = np.concatenate([s.sigma for s in parts])
    border = np.concatenate([_border(s) for s in parts])
    sides = np.concatenate([_sides(s) for s in parts])
    spacing = float(np.median(sides)) if len(sides) else 1.0
    cell = max(_SMOOTH * spacing, _NOISE * float(np.median(sigma)))
    mean, length = averaged(points, normals, cell)
    return View(
        name,
        points,
        mean,
        sigma,
        np.concatenate([s.eyes for s in parts]),
        ~border & (length > EDGE),
        spacing,
    )


def _border(s: RangeSurface) -> Bools:
    border = np.zeros(len(s.mesh.vertices), dtype=np.bool_)
    border[np.concatenate(half_edges(s.mesh.faces))] = True
    return border


def _sides(s: RangeSurface) -> Floats:
    """mm: square root of twice the area of the faces, which is their spacing."""
    t = s.mesh.triangles
    area = np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1)
    sides: Floats = np.sqrt(area[area > 0])
    return sides


def averaged(points: Floats, normals: Floats, cell: float) -> tuple[Floats, Floats]:
    """Normals averaged over cubes of ``cell`` mm and their neighbours' halves; their mean's length.

    Two grids of cubes, one shifted by half a cube, and the mean of both: no point is far from the
    middle of both its cubes.
    """
    total = np.zeros_like(points)
    for shift in (0.0, 0.5):
        number, count = cells(points, cell, shift)
        for axis in range(3):
            mean = np.bincount(number, normals[:, axis]) / count
            total[:, axis] += mean[number] / 2
    length = np.linalg.norm(total, axis=1)
    good = length > 1e-9
    return np.where(good[:, None], total / np.maximum(length, 1e-9)[:, None], normals), length


def cells(points: Floats, cell: float, shift: float = 0.0) -> tuple[Ints, Ints]:
    """(n,) number of the cube of ``cell`` mm that each point lies in, and (k,) points in each."""
    at = np.floor(points / cell + shift).astype(np.int64)
    at -= at.min(axis=0)
    size = at.max(axis=0) + 1
    key = (at[:, 0] * size[1] + at[:, 1]) * size[2] + at[:, 2]
    _, number, count = np.unique(key, return_inverse=True, return_counts=True)
    return number.reshape(-1).astype(np.int32), count.astype(np.int32)


def thin(v: View, spacing: float, keep: Bools | None = None) -> Ints:
    """Numbers of points of a view about ``spacing`` mm apart, where ``keep`` (n,) is True.

    In each cube the point nearest to the middle of those in it.
    """
    some = np.arange(len(v.points)) if keep is None else np.flatnonzero(keep)
    if not len(some):
        return np.zeros(0, np.int32)
    X = v.points[some]
    number, count = cells(X, spacing)
    mean = np.stack([np.bincount(number, X[:, k]) / count for k in range(3)], axis=-1)
    away = ((X - mean[number]) ** 2).sum(axis=1)
    order = np.lexsort((away, number))
    first = np.searchsorted(number[order], np.arange(len(count)))
    return some[order[first]].astype(np.int32)


def thinned(v: View, spacing: float) -> View:
    """The view with points about ``spacing`` mm apart; its own spacing is said to be as it was."""
    some = thin(v, spacing)
    return View(
        v.name, v.points[some], v.normals[some], v.sigma[some], v.eyes[some], v.inner[some],
        v.spacing,
    )  # fmt: skip


def coarse(views: Sequence[View]) -> float:
    """mm: spacing of the samples by which views are matched."""
    return max(
        float(np.median([v.size for v in views])) / _COARSE, 2 * max(v.spacing for v in views)
    )
