"""ArUco markers in a picture, with sub-pixel corners."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from turnscan.arrays import Floats, Image, Ints, frozen
from turnscan.calibrate._picture import grey8
from turnscan.errors import InputError

_SMALLEST_SIDE = 10.0  # px: below this the four corners say nothing to a tenth of a pixel


@dataclass(frozen=True)
class MarkerView:
    """The markers found in one picture."""

    numbers: Ints
    """(m,) ids, ascending, each once."""
    corners: Floats
    """(m, 4, 2) px, clockwise from the marker's own top left."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "numbers", frozen(self.numbers, (None,), "numbers", np.int32))
        m = len(self.numbers)
        object.__setattr__(self, "corners", frozen(self.corners, (m, 4, 2), "corners"))


def aruco_dictionary(name: str) -> Any:
    """OpenCV's marker dictionary of that name, like ``DICT_4X4_50``.

    Raises InputError that lists the names there are.
    """
    import cv2

    if not name.startswith("DICT_") or not hasattr(cv2.aruco, name):
        known = sorted(n for n in dir(cv2.aruco) if n.startswith("DICT_"))
        raise InputError(
            f"no marker dictionary is called {name!r}", hint="one of " + ", ".join(known)
        )
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))


def detect_markers(image: Image, dictionary: str) -> MarkerView:
    """Find the markers of one dictionary in a picture (H, W) or (H, W, 3).

    The corners are refined to the crossing of straight lines fitted to the marker's outline. A
    marker found twice is dropped: one of the two is not a marker.
    """
    import cv2

    settings = cv2.aruco.DetectorParameters()
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    settings.relativeCornerRefinmentWinSize = 0.6
    settings.cornerRefinementWinSize = 6
    detector = cv2.aruco.ArucoDetector(aruco_dictionary(dictionary), settings)
    corners, numbers, _ = detector.detectMarkers(grey8(image))
    if numbers is None or len(corners) == 0:
        return MarkerView(np.zeros(0, np.int32), np.zeros((0, 4, 2)))
    ids = np.asarray(numbers).reshape(-1)
    quads = np.asarray(corners, dtype=np.float64).reshape(-1, 4, 2)
    side = np.linalg.norm(quads - np.roll(quads, 1, axis=1), axis=2).min(axis=1)
    once = np.array([np.count_nonzero(ids == n) == 1 for n in ids], dtype=bool)
    keep = np.flatnonzero(once & (side >= _SMALLEST_SIDE))
    keep = keep[np.argsort(ids[keep])]
    return MarkerView(ids[keep], quads[keep])
