"""What a calibration is worth: residuals in px and mm, and the uncertainty of what it measures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Floats
from turnscan.calibrate._layout import MarkerLayout, stacked
from turnscan.calibrate._observations import BOARD, RIDER, stripe_kind
from turnscan.calibrate._residuals import trace
from turnscan.calibrate._rig import Calibration
from turnscan.calibrate._state import board_stripe, platter_stripe
from turnscan.rig import Rig

_CELLS = (8, 6)
_QUARTERS = np.arange(4) * np.pi / 2


@dataclass(frozen=True)
class Measured:
    """A number with its standard uncertainty."""

    value: float
    sigma: float

    def text(self, unit: str, digits: int = 2) -> str:
        """``value ± sigma unit``."""
        return f"{self.value:.{digits}f} ± {self.sigma:.{digits}f} {unit}"


@dataclass(frozen=True)
class CalibrationQuality:
    """The figures of a calibration that a person asks for first."""

    camera_rms_px: float
    """Corners of the boards, per component; NaN without boards."""
    camera_views: int
    coverage: float
    """Share of the picture's 8×6 cells in which there is a corner."""
    sheet_rms_px: dict[str, float]
    """Per laser with pictures, stripes on boards."""
    sheet_rms_mm: dict[str, float]
    """The same, distance from the sheet."""
    sheet_views: dict[str, int]
    sheet_offset_mm: dict[str, Measured]
    """Per laser: distance of the axis from the sheet at platter height."""
    table_rms_px: float
    """Corners of what is fixed to the table; NaN without a table."""
    platter_rms_mm: float
    """Stripes on the platter, distance from the sheet; NaN without."""
    marker_sides_mm: dict[int, Measured]
    marker_side_mm: Measured | None
    """Mean of the sides."""
    marker_centre_mm: Measured | None
    """Distance of the middle of the markers from the axis."""
    radius_k2_mm: dict[str, float]
    """Per test point "R / z mm": expanded uncertainty (k = 2) of a measured radius."""
    height_k2_mm: dict[str, float]
    """The same of a measured height."""


def figures(c: Calibration) -> CalibrationQuality:
    """Compute the figures of a calibration."""
    fit, net = c.fit, c.network
    px, mm, views, offset = {}, {}, {}, {}
    for laser in net.lasers:
        distances = _board_distances(c, laser)
        if distances:
            px[laser] = fit.rms(stripe_kind("boards", laser))
            mm[laser] = _rms(distances)
            views[laser] = len(distances)
        if c.rig.table_known:
            offset[laser] = _sheet_offset(c.rig, laser)
    sides, side, centre = _markers(c)
    radius, height = {}, {}
    if c.rig.table_known and net.lasers:
        for R, z in test_points(c):
            u = measured_uncertainty(c.rig, net.lasers[0], R, z)
            if u is not None:
                radius[f"{R:g} / {z:g}"], height[f"{R:g} / {z:g}"] = 2 * u[0], 2 * u[1]
    return CalibrationQuality(
        camera_rms_px=fit.rms(BOARD),
        camera_views=len(net.boards),
        coverage=coverage([v.corners for v in net.boards], c.rig.camera.width, c.rig.camera.height),
        sheet_rms_px=px,
        sheet_rms_mm=mm,
        sheet_views=views,
        sheet_offset_mm=offset,
        table_rms_px=fit.rms(RIDER),
        platter_rms_mm=_rms(_platter_distances(c)),
        marker_sides_mm=sides,
        marker_side_mm=side,
        marker_centre_mm=centre,
        radius_k2_mm=radius,
        height_k2_mm=height,
    )


def coverage(corners: Sequence[Floats], width: int, height: int) -> float:
    """Share of the picture's 8×6 cells that contain at least one of the corners (n, 2)."""
    points = np.concatenate([np.zeros((0, 2)), *corners])
    grid, _, _ = np.histogram2d(
        points[:, 0], points[:, 1], bins=_CELLS, range=((0, width), (0, height))
    )
    return float(np.mean(grid > 0))


