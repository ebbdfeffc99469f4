"""What speckle and its kernels share: types, and the amplitude of the Airy disc."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats

Singles = npt.NDArray[np.float32]
Keys = npt.NDArray[np.uint32]
Numbers = tuple[float, ...]
Grain = tuple[float, float]
Window = tuple[int, int, int, int]
"""Rows r0 to r1 and columns c0 to c1 of pixels that one transform serves, without the apron."""


def jinc(r: Floats) -> Floats:
    """Amplitude response of the circular pupil at distance r in units of λN', 1 at the centre."""
    from scipy.special import j1

    x = np.pi * np.asarray(r, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(x == 0.0, 1.0, 2.0 * j1(x) / x)
