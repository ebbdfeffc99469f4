"""The camera: pinhole, Brown-Conrady lens, non-square pixels, optional Scheimpflug tilt.

Conventions (docs/conventions.md): camera frame x right, y down, z forward; pixel (u, v) = (column,
row) with (0, 0) at the centre of the top-left pixel.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, frozen

_ROUNDS = 60
_SETTLED = 1e-13


@dataclass(frozen=True)
class Camera:
    """Pinhole camera with lens distortion and an optionally tilted sensor (Scheimpflug).

    Brown-Conrady: x″ = x(1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2x²), likewise y″ with
    p1 (r² + 2y²) + 2 p2 x y. The sensor tilt follows the two-angle model that OpenCV calls
    "tilted": rotation by τx about x, then τy about y.
    """

    width: int
    """Columns of the picture, pixels."""
    height: int
    """Rows of the picture, pixels."""
    fx: float
    """Principal distance in pixel widths."""
    fy: float
    """Principal distance in pixel heights; fy ≠ fx for rectangular pixels."""
    cx: float
    """Column of the principal point, pixels."""
    cy: float
    """Row of the principal point, pixels."""
    distortion: Floats = field(default_factory=lambda: np.zeros(5))
    """(5,): k1, k2, p1, p2, k3."""
    tilt: Floats = field(default_factory=lambda: np.zeros(2))
    """(2,): τx, τy, radians."""

    def __post_init__(self) -> None:
        for name in ("width", "height"):
            if not 1 <= getattr(self, name) <= 100_000:
                raise ValueError(f"Camera.{name}: {getattr(self, name)}, expected 1 to 100000")
        for name in ("fx", "fy", "cx", "cy"):
            if not np.isfinite(getattr(self, name)):
                raise ValueError(f"Camera.{name}: {getattr(self, name)} is not a finite number")
        if self.fx <= 0 or self.fy <= 0:
            raise ValueError(f"Camera.fx, fy: {self.fx}, {self.fy}; both must be positive")
        object.__setattr__(self, "distortion", frozen(self.distortion, (5,), "Camera.distortion"))
        object.__setattr__(self, "tilt", frozen(self.tilt, (2,), "Camera.tilt"))

    @property
    def matrix(self) -> Floats:
        """The 3×3 matrix K of the pinhole."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def opencv_distortion(self) -> Floats:
        """Coefficients in OpenCV's order: 5 numbers, or 14 when the sensor is tilted."""
        if not self.tilt.any():
            return self.distortion.copy()
        return np.concatenate([self.distortion, np.zeros(7), self.tilt])

    def project(self, points: npt.ArrayLike) -> Floats:
        """Points (..., 3) in the camera frame, mm → pixels (..., 2); NaN behind the camera."""
        X = np.asarray(points, dtype=np.float64)
        z = np.where(X[..., 2] > 0, X[..., 2], np.nan)
        xy = self._distort(X[..., :2] / z[..., None])
        xy = self._tilted(xy)
        pixels: Floats = xy * (self.fx, self.fy) + (self.cx, self.cy)
        return pixels

    def normalised(self, pixels: npt.ArrayLike) -> Floats:
        """Pixels (..., 2) → undistorted image coordinates (..., 2) on the plane z = 1.

        NaN where the pixel is NaN or where the lens model cannot be inverted (the iteration does
        not come back to the pixel it started from, which happens outside the calibrated field).
        """
        uv = np.asarray(pixels, dtype=np.float64)
        target = self._untilted((uv - (self.cx, self.cy)) / (self.fx, self.fy))
        if not self.distortion.any():
            return target
        return self._undistorted(target)

    def rays(self, pixels: npt.ArrayLike) -> Floats:
        """Pixels (..., 2) → directions (..., 3) in the camera frame with z = 1."""
        xy = self.normalised(pixels)
        return np.concatenate([xy, np.where(np.isnan(xy[..., :1]), np.nan, 1.0)], axis=-1)

    def ray_derivatives(self, xy: npt.ArrayLike) -> Floats:
        """How `normalised` moves with the pixel: (..., 2, 2), ∂(x, y)/∂(u, v).

        ``xy`` (..., 2) are undistorted coordinates, as `normalised` gives them.
        """
        at = np.asarray(xy, dtype=np.float64)
        J = self._distortion_jacobian(at)
        if self.tilt.any():
            J = _homography_jacobian(self._tilt_matrix(), self._distort(at)) @ J
        J = J * np.array([[self.fx], [self.fy]])
        inverse: Floats = np.empty_like(J)
        with np.errstate(all="ignore"):
            det = J[..., 0, 0] * J[..., 1, 1] - J[..., 0, 1] * J[..., 1, 0]
            inverse[..., 0, 0] = J[..., 1, 1] / det
            inverse[..., 1, 1] = J[..., 0, 0] / det
            inverse[..., 0, 1] = -J[..., 0, 1] / det
            inverse[..., 1, 0] = -J[..., 1, 0] / det
        return inverse

    def _distortion_jacobian(self, xy: Floats) -> Floats:
        k1, k2, p1, p2, k3 = self.distortion
        x, y = xy[..., 0], xy[..., 1]
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2.0 * (k1 + r2 * (2 * k2 + 3 * r2 * k3))
        J = np.empty((*x.shape, 2, 2))
        J[..., 0, 0] = radial + slope * x * x + 2 * p1 * y + 6 * p2 * x
        J[..., 1, 1] = radial + slope * y * y + 6 * p1 * y + 2 * p2 * x
        J[..., 0, 1] = J[..., 1, 0] = slope * x * y + 2 * p1 * x + 2 * p2 * y
        return J

    def _distort(self, xy: Floats) -> Floats:
        k1, k2, p1, p2, k3 = self.distortion
        x, y = xy[..., 0], xy[..., 1]
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return np.stack(
            [
                x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
                y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
            ],
            axis=-1,
        )

    def _undistorted(self, target: Floats) -> Floats:
        """Newton's method on the 2×2 system distort(xy) = target, all points at once."""
        xy = target.copy()
        with np.errstate(all="ignore"):
            for _ in range(_ROUNDS):
                J = self._distortion_jacobian(xy)
                jxx, jxy, jyy = J[..., 0, 0], J[..., 0, 1], J[..., 1, 1]
                error = self._distort(xy) - target
                det = jxx * jyy - jxy * jxy
                step = np.stack(
                    [
                        (jyy * error[..., 0] - jxy * error[..., 1]) / det,
                        (jxx * error[..., 1] - jxy * error[..., 0]) / det,
                    ],
                    axis=-1,
                )
                xy = xy - step
                if not np.nanmax(np.abs(step), initial=0.0) > _SETTLED:
                    break
            # A fold of the lens polynomial has det <= 0: the pixel there has no single ray.
            wrong = (np.abs(self._distort(xy) - target).max(axis=-1) > 1e-9) | ~(det > 0)
        return np.where(wrong[..., None], np.nan, xy)

    def _tilt_matrix(self) -> Floats:
        tx, ty = self.tilt
        Rx = np.array([[1, 0, 0], [0, np.cos(tx), np.sin(tx)], [0, -np.sin(tx), np.cos(tx)]])
        Ry = np.array([[np.cos(ty), 0, -np.sin(ty)], [0, 1, 0], [np.sin(ty), 0, np.cos(ty)]])
        R = Ry @ Rx
        back = np.array([[R[2, 2], 0.0, -R[0, 2]], [0.0, R[2, 2], -R[1, 2]], [0.0, 0.0, 1.0]])
        return np.asarray(back @ R, dtype=np.float64)

    def _tilted(self, xy: Floats) -> Floats:
        return xy if not self.tilt.any() else _homography(self._tilt_matrix(), xy)

    def _untilted(self, xy: Floats) -> Floats:
        if not self.tilt.any():
            return xy
        return _homography(np.linalg.inv(self._tilt_matrix()).astype(np.float64), xy)


def _homography(H: Floats, xy: Floats) -> Floats:
    moved = np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1) @ H.T
    result: Floats = moved[..., :2] / moved[..., 2:]
    return result


def _homography_jacobian(H: Floats, xy: Floats) -> Floats:
    moved = np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1) @ H.T
    w = moved[..., 2, None, None]
    J: Floats = (H[:2, :2] - (moved[..., :2, None] / w) * H[2, :2]) / w
    return J
