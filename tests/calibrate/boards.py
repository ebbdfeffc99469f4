"""Drawn boards, and a picture of the table's markers."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from tests.calibrate.world import true_layout, true_rig
from turnscan.rig import Rig, rotation_z


def drawn_charuco(legacy: bool = False) -> np.ndarray:
    d = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    board = cv2.aruco.CharucoBoard((7, 5), 25.0, 19.0, d)
    board.setLegacyPattern(legacy)
    return np.asarray(board.generateImage((700, 500), marginSize=40))


def drawn_chessboard() -> np.ndarray:
    y, x = np.mgrid[0:480, 0:640]
    black = ((x - 60) // 50 + (y - 50) // 50) % 2 == 0
    inside = (x >= 60) & (x < 60 + 450) & (y >= 50) & (y < 50 + 350)
    return np.where(black & inside, 30, 220).astype(np.uint8)


def marker_picture(angle: float) -> np.ndarray:
    """The platter of the world, drawn through its camera."""
    rig, layout = true_rig(), replace(true_layout(), shape=np.zeros(5))
    d = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    big = np.full((4 * 480, 4 * 640), 210, np.uint8)
    camera = replace(rig.camera, distortion=np.zeros(5))
    points, _ = layout.points(layout.numbers)
    px = camera.project(rig.T_camera_table.apply(points @ rotation_z(angle).T)).reshape(-1, 4, 2)
    for n, quad in zip(layout.numbers, px, strict=True):
        tile = cv2.aruco.generateImageMarker(d, int(n), 240)
        corners = np.array([[-0.5, -0.5], [239.5, -0.5], [239.5, 239.5], [-0.5, 239.5]])
        to = ((quad + 0.5) * 4 - 0.5).astype(np.float32)
        H = cv2.getPerspectiveTransform(corners.astype(np.float32), to)
        cv2.warpPerspective(
            tile, H, (4 * 640, 4 * 480), big, cv2.INTER_LINEAR, cv2.BORDER_TRANSPARENT
        )
    return np.asarray(cv2.resize(big, (640, 480), interpolation=cv2.INTER_AREA))


def with_markers(aside: float) -> Rig:
    """The rig of `marker_picture`, its camera ``aside`` mm beside where it was."""
    rig = true_rig()
    T = rig.T_camera_table
    return replace(
        rig,
        camera=replace(rig.camera, distortion=np.zeros(5)),
        markers=replace(true_layout(), shape=np.zeros(5)).markers("DICT_4X4_50"),
        T_camera_table=replace(T, translation=T.translation + [aside, 0.0, 0.0]),
    )
