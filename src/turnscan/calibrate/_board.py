"""Calibration boards: what they look like, and where they are in a picture."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from turnscan.arrays import Floats, Image, Ints, frozen
from turnscan.calibrate._corners import refined_corners
from turnscan.calibrate._markers import aruco_dictionary
from turnscan.calibrate._picture import Grey, grey8, grey_of, picture_fault
from turnscan.errors import FormatError

_FEWEST_CORNERS = 6
_GRAMMAR = (
    "write chessboard:COLSxROWS:SQUARE_MM (inner corners) or "
    "charuco:COLSxROWS:SQUARE_MM:MARKER_MM:DICT (squares), for instance chessboard:8x6:40"
)


@dataclass(frozen=True)
class Chessboard:
    """A chessboard, counted in inner corners."""

    columns: int
    rows: int
    square: float
    """mm"""

    @cached_property
    def points(self) -> Floats:
        """(n, 3) mm: the inner corners, row by row; board frame x right, y down, z away."""
        return _lattice(self.columns, self.rows, self.square)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """x0, y0, x1, y1 mm of the printed pattern."""
        s = self.square
        return -s, -s, self.columns * s, self.rows * s


@dataclass(frozen=True)
class Charuco:
    """A chessboard with markers in its white squares, counted in squares."""

    columns: int
    rows: int
    square: float
    """mm"""
    marker: float
    """mm"""
    dictionary: str

    @cached_property
    def points(self) -> Floats:
        """(n, 3) mm: the inner corners, row by row; board frame x right, y down, z away."""
        return _lattice(self.columns - 1, self.rows - 1, self.square)

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """x0, y0, x1, y1 mm of the printed pattern."""
        s = self.square
        return -s, -s, (self.columns - 1) * s, (self.rows - 1) * s


Board: TypeAlias = Chessboard | Charuco


@dataclass(frozen=True)
class BoardView:
    """A board in one picture: its corners, or why it was not found."""

    board: Board
    corners: Floats
    """(n, 2) px."""
    ids: Ints
    """(n,) which of ``board.points`` each corner is."""
    size: tuple[int, int]
    """Width and height of the picture, px."""
    name: str = ""
    """The picture's name, for messages."""
    failure: str = ""
    """Why there are no corners; empty when there are."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "corners", frozen(self.corners, (None, 2), "corners"))
        n = len(self.corners)
        object.__setattr__(self, "ids", frozen(self.ids, (n,), "ids", np.int32))

    @property
    def points(self) -> Floats:
        """(n, 3) mm: the found corners in the board frame."""
        points: Floats = self.board.points[self.ids]
        return points


def parse_board(text: str) -> Board:
    """``chessboard:8x6:40`` or ``charuco:7x5:25:19:DICT_4X4_50`` → the board.

    Raises FormatError that says which part does not fit.
    """
    kind, *parts = text.split(":")
    try:
        columns, rows = (int(n) for n in parts[0].lower().split("x"))
        lengths = [float(p) for p in parts[1:3]]
    except (ValueError, IndexError):
        raise FormatError(f"board {text!r}: cannot be read", hint=_GRAMMAR) from None
    if not (3 <= columns <= 200 and 3 <= rows <= 200):
        raise FormatError(
            f"board {text!r}: {columns}x{rows}, expected 3 to 200 each", hint=_GRAMMAR
        )
    if not lengths or not all(0 < v < 1e5 for v in lengths):
        raise FormatError(f"board {text!r}: lengths must be positive mm", hint=_GRAMMAR)
    if kind == "chessboard" and len(parts) == 2:
        return Chessboard(columns, rows, lengths[0])
    if kind == "charuco" and len(parts) == 4:
        if lengths[1] >= lengths[0]:
            raise FormatError(
                f"board {text!r}: a marker of {lengths[1]:g} mm does not fit into a square of "
                f"{lengths[0]:g} mm",
                hint=_GRAMMAR,
            )
        aruco_dictionary(parts[3])
        return Charuco(columns, rows, lengths[0], lengths[1], parts[3])
    raise FormatError(f"board {text!r}: neither a chessboard nor a charuco board", hint=_GRAMMAR)


def detect_board(image: Image, board: Board, name: str = "") -> BoardView:
    """Find a board in a picture (H, W) or (H, W, 3), corners to sub-pixel.

    A chessboard must be seen whole; of a ChArUco board six corners not in one row are enough.
    A view without corners says in ``failure`` why.
    """
    grey = grey8(image)
    size = (grey.shape[1], grey.shape[0])
    empty = (np.zeros((0, 2)), np.zeros(0, np.int32))
    if isinstance(board, Charuco):
        corners, ids, failure = _find_charuco(grey, board)
    else:
        corners, failure = _find_chessboard(grey, board)
        ids = np.arange(len(corners), dtype=np.int32)
    if not failure and _on_one_line(board.points[ids, :2]):
        failure = f"only {len(ids)} corners, all in one row"
    if failure:
        return BoardView(board, *empty, size, name, failure)
    clear = (1 - board.marker / board.square) / 2 if isinstance(board, Charuco) else 1.0
    squares = board.points[ids, :2] / board.square
    levels = np.asarray(grey_of(image), dtype=np.float64)
    return BoardView(board, refined_corners(levels, corners, squares, clear), ids, size, name)


def _lattice(columns: int, rows: int, square: float) -> Floats:
    y, x = np.mgrid[0:rows, 0:columns]
    return np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1) * float(square)


def _on_one_line(points: Floats) -> bool:
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(spread[1] < 1e-6 * spread[0])


def _find_chessboard(grey: Grey, board: Chessboard) -> tuple[Floats, str]:
    import cv2

    pattern = (board.columns, board.rows)
    exhaustive = cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    classic = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    for flags in (0, exhaustive):
        found, corners = cv2.findChessboardCornersSB(grey, pattern, flags=flags)
        if found:
            return _refined(grey, corners, board), ""
    found, corners = cv2.findChessboardCorners(
        grey, pattern, flags=classic | cv2.CALIB_CB_FAST_CHECK
    )
    if found:
        return _refined(grey, corners, board), ""
    fault = picture_fault(grey)
    if fault:
        return np.zeros((0, 2)), f"the picture is {fault}"
    return np.zeros((0, 2)), (
        f"no chessboard of {board.columns}x{board.rows} inner corners "
        "(covered, cut off, or another size)"
    )


def other_chessboard(image: Image, board: Chessboard) -> tuple[int, int] | None:
    """The larger and the smaller number of inner corners of another chessboard in a picture.

    A person who counts squares is off by one. Boards with up to three rows or columns less than
    ``board``, or with more of them, are looked for.
    """
    import cv2

    least = (max(3, board.columns - 3), max(3, board.rows - 3))
    flags = cv2.CALIB_CB_LARGER | cv2.CALIB_CB_NORMALIZE_IMAGE
    found, _, meta = cv2.findChessboardCornersSBWithMeta(grey8(image), least, flags=flags)
    if not found:
        return None
    size = (max(meta.shape), min(meta.shape))
    own = (max(board.columns, board.rows), min(board.columns, board.rows))
    return None if size == own else size


def _refined(grey: Grey, corners: Any, board: Chessboard) -> Floats:
    """Sub-pixel saddle points, in right-handed order (x right, y down, z away)."""
    import cv2

    grid = np.asarray(corners, dtype=np.float32).reshape(board.rows, board.columns, 2)
    near = min(
        float(np.linalg.norm(np.diff(grid, axis=0), axis=2).min()),
        float(np.linalg.norm(np.diff(grid, axis=1), axis=2).min()),
    )
    half = int(np.clip(round(near * 0.3), 2, 11))
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-4)
    fine = cv2.cornerSubPix(grey, grid.reshape(-1, 1, 2).copy(), (half, half), (-1, -1), stop)
    fine = np.asarray(fine, dtype=np.float64).reshape(board.rows, board.columns, 2)
    right, down = fine[0, -1] - fine[0, 0], fine[-1, 0] - fine[0, 0]
    if right[0] * down[1] - right[1] * down[0] < 0:
        fine = fine[:, ::-1]
    result: Floats = fine.reshape(-1, 2)
    return result


def _charuco_detector(board: Charuco, legacy: bool) -> Any:
    import cv2

    pattern = cv2.aruco.CharucoBoard(
        (board.columns, board.rows),
        float(board.square),
        float(board.marker),
        aruco_dictionary(board.dictionary),
    )
    pattern.setLegacyPattern(legacy)
    return cv2.aruco.CharucoDetector(pattern)


def _find_charuco(grey: Grey, board: Charuco) -> tuple[Floats, Ints, str]:
    # Boards printed by older programs begin with a marker where newer ones begin with black:
    # the layout that explains more corners is the right one.
    best = (np.zeros((0, 2)), np.zeros(0, np.int32))
    markers = 0
    for legacy in (False, True):
        corners, ids, seen, _ = _charuco_detector(board, legacy).detectBoard(grey)
        markers = max(markers, 0 if seen is None else len(seen))
        if ids is not None and len(ids) > len(best[1]):
            flat = np.asarray(ids, dtype=np.int32).reshape(-1)
            best = (np.asarray(corners, dtype=np.float64).reshape(-1, 2), flat)
    if len(best[1]) >= _FEWEST_CORNERS:
        return *best, ""
    mirrored = np.ascontiguousarray(grey[:, ::-1])
    _, ids, _, _ = _charuco_detector(board, False).detectBoard(mirrored)
    if ids is not None and len(ids) >= _FEWEST_CORNERS:
        return *best, "the picture is mirrored: the board reads only when the picture is flipped"
    if markers == 0:
        return *best, f"none of its {board.dictionary} markers is readable"
    return *best, f"{len(best[1])} corners between {markers} markers; at least {_FEWEST_CORNERS}"
