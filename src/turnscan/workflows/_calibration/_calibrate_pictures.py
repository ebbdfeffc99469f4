"""The pictures of a calibration, read one after the other: boards, stripes on them, the table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeVar

import numpy as np

from turnscan.arrays import Floats
from turnscan.calibrate import (
    Board,
    BoardView,
    CalibrationSettings,
    LaserPicture,
    TablePicture,
    detect_board,
    detect_markers,
    laser_weights,
    stripe_light,
    white_margin,
)
from turnscan.errors import InputError
from turnscan.progress import Progress
from turnscan.remedy import Option
from turnscan.scan import list_pictures, numbers_apart, picture_numbers, read_picture
from turnscan.stripes import COLOURS, Orientation
from turnscan.threads import thread_count
from turnscan.workflows._importing._colour import LEARN, colour_weights

_LESSONS = 8


Item = TypeVar("Item")
Found = TypeVar("Found")


def in_turn(
    work: Callable[[Item], Found], items: Sequence[Item], progress: Progress
) -> list[Found]:
    """What ``work`` finds in each item, in order, on two processors where there are two."""
    count = progress.counter(len(items))
    with ThreadPoolExecutor(min(2, thread_count())) as pool:
        waiting = [pool.submit(work, item) for item in items]
        out = []
        try:
            for one in waiting:
                out.append(one.result())
                count()
        except BaseException:
            for one in waiting:
                one.cancel()
            raise
    return out


def camera_views(paths: list[Path], board: Board, progress: Progress) -> list[BoardView]:
    """The board in each picture."""
    return in_turn(lambda p: detect_board(read_picture(p), board, p.name), paths, progress)


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


def weights_for(
    colour: str, pairs: list[tuple[Path, Path | None]], target: Board | str
) -> Floats | None:
    """Weights (3,) of the colours; None where the pictures are grey.

    The colour is learned beside ``target``, a board or the markers of a dictionary.
    """
    if colour != LEARN:
        return np.array(colour_weights(colour))
    lessons = []
    few = np.linspace(0, len(pairs) - 1, min(len(pairs), _LESSONS)).astype(int)
    for k in few:
        lit, dark = pairs[k]
        picture = read_picture(lit)
        if picture.ndim == 2:
            return None
        off = None if dark is None else read_picture(dark)
        clear = picture if off is None else off
        if isinstance(target, str):
            corners = detect_markers(clear, target).corners.reshape(-1, 2)
        else:
            corners = detect_board(clear, target).corners
        excess = laser_weights(picture, off, corners)
        if excess is not None:
            lessons.append(excess)
    if not lessons:
        return np.array(COLOURS["grey"])
    # One channel, not a mix: a lens puts the colours at slightly different places.
    best: Floats = np.eye(3)[int(np.mean(lessons, axis=0).argmax())]
    return best


def laser_pictures(
    pairs: list[tuple[Path, Path | None]],
    board: Board,
    weights: Floats | None,
    orientation: Orientation,
    progress: Progress,
) -> list[LaserPicture]:
    """The board, and what may be the stripe on it, in each picture."""

    def look(pair: tuple[Path, Path | None]) -> LaserPicture:
        lit, dark = pair
        picture = read_picture(lit)
        off = None if dark is None else read_picture(dark)
        view = detect_board(picture if off is None else off, board, lit.name)
        if view.failure:
            return LaserPicture(view, np.zeros((0, 2)))
        light = stripe_light(picture, off, weights, orientation)
        margin = white_margin(picture if off is None else off, view)
        return LaserPicture.of(view, light, margin)

    return in_turn(look, pairs, progress)


def table_pictures(
    pairs: list[tuple[Path, Path | None]],
    settings: CalibrationSettings,
    laser: str | None,
    weights: Floats | None,
    progress: Progress,
) -> list[TablePicture]:
    """Markers or board on the table, and what may be stripes there, in each picture."""

    def look(item: tuple[tuple[Path, Path | None], float]) -> TablePicture:
        (lit, dark), step = item
        picture = read_picture(lit)
        off = None if dark is None else read_picture(dark)
        clear = picture if off is None else off
        light = {}
        if laser is not None:
            light[laser] = stripe_light(picture, off, weights, settings.orientation).places
        if settings.table_board is None:
            seen = detect_markers(clear, settings.dictionary)
            return TablePicture(seen, light, lit.name, step)
        view = detect_board(clear, settings.table_board, lit.name)
        return TablePicture(view, light, lit.name, step)

    steps = _steps([p.name for p, _ in pairs])
    return in_turn(look, list(zip(pairs, steps, strict=True)), progress)


def _steps(names: list[str]) -> list[float]:
    """Step numbers from the numbers in the names, or 0, 1, 2 …"""
    numbers = picture_numbers(names)
    if numbers is None:
        return [float(k) for k in range(len(names))]
    first = min(numbers)
    apart = numbers_apart(numbers, first)
    return [float((n - first) // apart) for n in numbers]
