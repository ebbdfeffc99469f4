"""How far the white margin of a board goes on around its pattern, as a picture shows it."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Image
from turnscan.calibrate._board import BoardView
from turnscan.calibrate._picture import grey8

USUAL = 1.5
"""Squares: the margin where no picture shows its end."""
_FIRST, _LAST, _EVERY = 0.15, 4.0, 0.05
"""Squares from the pattern, between which its end is looked for."""
_LINES = 48
_WINDOW, _THIN = 3, 11
"""Samples: over which steps are looked for, and more than a stripe is wide."""
_STEP = 0.06
"""Of the board's white: a step in brightness that ends it; light and shade on it change slowly."""
_WHITE = 0.6
"""Of the pattern's white: what is darker right beside the pattern is no margin."""
_SEEN = 0.3
"""Of the lines must lie in the picture."""


def white_margin(picture: Image, view: BoardView) -> Floats:
    """(4,) mm of white beyond the pattern's left, top, right and bottom, to where it ends.

    ``picture`` is (H, W) or (H, W, 3), best without laser light; ``view`` has corners. The
    brightness is followed outwards from the whole length of each side, taking the median of what
    lies at one distance, so that a stripe or fingers do not matter. It ends with a step, or with
    the picture; where neither is found, at `USUAL` squares.
    """
    import cv2
    from scipy.ndimage import map_coordinates

    grey = grey8(picture)
    to_pixels, _ = cv2.findHomography(view.points[:, :2], view.corners)
    square = view.board.square
    away = np.arange(_FIRST, _LAST, _EVERY) * square
    x0, y0, x1, y1 = view.board.extent
    along = np.linspace(0.03, 0.97, _LINES)[:, None]
    x, y = x0 + along * (x1 - x0) + 0 * away, y0 + along * (y1 - y0) + 0 * away
    white = _white_of(grey, view)
    out = np.zeros(4)
    sides = ((x0 - away, y), (x, y0 - away), (x1 + away, y), (x, y1 + away))
    for k, (u, v) in enumerate(sides):
        u, v = np.broadcast_arrays(u, v)
        flat = np.stack([u.ravel(), v.ravel(), np.ones(u.size)])
        seen = to_pixels @ flat
        px = seen[:2] / seen[2]
        light = map_coordinates(grey, px[::-1], np.float64, order=1, mode="constant", cval=np.nan)
        out[k] = square * _end(np.asarray(light, np.float64).reshape(u.shape), white)
    return out


def _white_of(grey: Image, view: BoardView) -> float:
    """Brightness of the board's white squares."""
    low = np.maximum(np.floor(view.corners.min(axis=0)).astype(int), 0)
    high = np.ceil(view.corners.max(axis=0)).astype(int) + 1
    return float(np.percentile(grey[low[1] : high[1], low[0] : high[0]], 75))


def _end(light: Floats, white: float) -> float:
    """Squares to where the white ends, from the brightness (lines, distances) beside a side."""
    from scipy.ndimage import grey_opening

    inside = np.isfinite(light).mean(axis=0) >= _SEEN
    count = int(np.argmin(inside)) if not inside.all() else len(inside)
    if count < 2 * _WINDOW + 1:
        return USUAL
    level = np.nanmedian(light[:, :count], axis=0)
    if level[0] < _WHITE * white:
        return 0.0
    # A stripe along the side is bright and thin, and ends nothing.
    level = np.asarray(grey_opening(level, size=(_THIN,), mode="nearest"), np.float64)
    means = np.convolve(level, np.full(_WINDOW, 1 / _WINDOW), mode="valid")
    found = np.flatnonzero(np.abs(means[_WINDOW:] - means[:-_WINDOW]) > _STEP * white)
    if len(found):
        return float(_FIRST + _EVERY * (found[0] + _WINDOW))
    return float(_FIRST + _EVERY * count) if count < len(inside) else USUAL
