"""Runs: a picture of which only the pixels near the stripe are kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Image

Numbers = npt.NDArray[np.int64]
Values = npt.NDArray[Any]


@dataclass(frozen=True, eq=False)
class Runs:
    """A picture, and the one without the laser, of which only runs of pixels are kept.

    Lines are image rows for a vertical stripe and image columns for a horizontal one. Nothing is
    checked here: `turnscan.stripes.RunDetector` refuses what it cannot lay out.
    """

    counts: Numbers
    """(lines,) runs of each line."""
    starts: Numbers
    """(runs,) first pixel of each, ascending in a line."""
    lengths: Numbers
    """(runs,) pixels of each."""
    lit: Values
    """(n,) uint8 or uint16: the pixels of all runs, one after the other."""
    dark: Values | None
    """(n,) the same without the laser; None where there is no such picture, or ``background``."""
    ground: int
    """Level of ``lit`` where nothing is kept; where there is a ``background``, above that."""
    dark_ground: int
    """Level of ``dark`` where nothing is kept."""
    background: Image | None
    """(lines, columns) the picture without the laser, or None."""
