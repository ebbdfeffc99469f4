"""Predicted pixels and their derivatives: a point through the lens, a stripe on a plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.rig import Camera, LaserSheet

CAMERA_SIZE = 11
"""Parameters of the camera in `Rig.parameter_names`; the last two (tilt) have no derivative here:
a tilted sensor keeps its tilt."""


def lens(camera: Camera, xy: Floats) -> tuple[Floats, Floats, Floats]:
    """Pixels of image coordinates (n, 2), their derivative by xy (n, 2, 2) and by the camera
    (n, 2, 11)."""
    k1, k2, p1, p2, k3 = camera.distortion
    x, y = xy[:, 0], xy[:, 1]
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    slope = 2 * (k1 + r2 * (2 * k2 + 3 * r2 * k3))
    bent = np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ],
        axis=1,
    )
    f = np.array([camera.fx, camera.fy])
    by_xy = np.empty((len(x), 2, 2))
    by_xy[:, 0, 0] = radial + slope * x * x + 2 * p1 * y + 6 * p2 * x
    by_xy[:, 1, 1] = radial + slope * y * y + 6 * p1 * y + 2 * p2 * x
    by_xy[:, 0, 1] = by_xy[:, 1, 0] = slope * x * y + 2 * p1 * x + 2 * p2 * y
    by_xy *= f[:, None]
    by_camera = np.zeros((len(x), 2, CAMERA_SIZE))
    by_camera[:, 0, 0] = bent[:, 0]
    by_camera[:, 1, 1] = bent[:, 1]
    by_camera[:, 0, 2] = by_camera[:, 1, 3] = 1.0
    for column, power in ((4, r2), (5, r2**2), (8, r2**3)):
        by_camera[:, :, column] = f * xy * power[:, None]
    by_camera[:, :, 6] = f * np.stack([2 * x * y, r2 + 2 * y * y], axis=1)
    by_camera[:, :, 7] = f * np.stack([r2 + 2 * x * x, 2 * x * y], axis=1)
    return bent * f + (camera.cx, camera.cy), by_xy, by_camera


def point_term(camera: Camera, points: Floats) -> tuple[Floats, Floats, Floats]:
    """Points (n, 3) in the camera frame → pixels (n, 2), derivative by the point (n, 2, 3) and by
    the camera (n, 2, 11)."""
    z = points[:, 2]
    xy = points[:, :2] / z[:, None]
    pixels, by_xy, by_camera = lens(camera, xy)
    flat = np.zeros((len(z), 2, 3))
    flat[:, 0, 0] = flat[:, 1, 1] = 1 / z
    flat[:, :, 2] = -xy / z[:, None]
    return pixels, by_xy @ flat, by_camera


@dataclass(frozen=True)
class Traced:
    """Pixels followed back through the lens."""

    xy: Floats
    """(n, 2) image coordinates."""
    by_pixel: Floats
    """(n, 2, 2) derivative of xy by the pixel."""
    lens_by_camera: Floats
    """(n, 2, 11) derivative of the pixel by the camera, xy fixed."""

    @property
    def rays(self) -> Floats:
        """(n, 3) directions in the camera frame with z = 1."""
        return np.concatenate([self.xy, np.ones((len(self.xy), 1))], axis=1)

    def part(self, some: slice | npt.NDArray[np.intp]) -> Traced:
        """Some of the pixels."""
        return Traced(self.xy[some], self.by_pixel[some], self.lens_by_camera[some])


def trace(camera: Camera, pixels: Floats) -> Traced:
    """Follow pixels (n, 2) back through the lens; many at once are much faster than one by one."""
    xy = camera.normalised(pixels)
    _, by_xy, by_camera = lens(camera, xy)
    back: Floats = np.linalg.inv(by_xy).astype(np.float64)
    return Traced(xy, back, by_camera)


@dataclass(frozen=True)
class StripeTerm:
    """A stripe on a plane: how far it is from the sheet, in pixels and in mm."""

    residual: Floats
    """(n,) px along the measuring direction, observed minus predicted."""
    distance: Floats
    """(n,) mm from the sheet."""
    points: Floats
    """(n, 3) mm, camera frame."""
    by_camera: Floats
    """(n, 11)"""
    by_sheet: Floats
    """(n, 6)"""
    by_normal: Floats
    """(n, 3) by the plane's normal."""
    by_point: Floats
    """(n, 3) by the plane's point."""


def stripe_term(
    sheet: LaserSheet,
    seen: Traced,
    direction: Floats,
    normal: Floats,
    point: Floats,
) -> StripeTerm:
    """Where a stripe seen by the rays ``seen`` (n) on the plane (``normal``, ``point``) should be.

    ``point`` is (3,), or (n, 3) where the surface is nearly but not quite a plane; ``normal`` is
    (3,), or (n, 3) where there are several planes.

    ``direction`` (2,) is the picture direction in which the stripe was located: (1, 0) for one
    centre per row. The ray meets the plane in a point; its distance from the sheet, divided by how
    fast that distance changes along ``direction``, is the residual in pixels
    (docs/explain/calibration.md).
    """
    d = seen.rays
    across = _dot(d, normal)
    X = d * (_dot(point, normal) / across)[:, None]
    e1, e2 = sheet.axes
    rel = X - sheet.centre
    a, b = rel @ e1, rel @ e2
    q = sheet.bow
    distance = rel @ sheet.normal - (q[0] * a * a + q[1] * a * b + q[2] * b * b)
    grad = (
        sheet.normal
        - (2 * q[0] * a + q[1] * b)[:, None] * e1
        - (q[1] * a + 2 * q[2] * b)[:, None] * e2
    )
    # dX/dd = λ (1 − d nᵀ / n·d), with λ the depth: moving the pixel moves X within the plane.
    depth = X[:, 2]
    along = (grad * d).sum(axis=1) / across
    by_ray = depth[:, None] * (grad - along[:, None] * normal)
    by_pixel = np.einsum("ni,nij->nj", by_ray[:, :2], seen.by_pixel)
    speed = by_pixel @ direction
    scale = -1.0 / speed
    by_camera = -np.einsum("nj,njk->nk", by_pixel, seen.lens_by_camera)
    by_sheet = np.stack([-b, a, -np.ones_like(a), -a * a, -a * b, -b * b], axis=1)
    return StripeTerm(
        residual=distance / speed,
        distance=distance,
        points=X,
        by_camera=by_camera * scale[:, None],
        by_sheet=by_sheet * scale[:, None],
        by_normal=(along * scale)[:, None] * (point - X),
        by_point=(along * scale)[:, None] * normal,
    )


def _dot(a: Floats, b: Floats) -> Floats:
    """Of vectors (…, 3), either of which may be one for all."""
    product: Floats = np.einsum("...i,...i->...", a, b)
    return product
