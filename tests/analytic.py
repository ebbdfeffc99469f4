"""Exact scans of shapes given by a formula, through a rig: what the pictures would have shown.

A shape is a function of points (..., 3) that is negative inside, positive outside.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce

import numpy as np

from turnscan.arrays import Floats
from turnscan.points import to_object
from turnscan.rig import Camera, LaserSheet, Pose, Rig, rotation_about
from turnscan.stripes import Stripe, StripeFlag

Shape = Callable[[Floats], Floats]
_HALVINGS = 40
"""Of a pixel: to a millionth of a millionth."""


def make_rig(
    *,
    theta: float = np.deg2rad(25.0),
    distance: float = 490.0,
    elevation: float = 0.0,
    pan: float = 0.0,
    offset: float = 0.0,
    lift: float = 0.0,
    bow: tuple[float, float, float] = (0.0, 0.0, 0.0),
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0),
    tilt: tuple[float, float] = (0.0, 0.0),
    size: tuple[int, int] = (320, 240),
    focal: float = 800.0,
    covariance: Floats | None = None,
    lasers: tuple[float, ...] | None = None,
) -> Rig:
    """A camera at ``distance`` mm from the axis, and vertical sheets at the angles θ from it.

    ``elevation`` lifts the camera about the point at height ``lift`` on the axis (radians),
    ``pan`` turns it about its own vertical so that it looks past the axis (towards −x_ccd),
    ``offset`` moves each sheet along its normal (0, cos θ) away from the axis, mm.
    """
    forward = np.array([-np.cos(elevation), 0.0, -np.sin(elevation)])
    right = np.array([0.0, 1.0, 0.0])
    R = np.stack([right, np.cross(forward, right), forward])
    # Panning by ψ turns the optical axis; rays at pixel angle γ leave at γ + ψ from the axis line.
    R = rotation_about([0.0, 1.0, 0.0], -pan) @ R
    eye = -distance * forward + [0.0, 0.0, lift]
    T = Pose(R, -R @ eye)
    sheets = []
    for k, angle in enumerate(lasers or (theta,)):
        normal = T.turn([-np.sin(angle), np.cos(angle), 0.0])
        centre = T.apply([-offset * np.sin(angle), offset * np.cos(angle), lift])
        sheets.append(LaserSheet(f"L{k}", normal, centre, np.asarray(bow)))
    width, height = size
    camera = Camera(
        width,
        height,
        focal,
        focal * 1.1,
        (width - 1) / 2 + 3.0,
        (height - 1) / 2 - 2.0,
        np.asarray(distortion),
        np.asarray(tilt),
    )
    return Rig(camera, tuple(sheets), T, covariance=covariance)


def full_turn(steps: int, *, clockwise: bool = False, start: float = 0.0) -> Floats:
    """``steps`` equal angles of one turn, radians."""
    a = np.arange(steps) * (2 * np.pi / steps)
    return np.asarray(start + (-a if clockwise else a))


def scan_shape(
    rig: Rig, shape: Shape, angles: Floats, laser: str = "L0", *, sigma: float = 0.1
) -> list[Stripe]:
    """The stripe of each angle, to 1e-12 px: first surface the laser meets, seen or not."""
    sheet, turns = rig.sheet(laser), np.asarray(angles, dtype=np.float64)
    # The sheet stands still: where its light passes before the camera is the same at every angle.
    u, passes = _search(rig, sheet)
    n, size = len(passes), len(turns)
    hit, first = np.zeros((size, n), dtype=np.bool_), np.zeros((size, n), dtype=np.intp)
    for k, angle in enumerate(turns):
        f = shape(_turned(rig, passes, angle))
        with np.errstate(invalid="ignore"):
            entered = (f[:, :-1] > 0) & (f[:, 1:] <= 0)
        hit[k], first[k] = entered.any(axis=1), entered.argmax(axis=1)
    step, line = np.nonzero(hit)
    lo, hi = u[first[hit]], u[first[hit] + 1]
    for _ in range(_HALVINGS):
        middle = (lo + hi) / 2
        with np.errstate(invalid="ignore"):
            out = shape(to_object(rig, _point(rig, sheet, middle, line), turns[step])) > 0
        lo, hi = np.where(out, middle, lo), np.where(out, hi, middle)
    place = (lo + hi) / 2
    with np.errstate(invalid="ignore"):
        good = (place >= 0) & (place <= rig.camera.width - 1)
    step, line, place = step[good], line[good], place[good]
    points = rig.T_camera_table.inverse().apply(_point(rig, sheet, place, line))
    position = np.full((size, n), np.nan)
    for k, angle in enumerate(turns):
        mine = step == k
        seen = _seen(rig, shape, points[mine], angle)
        position[k, line[mine][seen]] = place[mine][seen]
    return [_stripe(row, sigma) for row in position]


def _search(rig: Rig, sheet: LaserSheet) -> tuple[Floats, Floats]:
    """Columns (m,) from the side that the laser stands on inwards, and where the sheet is seen in
    them in each line: (n, m, 3), table frame."""
    camera = rig.camera
    axis = camera.project(rig.T_camera_table.apply([0.0, 0.0, 0.0]))[0]
    lit_from = camera.width - 1.0 if _leans_right(rig, sheet) else 0.0
    far = 2 * axis - lit_from
    u = np.linspace(lit_from, far, int(abs(far - lit_from)) + 2)
    lines, columns = np.meshgrid(np.arange(camera.height), u, indexing="ij")
    return u, rig.T_camera_table.inverse().apply(_point(rig, sheet, columns, lines))


def _point(rig: Rig, sheet: LaserSheet, u: Floats, line: np.ndarray) -> Floats:
    return sheet.intersect(rig.camera.rays(np.stack([u, line], axis=-1)))


def _turned(rig: Rig, points: Floats, angle: float) -> Floats:
    """Points of the table frame in the object's, the table at an angle."""
    if rig.wobble is not None:
        turn, shift = rig.turning(angle)
        return np.asarray((points - shift) @ turn)
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    return np.stack([c * x + s * y, c * y - s * x, z], axis=-1)


