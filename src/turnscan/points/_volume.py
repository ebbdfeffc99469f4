"""The working volume: what is kept of a scan, so that back wall and platter disappear."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, handed_over
from turnscan.errors import Degenerate
from turnscan.mesh._point_cloud import PointCloud
from turnscan.points._grid import RangeGrid
from turnscan.points._triangulate import beyond_axis
from turnscan.rig import Rig
from turnscan.stripes import StripeFlag

_BORDER = 64
"""Pixels cast along each side of the picture to find how far the camera sees."""
_APART = 5.0
"""Combined sigma beyond which two depths are two surfaces (docs/explain/surface.md)."""
_ABSENT = StripeFlag.DARK | StripeFlag.OUTSIDE | StripeFlag.AMBIGUOUS
"""Why a point is missing; the other flags tell about the light, which was there."""


@dataclass(frozen=True)
class Volume:
    """A cylinder about the rotation axis, in the table frame."""

    r_max: float = float("inf")
    """mm from the axis."""
    z_min: float = float("-inf")
    """mm above the platter."""
    z_max: float = float("inf")
    """mm above the platter."""

    def __post_init__(self) -> None:
        if not (self.r_max > 0 and self.z_max > self.z_min):
            raise ValueError(
                f"Volume: r_max {self.r_max}, z from {self.z_min} to {self.z_max} holds no point"
            )

    def __str__(self) -> str:
        """In words, for findings."""
        low = "" if np.isneginf(self.z_min) else f", height from {self.z_min:.2f} mm"
        high = "" if np.isposinf(self.z_max) else f", height up to {self.z_max:.2f} mm"
        return f"radius {self.r_max:.1f} mm{low}{high}"

    def contains(self, points: npt.ArrayLike) -> Bools:
        """(...) True where a point (..., 3) of the object's or table frame lies inside."""
        X = np.asarray(points, dtype=np.float64)
        z = X[..., 2]
        with np.errstate(invalid="ignore"):
            near = X[..., 0] ** 2 + X[..., 1] ** 2 <= self.r_max**2
            return np.asarray(near & (z >= self.z_min) & (z <= self.z_max))


def working_volume(rig: Rig, laser: str, *, platter_margin: float = 2.0) -> Volume:
    """The volume that a rig can measure all the way round, without the platter itself.

    The radius is the largest at which the camera sees the sheet on the near side of the axis
    (R_max of the paper); where markers ride on the platter it is no more than the ring they stand
    on, for what lies further out is not on the table. ``platter_margin`` mm above z = 0 are the
    platter.

    Raises Degenerate where the camera sees the sheet nowhere but on the axis, or stands on it.
    """
    side = np.linspace(0.0, 1.0, _BORDER)
    w, h = rig.camera.width - 1.0, rig.camera.height - 1.0
    zero, one = np.zeros(_BORDER), np.ones(_BORDER)
    edges = [(side, zero), (side, one), (zero, side), (one, side)]
    pixels = np.concatenate([np.stack([u * w, v * h], axis=-1) for u, v in edges])
    X = rig.sheet(laser).intersect(rig.camera.rays(pixels))
    near = X[~np.isnan(X[:, 0])]
    near = near[~beyond_axis(rig, laser, near)]
    reach = float("inf")
    if len(near):
        table = rig.T_camera_table.inverse().apply(near)
        eye = rig.T_camera_table.inverse().translation
        reach = min(float(np.hypot(table[:, 0], table[:, 1]).max()), float(np.hypot(*eye[:2])))
    if rig.markers:
        corners = np.concatenate([m.corners for m in rig.markers])
        reach = min(reach, float(np.hypot(corners[:, 0], corners[:, 1]).max()))
    if not reach > 0:
        raise Degenerate(
            f"laser {laser!r}: this rig can measure at no distance from the rotation axis",
            hint="the camera must stand beside the axis and see the laser's sheet before it: check "
            "the rig",
        )
    return Volume(r_max=reach, z_min=platter_margin)


def clip(grid: RangeGrid, volume: Volume) -> RangeGrid:
    """The grid with every point outside ``volume`` missing, flagged OUTSIDE.

    Where the volume leaves the platter out (``z_min`` above 0), a point that may as well lie on it
    is outside: one less than `_APART` of its sigma above it. At a part's foot the light that goes
    to and fro between part and platter leads a stripe from the one to the other.
    """
    keep = volume.contains(grid.points)
    if volume.z_min > 0:
        with np.errstate(invalid="ignore"):
            keep &= ~(grid.points[..., 2] < _APART * grid.sigma)
    return without(grid, grid.found & ~keep, StripeFlag.OUTSIDE)


def without(grid: RangeGrid, drop: Bools, cause: StripeFlag) -> RangeGrid:
    """The grid with the points where ``drop`` (s, n) is True missing, flagged with the cause.

    What was known about their light (clipped, haloed …) stays known.
    """

    if not drop.any():
        return grid

    def gone(values: Floats) -> Floats:
        out = values.copy()
        out[drop] = np.nan
        return handed_over(out, nan=True)

    flags = grid.flags.copy()
    flags[drop] = (flags[drop] & np.uint16(~_ABSENT & 0xFFFF)) | np.uint16(cause)
    return replace(
        grid,
        points=gone(grid.points),
        sigma=gone(grid.sigma),
        amplitude=gone(grid.amplitude),
        flags=handed_over(flags),
    )


def drop_specks(grid: RangeGrid, shortest: int) -> RangeGrid:
    """The grid without runs of fewer than ``shortest`` points in a profile, flagged AMBIGUOUS.

    A run is points in successive lines. A glint or a stray pixel gives a short one; a surface
    does not.
    """
    found = grid.found
    length = _run_lengths(found)
    return without(grid, found & (length < shortest), StripeFlag.AMBIGUOUS)


def _run_lengths(found: Bools) -> npt.NDArray[np.intp]:
    """(s, n): for every point, the length of the run of points that it belongs to."""
    s, n = found.shape
    padded = np.zeros((s, n + 1), dtype=np.int8)
    padded[:, :n] = found
    change = np.diff(padded.ravel(), prepend=0)
    starts, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    out = np.zeros(s * (n + 1), dtype=np.intp)
    inside = padded.ravel().astype(bool)
    out[inside] = np.repeat(ends - starts, ends - starts)
    return out.reshape(s, n + 1)[:, :n]


def cloud(grids: Iterable[RangeGrid]) -> PointCloud:
    """All points of the grids as one loose cloud with their provenance."""
    parts = list(grids)
    at = [np.nonzero(g.found) for g in parts]
    none = np.zeros(0)
    pairs = list(zip(parts, at, strict=True))
    return PointCloud(
        points=np.concatenate([np.zeros((0, 3)), *(g.points[i] for g, i in pairs)]),
        sigma=np.concatenate([none, *(g.sigma[i] for g, i in pairs)]),
        laser=np.repeat(np.arange(len(parts)), [len(i[0]) for i in at]).astype(np.int32),
        step=np.concatenate([none, *(g.steps[i[0]] for g, i in pairs)]).astype(np.int32),
        line=np.concatenate([none, *(i[1] for i in at)]).astype(np.int32),
        lasers=tuple(g.laser for g in parts),
    )
