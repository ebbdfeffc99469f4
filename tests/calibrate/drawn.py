"""Pictures of a board that are drawn finely, with where its corners truly are."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np

from turnscan.arrays import Floats, Singles
from turnscan.calibrate import BoardView, Charuco

BOARD = Charuco(9, 6, 12.0, 9.0, "DICT_5X5_100")
FINE = 8
"""Samples of a drawn pixel in each direction."""


@cache
def _print() -> Singles:
    """The board (720, 1080), 10 px for each mm. Single precision is far finer than a grey level."""
    kind = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    made = cv2.aruco.CharucoBoard((9, 6), 12.0, 9.0, kind)
    return np.asarray(made.generateImage((1080, 720)), dtype=np.float32)


def seen_board(angle: float, blur: float) -> tuple[Floats, Floats]:
    """A picture (360, 480) of the board turned by ``angle`` rad about the vertical, leaning a
    little, and the matrix that takes mm on its print to px."""
    c, s = np.cos(angle), np.sin(angle)
    turned = np.array([[c, 0.02, 0.0], [0.03, 1.0, 0.0], [s, 0.1, 420.0]])
    middle = np.array([[1.0, 0.0, -54.0], [0.0, 1.0, -36.0], [0.0, 0.0, 1.0]])
    camera = np.array([[1136.0, 0.0, 240.3], [0.0, 1136.0, 179.6], [0.0, 0.0, 1.0]])
    H = camera @ turned @ middle
    # From a sample of the picture to the sample of the print that it lies in.
    sample = np.array([[1 / FINE, 0, 0.5 / FINE - 0.5], [0, 1 / FINE, 0.5 / FINE - 0.5], [0, 0, 1]])
    print_sample = np.array([[10.0, 0.0, -0.5], [0.0, 10.0, -0.5], [0.0, 0.0, 1.0]])
    fine = cv2.warpPerspective(
        _print(), print_sample @ np.linalg.inv(H) @ sample, (480 * FINE, 360 * FINE),
        flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP, borderValue=(255.0,),
    )  # fmt: skip
    if blur:
        # The lens blurs what then falls on pixels.
        fine = cv2.GaussianBlur(fine, (0, 0), blur * FINE)
    seen = cv2.resize(fine, (480, 360), interpolation=cv2.INTER_AREA)
    return seen.astype(np.float64) * 0.6 + 30.0, H


def places_seen(view: BoardView, H: Floats) -> Floats:
    """(n, 2) px where the corners that were found truly are."""
    # The inner corners are counted from the first one, a square into the print.
    at = np.column_stack([BOARD.points[view.ids, :2] + 12.0, np.ones(len(view.ids))]) @ H.T
    return np.asarray(at[:, :2] / at[:, 2:])