def _stripe(position: Floats, sigma: float) -> Stripe:
    hit = ~np.isnan(position)
    blank = np.where(hit, 1.0, np.nan)
    return Stripe(
        position,
        sigma * blank,
        100.0 * blank,
        1.5 * blank,
        np.where(hit, 0, StripeFlag.DARK).astype(np.uint16),
    )


def _leans_right(rig: Rig, sheet: LaserSheet) -> bool:
    """Whether the part of the sheet nearer to the camera lies right of the axis in the picture."""
    T = rig.T_camera_table
    along = np.cross(T.rotation[:, 2], sheet.normal)
    along = along if along @ -T.translation > 0 else -along
    return bool(along[0] > 0)


def _seen(rig: Rig, shape: Shape, points: Floats, angle: float) -> np.ndarray:
    """True where nothing of the shape stands between the camera and points of the table frame."""
    eye, there = (
        _turned(rig, X, angle) for X in (rig.T_camera_table.inverse().translation, points)
    )
    part = np.linspace(0.3, 0.999, 200)[:, None, None]
    return np.asarray((shape(eye + part * (there - eye)) > 0).all(axis=0))


def sphere(radius: float, centre: tuple[float, float, float]) -> Shape:
    """A ball."""
    x, y, z = centre
    return lambda P: (
        np.sqrt((P[..., 0] - x) ** 2 + (P[..., 1] - y) ** 2 + (P[..., 2] - z) ** 2) - radius
    )


def cylinder(radius: float, low: float, high: float) -> Shape:
    """A cylinder about the table's axis."""

    def shape(P: Floats) -> Floats:
        r = np.hypot(P[..., 0], P[..., 1]) - radius
        return np.maximum(r, np.maximum(low - P[..., 2], P[..., 2] - high))

    return shape


def box(half: tuple[float, float, float], centre: tuple[float, float, float], turn: float) -> Shape:
    """A box of those half edges, turned by ``turn`` radians about the vertical."""
    R = rotation_about([0, 0, 1], turn)

    def shape(P: Floats) -> Floats:
        Q = (P - np.asarray(centre)) @ R
        x, y, z = (np.abs(Q[..., k]) - half[k] for k in range(3))
        return np.asarray(np.maximum(np.maximum(x, y), z))

    return shape


def torus(major: float, minor: float, height: float) -> Shape:
    """A torus about the table's axis."""

    def shape(P: Floats) -> Floats:
        return np.hypot(np.hypot(P[..., 0], P[..., 1]) - major, P[..., 2] - height) - minor

    return shape


def union(*shapes: Shape) -> Shape:
    """All of the shapes together."""
    return lambda P: reduce(np.minimum, (s(P) for s in shapes))


def with_noise(stripes: list[Stripe], sigma: float, seed: int) -> list[Stripe]:
    """The stripes with Gaussian noise of ``sigma`` px on every centre."""
    rng = np.random.default_rng(seed)
    return [
        Stripe(
            s.position + rng.normal(0.0, sigma, len(s.position)),
            np.where(s.found, sigma, np.nan),
            s.amplitude,
            s.width,
            s.flags,
        )
        for s in stripes
    ]
