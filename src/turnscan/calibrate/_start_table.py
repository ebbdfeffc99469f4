"""First values for the table: its axis, the layout of what is fixed to it, the angles."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.calibrate._board import Board, Chessboard
from turnscan.calibrate._layout import BoardLayout, MarkerLayout
from turnscan.calibrate._start import pose_of
from turnscan.calibrate._state import RiderView
from turnscan.errors import Degenerate, NotEnoughViews
from turnscan.rig import Camera, Pose, rotation_z

FEWEST_STEPS = 5
_LEAST_TURN = np.radians(10.0)
_MANY = 80
_NEAR = 1e-3
"""Relative change of the misfit at which a try is as good as it will be."""
_BEFORE = (3, 0, 1, 2)
"""The corner before each of a marker's four."""


def start_markers(
    camera: Camera, views: Sequence[RiderView], side: float
) -> tuple[MarkerLayout, Pose, Floats]:
    """Layout, table pose and angles from markers in the plane of the platter.

    The plane is the one on which all markers become squares of constant size; on it every marker
    runs on a circle about the axis. ``side`` mm only sets the scale. Angles are NaN for views that
    share no marker with the others.
    """
    seen = [k for k, v in enumerate(views) if len(v.numbers)]
    if len(seen) < FEWEST_STEPS:
        raise NotEnoughViews(
            f"table: markers in {len(seen)} of {len(views)} pictures; at least {FEWEST_STEPS} are "
            "needed",
            hint="check the marker dictionary and that the markers are sharp and uncovered",
        )
    number = np.concatenate([views[k].numbers for k in seen])
    view = np.concatenate([np.full(len(views[k].numbers), k) for k in seen])
    rays = camera.rays(np.concatenate([views[k].corners for k in seen])).reshape(-1, 4, 3)
    fine = np.isfinite(rays).all(axis=(1, 2))
    number, view, rays = number[fine], view[fine], rays[fine]
    frame = _square_plane(rays, number)
    laid = _lay(rays, frame[:, 2]) @ frame
    flat = laid[:, :, :2]
    centres = flat.mean(axis=1)
    axis = _common_centre(centres, number)
    arm = centres - axis
    turn, place, angles = _phases(np.arctan2(arm[:, 1], arm[:, 0]), number, view, len(views))
    edge = (flat[:, 1] + flat[:, 2] - flat[:, 0] - flat[:, 3]) / 2
    numbers = np.array(sorted(place), dtype=np.int32)
    squares = np.zeros((len(numbers), 4))
    for i, n in enumerate(numbers):
        at = (number == n) & np.isfinite(turn)
        radius = np.linalg.norm(arm[at], axis=1).mean()
        spin = np.angle(np.sum(np.exp(1j * (np.arctan2(edge[at, 1], edge[at, 0]) - turn[at]))))
        length = np.linalg.norm(flat[at] - np.roll(flat[at], 1, axis=1), axis=2).mean()
        squares[i] = (radius * np.cos(place[int(n)]), radius * np.sin(place[int(n)]), spin, length)
    zero = float(np.arctan2(squares[0, 1], squares[0, 0]))
    c, s = np.cos(zero), np.sin(zero)
    squares[:, :2] = squares[:, :2] @ np.array([[c, -s], [s, c]])
    squares[:, 2] -= zero
    scale = side / float(squares[:, 3].mean())
    layout = MarkerLayout(numbers, squares).scaled(scale)
    level = float(laid[0, 0, 2])
    origin = scale * (frame @ np.array([axis[0], axis[1], level]))
    return layout, Pose(frame @ rotation_z(zero), origin), angles


def _lay(rays: Floats, up: Floats) -> Floats:
    """Rays (..., 3) → where they meet the plane at unit distance with that normal."""
    laid: Floats = -rays / (rays @ up)[..., None]
    return laid


def _frame(up: Floats) -> Floats:
    """Right-handed axes (3, 3) with z = up."""
    lead = np.array([1.0, 0.0, 0.0] if abs(up[0]) < 0.7 else [0.0, 1.0, 0.0])
    y = np.cross(up, lead)
    y /= np.linalg.norm(y)
    return np.stack([np.cross(y, up), y, up], axis=1)


