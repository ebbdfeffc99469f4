"""First values for the adjustment: camera, board poses, laser sheet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from turnscan.arrays import Floats
from turnscan.calibrate._board import BoardView
from turnscan.errors import Degenerate, InputError, NotEnoughViews
from turnscan.remedy import Option, Remedy
from turnscan.rig import Camera, LaserSheet, Pose, nearest_rotation

FEWEST_VIEWS = 3
_FEW = 15
_NEAR_MM = 3.0  # a stripe this far from the sheet of the others was drawn by something else
_LEAST_SPREAD = 0.02  # breadth of the stripe points across the stripe, as a share of their length


def start_camera(views: Sequence[BoardView]) -> tuple[Camera, tuple[Pose, ...]]:
    """Camera and board poses to begin with (Zhang 2000, as OpenCV has it).

    Raises NotEnoughViews below three views, InputError where the pictures differ in size.
    """
    import cv2

    same_size(views)
    if len(views) < FEWEST_VIEWS:
        raise NotEnoughViews(
            f"camera: {len(views)} usable board views; at least {FEWEST_VIEWS} are needed, 20 are "
            "recommended",
            hint="take more pictures of the board, tilted up to 45° and filling the corners",
        )
    objects = [v.points.astype(np.float32) for v in views]
    pixels = [v.corners.astype(np.float32).reshape(-1, 1, 2) for v in views]
    flags = cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST
    try:
        _, K, bend, turns, shifts = cv2.calibrateCamera(
            objects, pixels, views[0].size, None, None, flags=flags
        )
    except cv2.error as e:
        raise Degenerate(
            f"camera: no first guess from {len(views)} views ({str(e).strip().splitlines()[-1]})",
            hint="tilt the board differently in every picture",
        ) from None
    width, height = views[0].size
    d = np.zeros(5)
    d[: min(5, np.size(bend))] = np.ravel(bend)[:5]
    if not np.isfinite(K).all() or min(K[0, 0], K[1, 1]) <= 0:
        raise Degenerate(
            f"camera: {len(views)} views give no focal length",
            hint="tilt the board differently in every picture",
        )
    camera = Camera(width, height, K[0, 0], K[1, 1], K[0, 2], K[1, 2], d)
    poses = tuple(
        Pose(np.asarray(cv2.Rodrigues(w)[0], np.float64), np.ravel(t))
        for w, t in zip(turns, shifts, strict=True)
    )
    return camera, poses


def same_size(views: Sequence[BoardView]) -> None:
    """Raise InputError, naming two pictures, where the views are not all of one size."""
    for v in views:
        if v.size != views[0].size:
            a, b = views[0], v
            raise InputError(
                f"pictures of different size: {a.name} is {a.size[0]}×{a.size[1]}, {b.name} is "
                f"{b.size[0]}×{b.size[1]}",
                hint="calibrate with pictures of one camera at one resolution",
            )


def board_pose(camera: Camera, view: BoardView) -> Pose:
    """Pose of a board seen by a known camera; board frame → camera frame."""
    return pose_of(camera, view.points, view.corners)


def pose_of(camera: Camera, points: Floats, corners: Floats) -> Pose:
    """Pose of coplanar points (n, 3) seen at ``corners`` (n, 2); the better of the two poses that
    a plane allows."""
    import cv2

    flat = camera.normalised(corners)
    fine = np.isfinite(flat).all(axis=1)
    _, turns, shifts, errors = cv2.solvePnPGeneric(
        points[fine], flat[fine].reshape(-1, 1, 2), np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
    )
    best = int(np.argmin(np.ravel(errors)))
    return Pose(nearest_rotation(cv2.Rodrigues(turns[best])[0]), np.ravel(shifts[best]))


def start_sheet(name: str, stripes: Sequence[Floats]) -> tuple[LaserSheet, list[bool]]:
    """Plane through most of the stripes, each (n, 3) mm in the camera frame, and which lie in it.

    Every pair of stripes is tried: lines that something else drew do not agree with the others.
    Raises NotEnoughViews below two stripes, Degenerate where all lie on one line, which any plane
    could contain.
    """
    if len(stripes) < 2:
        raise NotEnoughViews(
            f"laser {name!r}: its stripe was found on {len(stripes)} boards; at least 2 are needed",
            hint=Remedy(
                "take pictures with the stripe on the board or its white margin, and check the "
                "laser's colour (",
                Option("colour"),
                ") and the margin (",
                Option("margin_mm"),
                ")",
            ),
        )
    few = [s[np.linspace(0, len(s) - 1, min(len(s), _FEW)).astype(int)] for s in stripes]
    best, best_off = 0.0, np.full(len(few), np.inf)
    for i in range(len(few)):
        for j in range(i):
            both = np.concatenate([few[i], few[j]])
            centre = both.mean(axis=0)
            _, spread, axes = np.linalg.svd(both - centre, full_matrices=False)
            if spread[1] < _LEAST_SPREAD * spread[0]:
                continue
            off = np.array([float(np.abs((s - centre) @ axes[2]).mean()) for s in few])
            worth = float(np.sum(np.maximum(1 - (off / _NEAR_MM) ** 2, 0.0)))
            if worth > best:
                best, best_off = worth, off
    agree = [bool(o < _NEAR_MM) for o in best_off]
    points = [s for s, a in zip(stripes, agree, strict=True) if a]
    if len(points) < 2:
        raise Degenerate(
            f"laser {name!r}: the stripe was seen on {len(stripes)} boards, but always at nearly "
            "the same place, so the sheet could turn about it",
            hint="show the stripe on boards at clearly different distances",
        )
    cloud = np.concatenate(points)
    centre = cloud.mean(axis=0)
    axes = np.linalg.svd(cloud - centre, full_matrices=False)[2]
    return LaserSheet(name, axes[2], centre), agree
