"""Pixels → points: the camera's ray meets the laser sheet, and the table turns it back."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.points._grid import RangeGrid
from turnscan.rig import LaserSheet, Rig, rotation_z

_SMALL = 1e-3
"""Step of the finite differences of `point_covariance`, in standard deviations."""
_LOCKED = 0.005
"""px by which a centre may swing with its place in the pixel: what rounding to 8 bits does, without
noise, to a stripe of 75 grey levels and 1 to 1.6 px rms (0.006 px rms). The window itself swings by
less than 0.001 px."""


def triangulate(
    rig: Rig, laser: str, pixels: npt.ArrayLike, sigma_px: npt.ArrayLike, *, across: int = 0
) -> tuple[Floats, Floats]:
    """Pixels (..., 2) on the stripe → points (..., 3) mm in the camera frame, and their sigma.

    The undistorted ray d meets the sheet n·X = D at X = d·D/(n·d), or its bent form where the
    sheet has a bow. ``across`` is the pixel coordinate that the stripe's centre was measured in:
    0 (u) for a vertical stripe, 1 (v) for a horizontal one. The second result (...) is
    ``sigma_px`` times the length of ∂X/∂u, mm, the length by which the point moves along the sheet.

    NaN where the pixel is NaN, the lens cannot be inverted or the ray does not meet the sheet.
    Raises KeyError for a laser that the rig does not have.
    """
    sheet = rig.sheet(laser)
    xy = rig.camera.normalised(pixels)
    rays = np.concatenate([xy, np.where(np.isnan(xy[..., :1]), np.nan, 1.0)], axis=-1)
    points = sheet.intersect(rays)
    step = _movement(rig, sheet, xy, rays, points, across)
    sigma: Floats = np.sqrt(np.einsum("...i,...i->...", step, step)) * np.asarray(sigma_px)
    return points, sigma


def _movement(
    rig: Rig, sheet: LaserSheet, xy: Floats, rays: Floats, points: Floats, across: int
) -> Floats:
    """∂X/∂u (..., 3): the ray turns with the pixel, and the point stays on the sheet."""
    turn = np.zeros_like(rays)
    turn[..., :2] = rig.camera.ray_derivatives(xy)[..., :, across]
    normal = sheet.gradient(points)
    with np.errstate(all="ignore"):
        slide = np.einsum("...i,...i->...", normal, turn) / np.einsum(
            "...i,...i->...", normal, rays
        )
        moved: Floats = points[..., 2:] * (turn - rays * slide[..., None])
    return moved


def to_object(rig: Rig, points_camera: npt.ArrayLike, angle: npt.ArrayLike) -> Floats:
    """Points (..., 3) mm in the camera frame → the object's frame, the table frame at angle 0.

    ``angle`` in radians broadcasts against the leading axes: x_object = Rz(−angle) T_table_camera,
    after the axis's own motion, if the rig has one, is undone.
    """
    table = rig.T_camera_table.inverse().apply(points_camera)
    if rig.wobble is None:
        turn = rotation_z(-np.asarray(angle))
    else:
        forth, shift = rig.turning(angle)
        turn, table = np.swapaxes(forth, -1, -2), table - shift
    turned: Floats = np.einsum("...ij,...j->...i", turn, table)
    return turned


def beyond_axis(rig: Rig, laser: str, points_camera: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """(...) True where the sheet was met beyond the rotation axis, seen from the laser's side.

    There the turning table carries the surface through the sheet the other way. The laser is
    taken to stand on the camera's side of the axis.
    """
    return np.asarray(side_of_axis(rig, laser, points_camera) < 0)


def side_of_axis(rig: Rig, laser: str, points_camera: npt.ArrayLike) -> Floats:
    """(...) mm that points (..., 3) of a sheet lie before the axis; negative `beyond_axis`."""
    T = rig.T_camera_table
    axis = T.rotation[:, 2]
    normal = rig.sheet(laser).normal
    along = np.cross(axis, normal)
    along = along if along @ -T.translation > 0 else -along
    return np.asarray((np.asarray(points_camera) - T.translation) @ along)


def point_covariance(rig: Rig, laser: str, pixels: npt.ArrayLike, angles: npt.ArrayLike) -> Floats:
    """Pixels (m, 2) seen at table angles (m,) → covariance (m, 3, 3) mm² that the rig gives them.

    This is the systematic part, common to all points of a scan: the rig's own covariance carried
    through the triangulation by central differences in each of its parameters. It comes on top of
    the stripe's noise. Zero where the rig has no covariance.
    """
    total = np.zeros((len(np.asarray(pixels)), 3, 3))
    for slope in rig_moves(rig, laser, pixels, angles):
        total += slope[:, :, None] * slope[:, None, :]
    return total


def rig_moves(
    rig: Rig, laser: str, pixels: npt.ArrayLike, angles: npt.ArrayLike
) -> Iterator[Floats]:
    """How points seen at pixels (m, 2) and table angles (m,) move with the rig, (m, 3) mm each.

    One field for each principal direction of the rig's covariance, as far as one standard deviation
    along it; independent of each other, and each common to all points. None without a covariance.
    """
    uv = np.asarray(pixels, dtype=np.float64)
    if rig.covariance is None:
        return
    values, vectors = np.linalg.eigh(rig.covariance)
    for value, direction in zip(values, vectors.T, strict=True):
        if value <= 0.0:
            continue
        delta = np.sqrt(value) * _SMALL * direction
        ends = []
        for sign in (1.0, -1.0):
            moved = rig.perturbed(sign * delta)
            X = moved.sheet(laser).intersect(moved.camera.rays(uv))
            ends.append(to_object(moved, X, angles))
        yield (ends[0] - ends[1]) / (2.0 * _SMALL)


def pixel_moves(
    rig: Rig, laser: str, pixels: npt.ArrayLike, angles: npt.ArrayLike, across: int
) -> Iterator[Floats]:
    """How points seen at pixels (m, 2) and table angles (m,) move with the pixels' grid, (m, 3) mm.

    A centre swings about the true one with its place in the pixel, by `_LOCKED` px. What has the
    same place in all pictures, as a round part on the axis has, is off by the same everywhere. How
    the swing lies is not known: there are two fields, one standard deviation each. ``across`` is 0
    where the stripe moves along the rows, 1 along the columns.
    """
    uv = np.asarray(pixels, dtype=np.float64)
    beside = np.zeros(2)
    beside[across] = _SMALL
    sheet, ends = rig.sheet(laser), list[Floats]()
    for sign in (1.0, -1.0):
        X = sheet.intersect(rig.camera.rays(uv + sign * beside))
        ends.append(to_object(rig, X, angles))
    per_pixel = (ends[0] - ends[1]) / (2.0 * _SMALL)
    phase = 2.0 * np.pi * uv[:, across, None]
    for swing in (np.cos(phase), np.sin(phase)):
        yield _LOCKED / np.sqrt(2.0) * swing * per_pixel


def pixels_of(rig: Rig, points: Floats, angles: Floats) -> Floats:
    """Where the camera sees points (m, 3) of the object at table angles (m,): pixels (m, 2)."""
    turn, shift = rig.turning(angles)
    turned = np.einsum("mij,mj->mi", turn, points) + shift
    pixels: Floats = rig.camera.project(rig.T_camera_table.apply(turned))
    return pixels


def systematic_sigma(rig: Rig, grid: RangeGrid, most: int = 500) -> Floats:
    """What the rig's own uncertainty does to points of a grid: (m,) mm, at most ``most`` of them.

    The square root of the trace of `point_covariance`, at points spread evenly over the grid.
    Empty where the rig has no covariance.
    """
    step, line = np.nonzero(grid.found)
    if rig.covariance is None or not len(step):
        return np.zeros(0)
    some = np.unique(np.linspace(0, len(step) - 1, most).astype(np.intp))
    angles = grid.angles[step[some]]
    pixels = pixels_of(rig, grid.points[step[some], line[some]], angles)
    C = point_covariance(rig, grid.laser, pixels, angles)
    spread: Floats = np.sqrt(np.trace(C, axis1=1, axis2=2))
    return spread
