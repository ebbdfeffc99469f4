"""What can be wrong with a picture, as far as it and the ones before it show."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Image

TORN_ROWS = 8
"""So many rows in a run, byte for byte those of an earlier picture, are not chance."""
LIVELY = 0.1
"""Rows say something where at least this share of neighbouring pixels differ, as with noise."""
BLACK_SPAN = 1 / 64
"""Of the scale: a picture with less between its darkest and its brightest pixel shows nothing."""
SATURATED_SHARE = 0.5
"""A picture with this share of clipped pixels shows nothing either."""


def fault_of(image: Image, before: Sequence[Image], lit: bool) -> str | None:
    """Name what is wrong: frozen, torn, black or saturated; None where nothing is seen.

    ``before`` are the last pictures as they came; in none of the two does a camera with noise
    give the same bytes twice. ``lit`` says that light is expected in the picture.
    """
    if np.count_nonzero(image == _top(image)) >= SATURATED_SHARE * image.size:
        return "saturated"
    low, high = int(image.min()), int(image.max())
    if lit and high - low < BLACK_SPAN * _top(image):
        return "black"
    if low == high:
        return None  # clipped to nothing: it has no noise that could tell more
    same = [b for b in before if b.shape == image.shape and b.dtype == image.dtype]
    if any(np.array_equal(image, b) for b in same):
        return "frozen"
    if any(_has_rows_of(image, b) for b in same):
        return "torn"
    return None


def blank_rows(image: Image) -> tuple[int, int] | None:
    """First and one past the last of the rows that one level fills in a lively picture.

    This is how a picture of which a part never came looks; a scene may look like it too, but then
    it does so twice.
    """
    rows = image.reshape(len(image), -1)
    blank = (rows == rows[:, :1]).all(axis=1)
    start, stop = _longest_run(blank)
    if stop - start < TORN_ROWS or blank.all():
        return None
    return (start, stop) if _liveliness(rows[~blank]) >= LIVELY else None


def _top(image: Image) -> int:
    return int(np.iinfo(image.dtype).max)


def _has_rows_of(image: Image, earlier: Image) -> bool:
    rows, old = image.reshape(len(image), -1), earlier.reshape(len(image), -1)
    # Few columns tell nearly all rows apart; the others are looked at whole.
    few = slice(None, None, max(1, rows.shape[1] // 32))
    same = (rows[:, few] == old[:, few]).all(axis=1)
    if _longest_run(same)[1] - _longest_run(same)[0] < TORN_ROWS:
        return False
    same[same] = (rows[same] == old[same]).all(axis=1)
    start, stop = _longest_run(same)
    return stop - start >= TORN_ROWS and _liveliness(rows[start:stop]) >= LIVELY


def _liveliness(rows: npt.NDArray[Any]) -> float:
    return float(np.mean(rows[:, 1:] != rows[:, :-1])) if rows.size else 0.0


def _longest_run(flags: npt.NDArray[np.bool_]) -> tuple[int, int]:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], flags.view(np.int8), [0]))))
    starts, stops = edges[::2], edges[1::2]
    if len(starts) == 0:
        return 0, 0
    k = int(np.argmax(stops - starts))
    return int(starts[k]), int(stops[k])
