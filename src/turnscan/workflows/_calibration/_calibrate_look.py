"""A look at the first pictures of each stage of a calibration: are they what they should be?

What is wrong is said within seconds, by what the pictures show, and not after all are read.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from turnscan.arrays import Bools, Floats, Image
from turnscan.calibrate import (
    Board,
    Chessboard,
    detect_board,
    detect_markers,
    other_chessboard,
    picture_fault,
    stripe_light,
)
from turnscan.errors import FormatError, InputError
from turnscan.remedy import Option, Remedy
from turnscan.scan import read_picture
from turnscan.stripes import Orientation

_SAMPLES = 6
"""Pictures of a stage, spread evenly, of which at least one must show what it should."""
_QUESTIONED = 2
"""Of them, how many are asked what else they show."""
_DICTIONARIES = (
    "DICT_4X4_50",
    "DICT_4X4_250",
    "DICT_5X5_250",
    "DICT_6X6_250",
    "DICT_7X7_250",
    "DICT_ARUCO_ORIGINAL",
    "DICT_APRILTAG_36h11",
)

_BEND = 2.0
"""px between a centre and the line through its neighbours, at most."""
_FIXED_PX, _USUAL_WIDTH = 4.0, 640
"""px by which the stripe on an empty platter may move, in pictures of that width: warp and lean of
a platter come to half of it."""
_THRICE = 3
"""Pictures in which a line of the picture must show the stripe to tell whether it moves."""
_MOVES = 0.1
"""Of these lines, so many in which it does are no chance."""
_CLEAR = 1.35
"""A marker's printed square and the blur around it, in sides."""


def check_sizes(paths: Sequence[Path]) -> None:
    """Raise InputError naming two pictures of different size; only their headers are read."""
    from PIL import Image as Pillow
    from PIL import UnidentifiedImageError

    first: tuple[Path, tuple[int, int]] | None = None
    for path in paths:
        try:
            with Pillow.open(path) as picture:
                size = picture.size
        except (OSError, UnidentifiedImageError, SyntaxError, Pillow.DecompressionBombError):
            read_picture(path)
            raise FormatError(f"{path}: not a picture") from None
        if first is None:
            first = (path, size)
        elif size != first[1]:
            (a, (w, h)), (v, u) = first, (size[1], size[0])
            raise InputError(
                f"pictures of different size: {a} is {w}×{h}, {path} is {u}×{v}",
                hint="calibrate with pictures of one camera at one resolution",
            )


def look_for_board(paths: Sequence[Path], board: Board, stage: Option, dictionary: str) -> None:
    """Raise InputError where none of some pictures shows the board, saying what they show."""

    def name(picture: Image) -> str:
        return detect_board(picture, board).failure

    def instead(picture: Image) -> InputError | None:
        if isinstance(board, Chessboard):
            other = other_chessboard(picture, board)
            if other is not None:
                c, r = other if board.columns >= board.rows else other[::-1]
                return InputError(
                    f"the pictures show a chessboard of {c}x{r} inner corners, not of "
                    f"{board.columns}x{board.rows}",
                    hint=Remedy("count inner corners, not squares: give ",
                                Option("board", f"chessboard:{c}x{r}:{board.square:g}")),
                    option=stage,
                )  # fmt: skip
        if len(detect_markers(picture, dictionary).numbers):
            what = (
                "a ChArUco board, or the turntable?"
                if isinstance(board, Chessboard)
                else ("the turntable, or a board of another layout?")
            )
            return InputError(
                f"the pictures show no {_kind(board)}, but markers of {dictionary}: {what}",
                hint=Remedy("give the pictures of the board here, and check ", Option("board")),
                option=stage,
            )
        return None

    _look(paths, name, instead, stage, f"the {_kind(board)}")


def look_for_markers(paths: Sequence[Path], dictionary: str, board: Board | None) -> None:
    """Raise InputError where none of some pictures of the table shows a marker."""

    def name(picture: Image) -> str:
        seen = detect_markers(picture, dictionary)
        return "" if len(seen.numbers) else f"no marker of {dictionary}"

    def instead(picture: Image) -> InputError | None:
        for other in _DICTIONARIES:
            if other != dictionary and len(detect_markers(picture, other).numbers) > 1:
                return InputError(
                    f"the pictures show markers of {other}, not of {dictionary}",
                    hint=Remedy("name the dictionary that was printed: ", Option("markers")),
                    option=Option("table"),
                )
        if board is not None and not detect_board(picture, board).failure:
            return InputError(
                "the pictures show the board and no marker: they are those of another stage",
                hint=Remedy("give the pictures of the empty, turning table here, or the board that "
                            "is fixed to it as ", Option("table_board")),
                option=Option("table"),
            )  # fmt: skip
        return None

    _look(paths, name, instead, Option("table"), f"a marker of {dictionary}")


