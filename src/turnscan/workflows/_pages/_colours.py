"""Colours that mean something in pictures, reports and files, distinct for the colour-blind."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from turnscan.arrays import Floats
from turnscan.drawings import Colour
from turnscan.surface.holes import Cause

GREY: Colour = (190, 190, 190)
"""Grey: not measured, or no shape."""
DISTINCT: tuple[Colour, ...] = (
    (86, 180, 233), (230, 159, 0), (0, 158, 115), (240, 228, 66), (0, 114, 178), (213, 94, 0),
    (204, 121, 167), (148, 103, 189), (140, 86, 75), (23, 190, 207),
)  # fmt: skip
"""Of things by number: neighbours differ (Okabe & Ito, then others)."""
CAUSE_COLOURS: Final[dict[Cause, Colour]] = {
    "laser": (213, 94, 0),
    "camera": (204, 121, 167),
    "grazing": (86, 180, 233),
    "dark": (30, 30, 30),
    "saturated": (255, 255, 255),
    "outside": (148, 103, 189),
    "ambiguous": (140, 86, 75),
    "removed": (0, 158, 115),
    "unknown": GREY,
    "deleted": (255, 105, 180),
}
"""Of holes and gaps by their causes; none is on the map of sigma."""
DEVIATION = "RdYlBu_r"
"""Matplotlib's map of deviations, from inside (blue) to outside (red)."""
DEVIATION_STEPS: tuple[tuple[str, Colour], ...] = (
    ("dark blue", (69, 117, 180)), ("blue", (145, 191, 219)), ("pale blue", (224, 243, 248)),
    ("yellow", (255, 255, 191)),
    ("pale orange", (254, 224, 144)), ("orange", (252, 141, 89)), ("red", (215, 48, 39)),
)  # fmt: skip
"""The same in seven colours with names (ColorBrewer RdYlBu), where a file holds few."""


def deviation_shades(distance: Floats, top: float) -> Any:
    """(n, 3) uint8 colours of distances (n,) mm on a scale from -``top`` to ``top``; grey where
    one is NaN."""
    import matplotlib as mpl

    known = np.isfinite(distance)
    share = np.clip(np.where(known, distance, 0.0) / top, -1, 1) * 0.5 + 0.5
    shade = np.round(mpl.colormaps[DEVIATION](share)[:, :3] * 255)
    return np.where(known[:, None], shade, GREY).astype(np.uint8)
