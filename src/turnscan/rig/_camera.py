"""The camera: pinhole, Brown-Conrady lens, non-square pixels, optional Scheimpflug tilt.

Conventions (docs/conventions.md): camera frame x right, y down, z forward; pixel (u, v) = (column,
row) with (0, 0) at the centre of the top-left pixel.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, frozen

_ROUNDS = 30
_SETTLED = 1e-13
_CLOSED = 1e-9
_BLOCK = 8192
_SAMPLES = 257
_FLAT = 0.05


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
        """Points (..., 3) in the camera frame, mm → pixels (..., 2).

        NaN behind the camera, and so far aside that the lens polynomial has turned back on itself:
        it would put such points into the picture as ghosts.
        """
        X = np.asarray(points, dtype=np.float64)
        z = np.where(X[..., 2] > 0, X[..., 2], np.nan)
        with np.errstate(over="ignore", invalid="ignore"):
            xy = X[..., :2] / z[..., None]
            if self.distortion.any():
                known = self._before_fold(xy[..., 0], xy[..., 1])
                xy = self._distort(np.where(known[..., None], xy, np.nan))
            xy = self._tilted(xy)
        pixels: Floats = xy * (self.fx, self.fy) + (self.cx, self.cy)
        return pixels

    def normalised(self, pixels: npt.ArrayLike) -> Floats:
        """Pixels (..., 2) → undistorted image coordinates (..., 2) on the plane z = 1.

        NaN where the pixel is NaN or infinite, and where the lens model cannot be inverted: no
        direction before the polynomial's fold leads to that pixel.
        """
        uv = np.asarray(pixels, dtype=np.float64)
        uv = np.where(np.isfinite(uv), uv, np.nan)
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
        J = np.empty((*xy.shape[:-1], 2, 2))
        J[..., 0, 0], J[..., 0, 1], J[..., 1, 1] = self._lens_slopes(xy[..., 0], xy[..., 1])
        J[..., 1, 0] = J[..., 0, 1]
        return J

    def _distort(self, xy: Floats) -> Floats:
        return np.stack(self._lens(xy[..., 0], xy[..., 1]), axis=-1)

    def _lens(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Undistorted (x, y) → distorted (x, y)."""
        k1, k2, p1, p2, k3 = self.distortion
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return (
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        )

    def _lens_slopes(self, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        """The lens's derivatives ∂x/∂x, ∂x/∂y = ∂y/∂x and ∂y/∂y at undistorted (x, y)."""
        k1, k2, p1, p2, k3 = self.distortion
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2.0 * (k1 + r2 * (2 * k2 + 3 * r2 * k3))
        return (
            radial + slope * x * x + 2 * p1 * y + 6 * p2 * x,
            slope * x * y + 2 * p1 * x + 2 * p2 * y,
            radial + slope * y * y + 6 * p1 * y + 2 * p2 * x,
        )

    @cached_property
    def _fold(self) -> float:
        """The r² at which the radial polynomial all but stops growing; infinite when it never does.

        At a twentieth of its slope in the middle a pixel says nothing any more, and the tangential
        terms may already have turned the lens back on itself.
        """
        k1, k2, _, _, k3 = self.distortion
        # As a polynomial in 1/r² it starts with a constant, so that tiny coefficients do no harm.
        roots = np.roots([1.0 - _FLAT, 3 * k1, 5 * k2, 7 * k3])
        real = roots[np.abs(roots.imag) <= 1e-12 * np.abs(roots)].real
        nearest = float(np.max(real, initial=0.0))
        return 1 / nearest if nearest > 1e-300 else np.inf

    def _before_fold(self, x: Floats, y: Floats) -> Bools:
        """Where the lens is one to one: before the radial fold, and not yet turned inside out."""
        jxx, jxy, jyy = self._lens_slopes(x, y)
        return (jxx * jyy > jxy * jxy) & (x * x + y * y < self._fold)

    def _undistorted(self, target: Floats) -> Floats:
        """Undo the lens for target (..., 2), in blocks that stay in the processor's cache."""
        x, y = target[..., 0].ravel(), target[..., 1].ravel()
        far = float(np.nanmax(np.hypot(x, y), initial=0.0))
        radii = self._radii(far) if np.isfinite(far) else (np.zeros(2), np.zeros(2))
        blocks = range(0, len(x), _BLOCK)
        solved = [self._newton(x[i : i + _BLOCK], y[i : i + _BLOCK], *radii) for i in blocks]
        return np.concatenate([*solved, np.empty((0, 2))]).reshape(target.shape)

    def _radii(self, far: float) -> tuple[Floats, Floats]:
        """Undistorted radii up to the fold, or to where they reach ``far``, and the lens of them.

        Both increase, so that a distorted radius can be looked up whatever the polynomial.
        """
        k1, k2, _, _, k3 = self.distortion
        fold, top = np.sqrt(self._fold), 1.0
        while top < fold and top * (1.0 + top**2 * (k1 + top**2 * (k2 + top**2 * k3))) < far:
            top *= 2.0
        r = np.linspace(0.0, min(top, fold), _SAMPLES)
        return r, r * (1.0 + r**2 * (k1 + r**2 * (k2 + r**2 * k3)))

    def _newton(self, x_lens: Floats, y_lens: Floats, radii: Floats, lens: Floats) -> Floats:
        """Newton's method on lens(x, y) = (x_lens, y_lens), every point until it has settled.

        It starts where the radial polynomial alone would have its first root. NaN where that does
        not lead back to the target before the fold.
        """
        distorted = np.hypot(x_lens, y_lens)
        with np.errstate(invalid="ignore", divide="ignore"):
            scale = np.where(distorted > 0, np.interp(distorted, lens, radii) / distorted, 1.0)
        x, y = x_lens * scale, y_lens * scale
        # Beyond the fold there is nothing to find; the margin is for the tangential terms.
        moving = np.flatnonzero(distorted <= 1.05 * lens[-1])
        with np.errstate(all="ignore"):
            for _ in range(_ROUNDS):
                at_x, at_y = x[moving], y[moving]
                jxx, jxy, jyy = self._lens_slopes(at_x, at_y)
                ex, ey = self._lens(at_x, at_y)
                ex, ey = ex - x_lens[moving], ey - y_lens[moving]
                det = jxx * jyy - jxy * jxy
                step_x, step_y = (jyy * ex - jxy * ey) / det, (jxx * ey - jxy * ex) / det
                x[moving], y[moving] = at_x - step_x, at_y - step_y
                far = np.abs(step_x) + np.abs(step_y) > _SETTLED
                moving = moving[far]
                if not len(moving):
                    break
            ex, ey = self._lens(x, y)
            good = np.abs(ex - x_lens) + np.abs(ey - y_lens) <= _CLOSED
            good &= self._before_fold(x, y)
        return np.where(good[:, None], np.stack([x, y], axis=-1), np.nan)

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
