"""The pictures of a calibration, read one after the other: boards, stripes on them, the table."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from turnscan.arrays import Floats, Image
from turnscan.calibrate import (
    Board,
    BoardView,
    CalibrationSettings,
    LaserPicture,
    TablePicture,
    detect_board,
    detect_markers,
    laser_weights,
    stripe_candidates,
)
from turnscan.errors import InputError
from turnscan.progress import Progress
from turnscan.remedy import Option
from turnscan.scan import list_pictures, numbers_apart, picture_numbers, read_picture
from turnscan.stripes import Orientation

_COLOURS = {
    "grey": (1.0, 1.0, 1.0),
    "red": (1.0, 0.0, 0.0),
    "green": (0.0, 1.0, 0.0),
    "blue": (0.0, 0.0, 1.0),
}
_LESSONS = 8


class SameSize:
    """Checks that all pictures come from one camera at one resolution."""

    def __init__(self) -> None:
        self.first: tuple[str, tuple[int, ...]] | None = None

    def check(self, path: Path, picture: Image) -> Image:
        """The picture; raises InputError where its size is not that of the first one."""
        shape = picture.shape[:2]
        if self.first is None:
            self.first = (str(path), shape)
        elif self.first[1] != shape:
            a, (h, w) = self.first
            raise InputError(
                f"pictures of different size: {a} is {w}×{h}, {path} is {shape[1]}×{shape[0]}",
                hint="calibrate with pictures of one camera at one resolution",
            )
        return picture


def camera_views(
    paths: list[Path], board: Board, size: SameSize, progress: Progress
) -> list[BoardView]:
    """The board in each picture."""
    return [
        detect_board(size.check(p, read_picture(p)), board, p.name) for p in progress.track(paths)
    ]


def with_dark(lit: list[Path], dark: str | None, option: Option) -> list[tuple[Path, Path | None]]:
    """Each picture with the laser on and the one with it off, None where there is none.

    Raises InputError naming ``option`` where their numbers do not fit.
    """
    if dark is None:
        return [(p, None) for p in lit]
    off = list_pictures(dark)
    if len(off) not in (1, len(lit)):
        raise InputError(
            f"{len(lit)} pictures with the laser on, {len(off)} with it off",
            hint="give as many, or one for all",
            option=option,
        )
    return [(p, off[0] if len(off) == 1 else q) for p, q in zip(lit, off * len(lit), strict=False)]


def colour_weights(
    colour: str, pairs: list[tuple[Path, Path | None]], board: Board
) -> Floats | None:
    """Weights (3,) of the colours; None where the pictures are grey."""
    if colour in _COLOURS:
        return np.array(_COLOURS[colour])
    if colour != "learn":
        try:
            weights = np.array([float(x) for x in colour.split(",")])
        except ValueError:
            weights = np.zeros(0)
        if weights.shape != (3,) or not np.isfinite(weights).all() or not weights.any():
            raise InputError(
                "not a colour",
                hint="give red, green, blue, grey, three weights like -0.5,1,-0.5, or learn",
                option=Option("colour", colour),
            )
        return weights
    lessons = []
    few = np.linspace(0, len(pairs) - 1, min(len(pairs), _LESSONS)).astype(int)
    for k in few:
        lit, dark = pairs[k]
        picture = read_picture(lit)
        if picture.ndim == 2:
            return None
        view = detect_board(picture, board)
        off = None if dark is None else read_picture(dark)
        excess = laser_weights(picture, off, view.corners)
        if excess is not None:
            lessons.append(excess)
    if not lessons:
        return np.array(_COLOURS["grey"])
    # One channel, not a mix: a lens puts the colours at slightly different places.
    best: Floats = np.eye(3)[int(np.mean(lessons, axis=0).argmax())]
    return best


def laser_pictures(
    pairs: list[tuple[Path, Path | None]],
    board: Board,
    weights: Floats | None,
    orientation: Orientation,
    size: SameSize,
    progress: Progress,
) -> list[LaserPicture]:
    """The board, and what may be the stripe on it, in each picture."""
    out = []
    for lit, dark in progress.track(pairs):
        picture = size.check(lit, read_picture(lit))
        off = None if dark is None else size.check(dark, read_picture(dark))
        view = detect_board(picture if off is None else off, board, lit.name)
        light = np.zeros((0, 2))
        if not view.failure:
            light = stripe_candidates(picture, off, weights, orientation)
        out.append(LaserPicture(view, light))
    return out


def table_pictures(
    pairs: list[tuple[Path, Path | None]],
    settings: CalibrationSettings,
    laser: str | None,
    weights: Floats | None,
    size: SameSize,
    progress: Progress,
) -> list[TablePicture]:
    """Markers or board on the table, and what may be stripes there, in each picture."""
    steps = _steps([p.name for p, _ in pairs])
    out = []
    for (lit, dark), step in zip(progress.track(pairs), steps, strict=True):
        picture = size.check(lit, read_picture(lit))
        off = None if dark is None else size.check(dark, read_picture(dark))
        clear = picture if off is None else off
        light = {}
        if laser is not None:
            light[laser] = stripe_candidates(picture, off, weights, settings.orientation)
        if settings.table_board is None:
            seen = detect_markers(clear, settings.dictionary)
            out.append(TablePicture(seen, light, lit.name, step))
        else:
            view = detect_board(clear, settings.table_board, lit.name)
            out.append(TablePicture(view, light, lit.name, step))
    return out


def _steps(names: list[str]) -> list[float]:
    """Step numbers from the numbers in the names, or 0, 1, 2 …"""
    numbers = picture_numbers(names)
    if numbers is None:
        return [float(k) for k in range(len(names))]
    first = min(numbers)
    apart = numbers_apart(numbers, first)
    return [float((n - first) // apart) for n in numbers]