def look_for_part(
    pairs: Sequence[tuple[Path, Path | None]],
    dictionary: str,
    weights: Floats | None,
    orientation: Orientation,
) -> None:
    """Raise InputError where a part stands on the table.

    A sheet meets an empty platter in one line of the picture, whichever way it is turned; on a part
    that line goes another way in each picture.
    """
    across = 0 if orientation == "vertical" else 1
    places, width = [], 0
    for k in np.unique(np.linspace(0, len(pairs) - 1, _SAMPLES).round().astype(int)):
        lit, dark = pairs[k]
        picture, off = read_picture(lit), None if dark is None else read_picture(dark)
        seen = stripe_light(picture, off, weights, orientation, most=1).places
        corners = detect_markers(picture if off is None else off, dictionary).corners
        lines, width = picture.shape[across], picture.shape[1 - across]
        line = np.full(lines, np.nan)
        free = seen[~_on_markers(seen, corners)]
        line[free[:, 1 - across].astype(int)] = free[:, across]
        bend = np.abs(np.diff(line, 2, prepend=np.nan, append=np.nan))
        places.append(np.where(bend < _BEND, line, np.nan))
    at = np.array(places)
    at = at[:, np.isfinite(at).sum(axis=0) >= _THRICE]
    if not at.shape[1]:
        return
    apart = np.nanmax(at, axis=0) - np.nanmin(at, axis=0)
    moves = apart > _FIXED_PX * max(1.0, width / _USUAL_WIDTH)
    if np.mean(moves) > _MOVES:
        raise InputError(
            "a part stands on the table: the stripe is in another place in each picture, by "
            f"{np.median(apart[moves]):.0f} px in {np.mean(moves):.0%} of the lines where it is "
            "seen; on an empty platter it stays",
            hint=Remedy("give pictures of the empty table; where no laser was lit in these: ",
                        Option("table_laser", "none")),
            option=Option("table"),
        )  # fmt: skip


def _on_markers(at: Floats, corners: Floats) -> Bools:
    """Which of (n, 2) px lie on markers (m, 4, 2) px, or close beside them."""
    on = np.zeros(len(at), dtype=bool)
    for square in corners:
        middle = square.mean(axis=0)
        around = middle + _CLEAR * (square - middle)
        sides = np.roll(around, -1, axis=0) - around
        off = at[:, None] - around
        turned = sides[:, 0] * off[..., 1] - sides[:, 1] * off[..., 0]
        on |= (turned >= 0).all(axis=1) | (turned <= 0).all(axis=1)
    return on


def _look(
    paths: Sequence[Path],
    failure_of: Callable[[Image], str],
    instead: Callable[[Image], InputError | None],
    stage: Option,
    sought: str,
) -> None:
    places = np.unique(np.linspace(0, len(paths) - 1, _SAMPLES).round().astype(int))
    faults, seen = [], []
    for path in (paths[i] for i in places):
        picture = read_picture(path)
        why = failure_of(picture)
        if not why:
            return
        seen.append((path, picture, why))
        faults.append(picture_fault(picture))
    for _, picture, _ in seen[:_QUESTIONED]:
        error = instead(picture)
        if error is not None:
            raise error
    bad = [f for f in faults if f]
    if 2 * len(bad) > len(faults):
        k = next(k for k, f in enumerate(faults) if f)
        raise InputError(
            f"{sought} is in none of {len(seen)} pictures looked at; {seen[k][0].name} is "
            f"{faults[k]}",
            hint="take the pictures again: sharp, evenly lit, nothing clipped",
            option=stage,
        )
    if len(seen) == len(paths):
        return  # the stage itself says how many were found of how many
    raise InputError(
        f"{sought} is in none of {len(seen)} pictures looked at; {seen[0][0].name}: {seen[0][2]}",
        hint="check the target's size and dictionary, and that it is sharp and evenly lit",
        option=stage,
    )


def _kind(board: Board) -> str:
    if isinstance(board, Chessboard):
        return f"chessboard of {board.columns}x{board.rows} inner corners"
    return f"ChArUco board of {board.columns}x{board.rows} squares"
