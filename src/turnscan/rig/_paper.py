"""The seed paper's equations (1) to (8), with its numbering, and what it leaves unsaid.

Geometry of the paper's Fig. 4, seen from above: the rotation axis is the origin O, the camera's
centre of projection stands at (L, 0) and looks at O, and the laser's line leaves O at the angle
``theta`` from the viewing direction. Units: mm and radians; all arguments broadcast.

Sign rule: ``x_ccd`` is positive towards the laser's side, and R is signed: R > 0 between axis and
projector, R < 0 behind the axis. One formula then covers both sides. Columns whose viewing ray
never meets the laser's line (sin(θ+γ) ≤ 0 for θ > 0) give NaN. For the mirror laser on the
camera's other side put θ → −θ and x → −x; R stays.

``f`` is the calibrated principal distance, not the engraved focal length: a lens focused at L has
f(1 + m), with m = f/(L − f), some 2.6 % more for the paper's rig. L runs from the entrance pupil.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats


def _floats(*values: npt.ArrayLike) -> tuple[Floats, ...]:
    return tuple(np.asarray(v, dtype=np.float64) for v in values)


def viewing_angle(x_ccd: npt.ArrayLike, f: npt.ArrayLike) -> Floats:
    """Equation (1): γ = atan(x_ccd / f), radians."""
    x, f_ = _floats(x_ccd, f)
    return np.asarray(np.arctan(x / f_))


def radius_from_angle(gamma: npt.ArrayLike, theta: npt.ArrayLike, L: npt.ArrayLike) -> Floats:
    """Equations (2) and (3): R / sin γ = L / sin(θ+γ), hence R = L sin γ / sin(θ+γ), mm.

    NaN where the viewing ray does not meet the laser's line in front of the camera.
    """
    g, t, L_ = _floats(gamma, theta, L)
    below = np.sin(t + g)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(below * np.sin(t) > 0, L_ * np.sin(g) / below, np.nan)


def radius(
    x_ccd: npt.ArrayLike, theta: npt.ArrayLike, L: npt.ArrayLike, f: npt.ArrayLike
) -> Floats:
    """Equations (1) and (3) without trigonometry of γ: R = L x / (f sin θ + x cos θ), mm.

    NaN where the viewing ray does not meet the laser's line in front of the camera.
    """
    x, t, L_, f_ = _floats(x_ccd, theta, L, f)
    below = f_ * np.sin(t) + x * np.cos(t)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(below * np.sin(t) > 0, L_ * x / below, np.nan)


def radius_slope(
    x_ccd: npt.ArrayLike, theta: npt.ArrayLike, L: npt.ArrayLike, f: npt.ArrayLike
) -> Floats:
    """The derivative dR/dx = L f sin θ / (f sin θ + x cos θ)², mm of R per mm on the sensor.

    Not in the paper, whose (5) is the secant over the first pixel off the axis.
    """
    x, t, L_, f_ = _floats(x_ccd, theta, L, f)
    below = f_ * np.sin(t) + x * np.cos(t)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = L_ * f_ * np.sin(t) / below**2
        return np.where(below * np.sin(t) > 0, slope, np.nan)


def ccd_position(
    R: npt.ArrayLike, theta: npt.ArrayLike, L: npt.ArrayLike, f: npt.ArrayLike
) -> Floats:
    """The inverse of `radius`: x_ccd = f R sin θ / (L − R cos θ), mm; NaN behind the camera."""
    R_, t, L_, f_ = _floats(R, theta, L, f)
    depth = L_ - R_ * np.cos(t)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(depth > 0, f_ * R_ * np.sin(t) / depth, np.nan)


def position(R: npt.ArrayLike, theta: npt.ArrayLike) -> Floats:
    """Equation (4): x = R cos θ, y = R sin θ; shape (..., 2), mm.

    Coordinates that stand still with the camera, x along the viewing axis. The object's own polar
    angle at table angle φ is θ − φ (counter-clockwise turns seen from above).
    """
    R_, t = _floats(R, theta)
    return np.stack(np.broadcast_arrays(R_ * np.cos(t), R_ * np.sin(t)), axis=-1)


def height(
    R: npt.ArrayLike,
    y_ccd: npt.ArrayLike,
    theta: npt.ArrayLike,
    L: npt.ArrayLike,
    f: npt.ArrayLike,
) -> Floats:
    """The height the paper leaves out, z = (L − R cos θ) y_ccd / f, mm, y_ccd positive upwards.

    It is what the printed formula of H_max implies.
    """
    R_, y, t, L_, f_ = _floats(R, y_ccd, theta, L, f)
    return np.asarray((L_ - R_ * np.cos(t)) * y / f_)


def delta_r(
    pixel: npt.ArrayLike, theta: npt.ArrayLike, L: npt.ArrayLike, f: npt.ArrayLike
) -> Floats:
    """Equation (5) as printed: ΔR = ε L / (ε cos θ + f sin θ), mm.

    This is R of the first pixel off the axis, exactly. Table 1 was not computed with it, see
    `delta_r_tabulated`.
    """
    e, t, L_, f_ = _floats(pixel, theta, L, f)
    return np.asarray(e * L_ / (e * np.cos(t) + f_ * np.sin(t)))


def delta_r_tabulated(
    pixel: npt.ArrayLike, theta: npt.ArrayLike, L: npt.ArrayLike, f: npt.ArrayLike
) -> Floats:
    """ΔR as Table 1 has it: ε L / (f sin θ), mm: ε dR/dx at the axis, or (7) divided by cos θ."""
    e, t, L_, f_ = _floats(pixel, theta, L, f)
    return np.asarray(e * L_ / (f_ * np.sin(t)))


def delta_x(
    pixel: npt.ArrayLike, theta: npt.ArrayLike, L: npt.ArrayLike, f: npt.ArrayLike
) -> Floats:
    """Equation (6): the depth resolution Δx = ΔR cos θ = ε L / (ε + f tan θ), mm, ΔR from (5)."""
    e, t, L_, f_ = _floats(pixel, theta, L, f)
    return np.asarray(e * L_ / (e + f_ * np.tan(t)))


def delta_x_small_pixel(
    pixel: npt.ArrayLike, theta: npt.ArrayLike, L: npt.ArrayLike, f: npt.ArrayLike
) -> Floats:
    """Equation (7): Δx ≈ ε L / (f tan θ) = ε / (m tan θ) with m = f/L, mm; Table 1 uses it."""
    e, t, L_, f_ = _floats(pixel, theta, L, f)
    return np.asarray(e * L_ / (f_ * np.tan(t)))


def gamma_max(columns: npt.ArrayLike, pixel: npt.ArrayLike, f: npt.ArrayLike) -> Floats:
    """Equation (8), first half: γ_max = atan(columns/2 · ε / f), a half angle, radians."""
    n, e, f_ = _floats(columns, pixel, f)
    return np.asarray(np.arctan(n / 2 * e / f_))


def beta_max(rows: npt.ArrayLike, pixel: npt.ArrayLike, f: npt.ArrayLike) -> Floats:
    """Equation (8), second half: β_max = 2 atan(rows/2 · ε / f), a full angle, radians."""
    n, e, f_ = _floats(rows, pixel, f)
    return np.asarray(2.0 * np.arctan(n / 2 * e / f_))


def r_max(gamma: npt.ArrayLike, theta: npt.ArrayLike, L: npt.ArrayLike) -> Floats:
    """R_max = L sin γ_max / sin(θ + γ_max), the formula under Table 1, mm."""
    return radius_from_angle(gamma, theta, L)


def h_max(R: npt.ArrayLike, beta: npt.ArrayLike, theta: npt.ArrayLike, L: npt.ArrayLike) -> Floats:
    """H_max = (L − R_max cos θ) tan β_max as printed under Table 1, mm.

    With the full angle of (8) it overstates the height by 3 %; see `h_max_tabulated`.
    """
    R_, b, t, L_ = _floats(R, beta, theta, L)
    return np.asarray((L_ - R_ * np.cos(t)) * np.tan(b))


def h_max_tabulated(
    R: npt.ArrayLike, beta: npt.ArrayLike, theta: npt.ArrayLike, L: npt.ArrayLike
) -> Floats:
    """H_max as Table 1 has it: 2 (L − R_max cos θ) tan(β_max / 2), mm: what the rows can see."""
    R_, b, t, L_ = _floats(R, beta, theta, L)
    return np.asarray(2.0 * (L_ - R_ * np.cos(t)) * np.tan(b / 2))


def circumferential_distance(R: npt.ArrayLike, step: npt.ArrayLike) -> Floats:
    """Distance R · step between neighbouring profiles at radius R, mm (the paper's 9.8 and 4.4)."""
    R_, s = _floats(R, step)
    return np.asarray(R_ * s)


def vertical_distance(H: npt.ArrayLike, rows: npt.ArrayLike) -> Floats:
    """Distance H / rows between neighbouring points of a profile, mm (the 0.14 and 0.31)."""
    H_, n = _floats(H, rows)
    return np.asarray(H_ / n)
