"""Light: what the laser brought to one picture, without the background."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Image

_PIXEL = 1.0 / 24.0
"""Half the variance of a pixel's own width, px²: what its mean over itself takes from the light."""


@dataclass(frozen=True, eq=False)
class Light:
    """The laser's light in one picture, laid so that the stripe's lines are rows."""

    lit: Image
    """(lines, columns)."""
    dark: Image
    """The same without the laser, or one row of zeros."""
    base: float
    """Grey levels of the background in ``lit - dark``."""
    noise: float
    """Grey levels: rms of one pixel without light."""
    per_level: float
    """Shot noise: variance per grey level, 0 when unknown."""

    def piece(self, corner: tuple[int, int], shape: tuple[int, int]) -> npt.NDArray[np.float32]:
        """A piece (``shape``) from line and column ``corner`` on, dark outside of the picture.

        It is as sharp across the stripe as if pixels did not average over their own width.
        """
        lines, columns = self.lit.shape
        out = np.zeros(shape, np.float32)
        top, left = max(corner[0], 0), max(corner[1], 0)
        bottom, right = min(corner[0] + shape[0], lines), min(corner[1] + shape[1], columns)
        if top >= bottom or left >= right:
            return out
        part = self.lit[top:bottom, left:right].astype(np.float32)
        part -= (
            self.dark[top:bottom, left:right] if len(self.dark) > 1 else self.dark[:, left:right]
        )
        part -= np.float32(self.base)
        sharp = part.copy()
        sharp[:, 1:-1] += _PIXEL * (2 * part[:, 1:-1] - part[:, 2:] - part[:, :-2])
        y, x = top - corner[0], left - corner[1]
        out[y : y + bottom - top, x : x + right - left] = sharp
        return out
