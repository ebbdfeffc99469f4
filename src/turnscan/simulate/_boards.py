"""Calibration boards as bodies of a scene: a printed sheet on a thin upright plate."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from turnscan.rig import Pose, rotation_about
from turnscan.simulate._parts import Part
from turnscan.simulate._scene import Body, Material, Texture
from turnscan.simulate._solids import extruded

_PIXELS_PER_SQUARE = 120
_INK, _PAPER = 0.06, 0.85


def _charuco() -> tuple[npt.NDArray[np.uint8], float, float]:
    """9 × 6 squares of 12 mm with markers of 9 mm from DICT_5X5_100."""
    import cv2

    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    made = cv2.aruco.CharucoBoard((9, 6), 12.0, 9.0, dictionary)
    size = (9 * _PIXELS_PER_SQUARE, 6 * _PIXELS_PER_SQUARE)
    return np.asarray(made.generateImage(size)), 108.0, 72.0


def _chessboard() -> tuple[npt.NDArray[np.uint8], float, float]:
    """10 × 7 squares of 10 mm."""
    squares = np.indices((7, 10)).sum(axis=0) % 2 * 255
    big = np.kron(squares, np.ones((_PIXELS_PER_SQUARE, _PIXELS_PER_SQUARE)))
    return big.astype(np.uint8), 100.0, 70.0


BOARDS: Mapping[str, Callable[[], tuple[npt.NDArray[np.uint8], float, float]]] = {
    "charuco": _charuco,
    "chessboard": _chessboard,
}


def board(name: str, margin: float = 10.0, lean: float = 0.15) -> Body:
    """One of `BOARDS` on a `printed_plate`."""
    return printed_plate(name, *BOARDS[name](), margin, lean)


def printed_plate(
    name: str,
    print_: npt.NDArray[np.uint8],
    width: float,
    height: float,
    margin: float = 10.0,
    lean: float = 0.15,
) -> Body:
    """A print (h, w), 0 for ink and 255 for paper, of ``width`` by ``height`` mm on a plate that
    stands on the table, leaning back by ``lean`` rad, and looks along +x.

    ``margin`` mm of white paper surround the print.
    """
    w, h, thick = width / 2 + margin, height + 2 * margin, 3.0
    mesh = extruded([(-thick, -w), (0.0, -w), (0.0, w), (-thick, w)], 0.0, h)
    # Pixel columns run to the right as the camera at +x sees it: along +y.
    texture = Texture(
        _INK / _PAPER + (1 - _INK / _PAPER) * print_.astype(np.float64) / 255.0,
        np.array([0.0, -width / 2, h - margin]),
        np.array([0.0, width, 0.0]),
        np.array([0.0, 0.0, -height]),
    )
    R = rotation_about((0.0, 1.0, 0.0), -lean)
    low = float((mesh.vertices @ R[2]).min())
    paper = Material((_PAPER, _PAPER, _PAPER))
    return Body(Part(name, mesh), paper, Pose(R, np.array([0.0, 0.0, -low])), texture)
