"""The paper's closed form for any camera pan ψ and laser offset e.

Frame and signs as in `turnscan.rig._paper`. The pan ψ turns the optical axis away from the rotation
axis, positive towards the laser's side (the paper's Fig. 7). The offset e is the distance by which
the laser's line misses the rotation axis, positive counter-clockwise of it: the line is
−X sin θ + Y cos θ = e. Units: mm and radians; all arguments broadcast.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats


class PlanarPoint(NamedTuple):
    """Where a pixel's ray meets the laser sheet; every field has the broadcast shape."""

    R: Floats
    """Signed distance along the laser's line from the axis's foot, mm; (3) when ψ = e = 0."""
    rho: Floats
    """Distance from the rotation axis √(R² + e²), mm."""
    azimuth: Floats
    """Polar angle about the rotation axis, radians; the camera stands at 0."""
    z: Floats
    """Height above the camera's horizontal plane, mm."""
    slope: Floats
    """dR/dx_ccd, mm of R per mm on the sensor."""


def planar_point(
    x_ccd: npt.ArrayLike,
    y_ccd: npt.ArrayLike,
    theta: npt.ArrayLike,
    L: npt.ArrayLike,
    f: npt.ArrayLike,
    pan: npt.ArrayLike = 0.0,
    offset: npt.ArrayLike = 0.0,
) -> PlanarPoint:
    """Sensor position (mm; x towards the laser's side, y up) → the point on the laser sheet.

    With δ = ψ + atan(x/f): t = (e + L sin θ)/sin(θ+δ) is the horizontal range, R = L cos θ −
    t cos(θ+δ), z = t cos(δ−ψ) y/f. NaN where the ray does not meet the sheet before the camera.
    """
    x, y, th, L_, f_, psi, e = (
        np.asarray(v, dtype=np.float64) for v in (x_ccd, y_ccd, theta, L, f, pan, offset)
    )
    gamma = np.arctan(x / f_)
    delta = psi + gamma
    lever = e + L_ * np.sin(th)
    below = np.sin(th + delta)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(lever * below > 0, lever / below, np.nan)
        R = L_ * np.cos(th) - t * np.cos(th + delta)
        z = t * np.cos(gamma) * y / f_
        slope = t / below * f_ / (f_ * f_ + x * x)
    R, z, slope, e = np.broadcast_arrays(R, z, slope, e)
    return PlanarPoint(R, np.hypot(R, e), th + np.arctan2(e, R), z, slope)


def planar_pixel(
    R: npt.ArrayLike,
    z: npt.ArrayLike,
    theta: npt.ArrayLike,
    L: npt.ArrayLike,
    f: npt.ArrayLike,
    pan: npt.ArrayLike = 0.0,
    offset: npt.ArrayLike = 0.0,
) -> Floats:
    """The inverse of `planar_point`: (R, z) on the laser sheet → (x_ccd, y_ccd), shape (..., 2).

    NaN behind the camera.
    """
    s, up, th, L_, f_, psi, e = (
        np.asarray(v, dtype=np.float64) for v in (R, z, theta, L, f, pan, offset)
    )
    X = s * np.cos(th) - e * np.sin(th) - L_
    Y = s * np.sin(th) + e * np.cos(th)
    depth = Y * np.sin(psi) - X * np.cos(psi)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = np.where(depth > 0, f_ / depth, np.nan)
        x, y = scale * (X * np.sin(psi) + Y * np.cos(psi)), scale * up
    return np.stack(np.broadcast_arrays(x, y), axis=-1)