def _middle(values: Floats) -> float:
    """The median of an even number of finite values, which ``np.median`` takes much longer for."""
    half = len(values) // 2
    low, high = np.partition(values, (half - 1, half))[half - 1 : half + 1]
    return float((low + high) / 2)


def _square_plane(rays: Floats, number: Ints) -> Floats:
    """The axes whose z is the normal of the plane on which all markers are squares."""
    from scipy.optimize import least_squares

    some = np.linspace(0, len(rays) - 1, min(len(rays), 4 * _MANY)).astype(int)
    rays, number = rays[some], number[some]
    groups = [np.flatnonzero(number == n) for n in np.unique(number)]

    def up_of(p: Floats) -> Floats:
        tilt, azimuth = p
        up: Floats = -np.array(
            [np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)]
        )
        return up

    def misfit(p: Floats) -> Floats:
        slope = rays @ up_of(p)
        if slope.max() > -1e-3:
            return np.full(6 * len(rays), 10.0)
        laid = -rays / slope[..., None]
        sides = np.linalg.norm(laid - laid[:, _BEFORE], axis=2)
        cross = np.linalg.norm(laid[:, :2] - laid[:, 2:], axis=2) / np.sqrt(2)
        all_six = np.concatenate([sides, cross], axis=1)
        out = np.empty_like(all_six)
        for g in groups:
            out[g] = all_six[g] / _middle(all_six[g].ravel()) - 1
        return out.ravel()

    tries = [
        np.array([t, a])
        for t in np.radians([5, 20, 35, 50, 62, 72, 80])
        for a in np.arange(8) * np.pi / 4
    ]
    tries.sort(key=lambda p: float(np.abs(misfit(p)).sum()))
    fit = partial(least_squares, misfit, loss="soft_l1", f_scale=0.02)
    # Most of the tries end in one place: each goes near its own, and the best of them to its end.
    near = min((fit(p, ftol=_NEAR) for p in tries[:4]), key=lambda r: float(r.cost))
    best = fit(near.x)
    return _frame(up_of(np.asarray(best.x)))


def _common_centre(points: Floats, number: Ints) -> Floats:
    """Centre (2,) of concentric circles, one for every marker (algebraic, then robust)."""
    groups = np.unique(number, return_inverse=True)[1]
    m = int(groups.max()) + 1
    weight = np.ones(len(points))
    solved = np.zeros(2 + m)
    for _ in range(10):
        design = np.zeros((len(points), 2 + m))
        design[:, :2] = 2 * points
        design[np.arange(len(points)), 2 + groups] = 1.0
        square = (points**2).sum(axis=1)
        root = np.sqrt(weight)
        solved, _, rank, _ = np.linalg.lstsq(design * root[:, None], square * root, rcond=1e-9)
        if rank < 2 + m:
            break
        rest = square - design @ solved
        scale = max(1.4826 * float(np.median(np.abs(rest))), 1e-12)
        weight = 1 / np.maximum(np.abs(rest) / (2 * scale), 1.0)
    spread = max(float(np.linalg.norm(np.ptp(points[groups == g], axis=0))) for g in range(m))
    radius = np.linalg.norm(points - solved[:2], axis=1).mean()
    if spread < _LEAST_TURN * radius:
        raise Degenerate(
            "table: it hardly turns between the pictures, so its axis cannot be determined",
            hint="give the pictures of a whole turn, in order",
        )
    centre: Floats = solved[:2]
    return centre


