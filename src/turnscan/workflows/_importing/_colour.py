"""The colour of a laser, as people write it."""

from __future__ import annotations

import math

from turnscan.arrays import ColourWeights
from turnscan.errors import InputError
from turnscan.remedy import Option

LEARN = "learn"
"""In place of a colour: the pictures say it."""


def colour_weights(colour: str) -> ColourWeights:
    """Weights of red, green and blue: of a name, or three numbers like ``1,-0.5,-0.5``.

    Raises InputError for what is neither.
    """
    from turnscan.stripes import COLOURS

    if colour in COLOURS:
        return COLOURS[colour]
    try:
        red, green, blue = (float(c) for c in colour.split(","))
    except ValueError:
        red = green = blue = math.nan
    if not all(math.isfinite(w) for w in (red, green, blue)) or max(red, green, blue) <= 0.0:
        raise InputError(
            "neither a colour nor three weights",
            hint=f"give {LEARN}, {', '.join(COLOURS)}, or weights like 1,-0.5,-0.5",
            option=Option("colour", colour),
        )
    return red, green, blue
