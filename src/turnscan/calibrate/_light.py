"""Where laser light may be in a picture of a board or of the table, lit by the room or not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Image, Ints
from turnscan.errors import InputError
from turnscan.stripes import (
    UINT16_SCALE,
    Orientation,
    StripeSettings,
    find_candidates,
    project_colour,
)

_CLIPPED = 252 / 255
"""Of the brightest pixel: such pixels may be clipped, and say nothing of a profile."""
_WINDOW = 17  # px: the stripe is narrower than half of this, squares and hands are wider


class StripeLight(NamedTuple):
    """Where the stripe could be in a picture."""

    places: Floats
    """(n, 2) px."""
    widths: Floats
    """(n,) px rms of the light there."""
    on_print: Floats | None
    """(n, 2) px: the places of the light that fell on the print which the laser-off picture shows
    (`stripes_on_print`), None without one. Half on white and half on black, a stripe is seen on the
    white."""
    widths_on_print: Floats | None
    """(n,) px rms of that light."""


def stripe_light(
    lit: Image,
    dark: Image | None = None,
    weights: npt.ArrayLike | None = None,
    orientation: Orientation = "vertical",
    most: int = 5,
) -> StripeLight:
    """Where in a picture the stripe could be; the ``most`` brightest places in a line.

    ``lit`` and ``dark`` are (H, W) or (H, W, 3). Without a laser-off picture the background is the
    median of the neighbourhood along the line, which a narrow stripe does not move: a stripe on a
    board in a bright room stands out from that, and so do other thin bright things, which the
    choice by the board's plane leaves out afterwards. ``weights`` (3,) mix the colours (default:
    equal parts).

    Raises InputError where the two pictures differ in shape.
    """
    if dark is not None and dark.shape != lit.shape:
        raise InputError(
            f"the picture with the laser is {lit.shape}, the one without is {dark.shape}",
            hint="give one laser-off picture of the same camera for every laser picture",
        )
    signal = _mixed(lit, weights)
    background = _along_lines(signal, orientation) if dark is None else _mixed(dark, weights)
    settings = StripeSettings(orientation=orientation, max_candidates=most)
    found = find_candidates(signal, background, settings)
    line, which = np.nonzero(np.isfinite(found.position))
    across = found.position[line, which]
    widths = np.array(found.width[line, which], dtype=np.float64)

    def pixels(across: Floats) -> Floats:
        pair = (across, line) if orientation == "vertical" else (line, across)
        return np.stack(pair, axis=1).astype(np.float64)

    if dark is None:
        return StripeLight(pixels(across), widths, None, None)
    fell, wide = _on_print(signal, background, line.astype(np.int32), across, widths, orientation)
    return StripeLight(pixels(across), widths, pixels(fell), wide)


def _on_print(
    lit: npt.NDArray[np.uint16],
    dark: npt.NDArray[np.uint16],
    line: Ints,
    across: Floats,
    width: Floats,
    orientation: Orientation,
) -> Floats:
    """Places (2, n) px across of stripes whose light fell on what ``dark`` (H, W) shows, and their
    widths, px rms."""
    from turnscan.calibrate._light_kernels import stripes_on_print

    if orientation == "horizontal":
        lit, dark = lit.T, dark.T
    full = float(max(lit.max(), 1))
    found: Floats = stripes_on_print(
        np.ascontiguousarray(lit), np.ascontiguousarray(dark), line,
        np.asarray(across, dtype=np.float64), np.asarray(width, dtype=np.float64),
        full / 255.0, _CLIPPED * full,
    )  # fmt: skip
    return found


def _along_lines(
    signal: npt.NDArray[np.uint16], orientation: Orientation = "vertical"
) -> npt.NDArray[np.uint16]:
    """Median of 17 neighbours across the stripe, (H, W)."""
    from turnscan.calibrate._light_kernels import running_median

    across = orientation == "horizontal"
    lines = np.ascontiguousarray(signal.T if across else signal)
    smooth: npt.NDArray[np.uint16] = running_median(lines, _WINDOW)
    return smooth.T if across else smooth


def measuring_direction(orientation: Orientation) -> Floats:
    """Unit vector (2,) along which a centre was located: along u for one centre per row."""
    return np.array([1.0, 0.0] if orientation == "vertical" else [0.0, 1.0])


def _mixed(image: Image, weights: npt.ArrayLike | None) -> npt.NDArray[np.uint16]:
    """Grey picture (H, W), 16 bits with a few bits of headroom kept for the mix."""
    if image.ndim == 3:
        grey = project_colour(image, "grey" if weights is None else weights, np.uint16)
    else:
        grey = image.astype(np.uint16) * (1 if image.dtype == np.uint16 else UINT16_SCALE)
    return grey.astype(np.uint16, copy=False)


def laser_weights(lit: Image, dark: Image | None, view_corners: Floats) -> Floats | None:
    """Excess light (3,) of the stripe in red, green, blue, around a board; None in grey pictures.

    In every row of the board's surroundings the brightest thin thing is taken. The stripe is there
    in every row at nearly the same excess; noise adds the same to all three channels.
    """
    if lit.ndim == 2 or not len(view_corners):
        return None
    low = np.maximum(view_corners.min(axis=0).astype(int) - 80, 0)
    high = view_corners.max(axis=0).astype(int) + 80
    part = lit[low[1] : high[1], low[0] : high[0]].astype(np.float32)
    if dark is None:
        each = [_along_lines(part[..., k].astype(np.uint16)) for k in range(3)]
        ground = np.stack(each, axis=-1).astype(np.float32)
    else:
        ground = dark[low[1] : high[1], low[0] : high[0]].astype(np.float32)
    excess = np.clip(part - ground, 0, None)
    best = excess.sum(axis=2).argmax(axis=1)
    rows = np.arange(len(best))
    return np.asarray(np.median(excess[rows, best], axis=0), dtype=np.float64)