def measured_uncertainty(
    rig: Rig, laser: str, radius: float, height: float
) -> tuple[float, float] | None:
    """Standard uncertainty (mm) of the radius and the height measured at a point of the sheet.

    The point lies in the sheet, ``radius`` mm from the axis, ``height`` mm above the platter, on
    the camera's side. Its pixel is kept, the rig's parameters are varied by their covariance
    (first-order propagation, docs/explain/calibration.md), so this is what calibration adds to the
    noise of a single point. None where the sheet does not reach there.
    """
    if rig.covariance is None:
        return None
    T = rig.T_camera_table
    sheet = rig.sheet(laser)
    n = T.inverse().turn(sheet.normal)
    level = n @ T.inverse().apply(sheet.centre) - n[2] * height
    reach = float(np.hypot(n[0], n[1])) * radius
    if reach <= abs(level):
        return None
    lead, spread = np.arctan2(n[1], n[0]), np.arccos(level / reach)
    both = np.array([lead + spread, lead - spread])
    points = np.stack([radius * np.cos(both), radius * np.sin(both), np.full(2, height)], axis=1)
    point = min(points, key=lambda x: float(np.linalg.norm(T.apply(x))))
    pixel = rig.camera.project(T.apply(point))[None]

    # At all table angles alike, unless the axis itself moves as the table turns.
    turns = np.zeros(1) if rig.wobble is None else _QUARTERS

    def measure(r: Rig) -> Floats:
        X = r.T_camera_table.inverse().apply(r.sheet(laser).intersect(r.camera.rays(pixel)))
        turn, shift = r.turning(turns)
        X = np.einsum("kji,kj->ki", turn, X - shift)
        return np.stack([np.hypot(X[:, 0], X[:, 1]), X[:, 2]])

    sigma = np.sqrt(np.diag(rig.covariance))
    slopes = np.zeros((2, len(turns), len(sigma)))
    for k in np.flatnonzero(sigma):
        step = np.zeros(len(sigma))
        step[k] = 1e-3 * sigma[k]
        slopes[..., k] = (measure(rig.perturbed(step)) - measure(rig.perturbed(-step))) / (
            2 * step[k]
        )
    variance = np.mean(
        [np.diag(J @ rig.covariance @ J.T) for J in np.moveaxis(slopes, 1, 0)], axis=0
    )
    if not np.isfinite(variance).all():
        return None
    return float(np.sqrt(variance[0])), float(np.sqrt(variance[1]))


def test_points(c: Calibration) -> list[tuple[float, float]]:
    """Radius and height, mm: the rim of what was seen, half of it, and as high as wide."""
    if isinstance(c.fit.state.layout, MarkerLayout):
        rim = float(np.linalg.norm(c.fit.state.layout.squares[:, :2], axis=1).max())
    else:
        rim = 0.2 * float(np.linalg.norm(c.rig.T_camera_table.translation))
    rim = float(f"{rim:.1g}")
    return [(rim / 2, 0.0), (rim, 0.0), (rim / 2, rim), (rim, rim)]


def _rms(parts: list[Floats]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2))) if parts else float("nan")


def _board_distances(c: Calibration, laser: str) -> list[Floats]:
    state = c.fit.state
    out = []
    for view, pose, group in zip(
        c.network.boards, state.poses, c.network.board_stripes, strict=True
    ):
        for s in group:
            if s.laser == laser:
                seen = trace(state.rig.camera, s.pixels)
                lies = stacked((pose,), (len(s.pixels),))
                out.append(board_stripe(state, s, seen, view.board, lies)[0].distance)
    return out


def _platter_distances(c: Calibration) -> list[Floats]:
    state = c.fit.state
    if not isinstance(state.layout, MarkerLayout):
        return []
    return [
        platter_stripe(state, s, trace(state.rig.camera, s.pixels), float(a))[0].distance
        for v, a in zip(c.network.table, state.angles, strict=True)
        for s in v.stripes
    ]


def _sheet_offset(rig: Rig, laser: str) -> Measured:
    """How far the sheet passes from the point where the axis meets the platter."""
    T = rig.T_camera_table
    value = float(rig.sheet(laser).distance(T.translation))
    assert rig.covariance is not None
    sigma = np.sqrt(np.diag(rig.covariance))
    slope = np.zeros(len(sigma))
    for k in np.flatnonzero(sigma):
        step = np.zeros(len(sigma))
        step[k] = 1e-3 * sigma[k]
        ends = [
            r.sheet(laser).distance(r.T_camera_table.translation)
            for r in (rig.perturbed(step), rig.perturbed(-step))
        ]
        slope[k] = (ends[0] - ends[1]) / (2 * step[k])
    return Measured(abs(value), float(np.sqrt(slope @ rig.covariance @ slope)))


def _markers(
    c: Calibration,
) -> tuple[dict[int, Measured], Measured | None, Measured | None]:
    layout = c.fit.state.layout
    if not isinstance(layout, MarkerLayout):
        return {}, None, None
    names = c.network.names
    at = {q: [names.index(f"marker{n}.{q}") for n in layout.numbers] for q in ("x", "y", "side")}
    cov = c.fit.covariance
    m = len(layout.numbers)

    def mean_sigma(index: list[int], other: list[int]) -> float:
        return float(cov[np.ix_(index, other)].sum()) / m**2

    sides = {
        int(n): Measured(float(s), float(np.sqrt(cov[k, k])))
        for n, s, k in zip(layout.numbers, layout.squares[:, 3], at["side"], strict=True)
    }
    side = Measured(
        float(layout.squares[:, 3].mean()), float(np.sqrt(mean_sigma(at["side"], at["side"])))
    )
    middle = layout.squares[:, :2].mean(axis=0)
    off = float(np.linalg.norm(middle))
    u = middle / max(off, 1e-12)
    xx, yy = mean_sigma(at["x"], at["x"]), mean_sigma(at["y"], at["y"])
    xy = mean_sigma(at["x"], at["y"])
    variance = u[0] ** 2 * xx + u[1] ** 2 * yy + 2 * u[0] * u[1] * xy
    return sides, side, Measured(off, float(np.sqrt(variance)))