def _phases(
    phase: Floats, number: Ints, view: Ints, count: int
) -> tuple[Floats, dict[int, float], Floats]:
    """Split phase = angle of the view + place of the marker, from view to view by shared markers.

    The first view is at angle 0. Returns the angle of every observation, the markers' places and
    the angle of every view (count,), NaN where nothing connects it with the first.
    """
    angles = np.full(count, np.nan)
    place: dict[int, float] = {}
    angles[view[0]] = 0.0
    for _ in range(count + 1):
        known = np.isfinite(angles[view])
        for n in np.unique(number[known]):
            at = known & (number == n)
            place[int(n)] = float(np.angle(np.sum(np.exp(1j * (phase[at] - angles[view[at]])))))
        place_of = np.array([place.get(int(n), np.nan) for n in number])
        before = angles.copy()
        for k in np.unique(view[np.isfinite(place_of)]):
            at = (view == k) & np.isfinite(place_of)
            angles[k] = float(np.angle(np.sum(np.exp(1j * (phase[at] - place_of[at])))))
        angles -= angles[view[0]]
        same = np.isfinite(before) == np.isfinite(angles)
        if same.all() and np.nanmax(np.abs(np.exp(1j * angles) - np.exp(1j * before))) < 1e-6:
            break
    return angles[view], place, angles


def start_board(
    camera: Camera, views: Sequence[RiderView], board: Board, up: Floats, lowest: float
) -> tuple[BoardLayout, Pose, Floats, tuple[RiderView, ...]]:
    """Layout, table pose and angles from one board fixed to the table.

    The relative rotations of the board have the table's axis in common. ``up`` (3,) in the camera
    frame says on which side of the platter the object stands; ``lowest`` mm is the height of the
    board's lowest corner above the platter. The views come back with the corners of chessboards
    that were read upside down put right.
    """
    if len(views) < FEWEST_STEPS:
        raise NotEnoughViews(
            f"table: the board was found in {len(views)} pictures; at least {FEWEST_STEPS}",
            hint="check the size of the board and that it is sharp and uncovered",
        )
    poses: list[Pose] = []
    righted: list[RiderView] = []
    for v in views:
        choices = [v.corners]
        if isinstance(board, Chessboard):
            choices.append(v.corners[::-1])
        here = [(pose_of(camera, board.points[v.numbers], c), c) for c in choices]
        pose, corners = min(here, key=lambda pc: _apart(pc[0], poses[-1])) if poses else here[0]
        poses.append(pose)
        righted.append(RiderView(v.numbers, corners, v.stripes, v.name))
    vectors = np.array([_turn_vector(T.rotation @ poses[0].rotation.T) for T in poses])
    sizes, axes = np.linalg.eigh(vectors.T @ vectors)
    axis = axes[:, 2] * np.sign(axes[:, 2] @ up or 1.0)
    if np.sqrt(sizes[2]) < _LEAST_TURN:
        raise Degenerate(
            "table: it hardly turns between the pictures, so its axis cannot be determined",
            hint="give the pictures of a whole turn, in order",
        )
    relative = [T @ poses[0].inverse() for T in poses[1:]]
    A = np.concatenate([np.eye(3) - T.rotation for T in relative])
    b = np.concatenate([T.translation for T in relative])
    point = np.linalg.lstsq(np.vstack([A, axis]), np.append(b, 0.0), rcond=None)[0]
    corners0 = poses[0].apply(board.points)
    level = float((corners0 @ axis).min()) - lowest
    origin = point + (level - point @ axis) * axis
    x = corners0[0] - origin
    x = x - (x @ axis) * axis
    x /= np.linalg.norm(x)
    T_table = Pose(np.stack([x, np.cross(axis, x), axis], axis=1), origin)
    layout = BoardLayout(board, T_table.inverse() @ poses[0])
    angles = np.array([_angle_about(T.rotation @ poses[0].rotation.T, axis) for T in poses])
    return layout, T_table, angles, tuple(righted)


def _turn_vector(R: Floats) -> Floats:
    import cv2

    return np.ravel(np.asarray(cv2.Rodrigues(R)[0], np.float64))


def _apart(a: Pose, b: Pose) -> float:
    return float(np.linalg.norm(_turn_vector(a.rotation @ b.rotation.T)))


def _angle_about(R: Floats, axis: Floats) -> float:
    skew = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return float(np.arctan2(skew @ axis / 2, (np.trace(R) - 1) / 2))
