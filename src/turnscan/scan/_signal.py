"""The light that the laser adds to a picture, and how much of it is noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Image

Pixels = npt.NDArray[Any]

NOISE_FACTOR = 4.0
"""Automatic threshold of what is kept = this × the noise: well below what detectors go by, and
one pixel in 30 000 is above it by chance."""
LEAST_THRESHOLD = 3.0
"""Grey levels; the automatic threshold is not below."""
SAMPLES = 20_000
"""Pixels, about, that are enough for a median."""


@dataclass(frozen=True)
class Statistics:
    """Of the signal over a whole picture, in grey levels."""

    level: float
    noise: float


def signal_of(lit: Image, dark: Image | None, weights: tuple[float, ...] | None) -> Pixels:
    """Light that the laser adds, (H, W), signed: int16, int32 or, for colour, float32."""
    wide = np.int16 if lit.dtype == np.uint8 else np.int32
    raw: Pixels = lit.astype(wide) if dark is None else np.subtract(lit, dark, dtype=wide)
    if weights is None:
        return raw
    return sum(
        (np.float32(w) * raw[..., c] for c, w in enumerate(weights) if w != 0.0),
        start=np.zeros(raw.shape[:2], np.float32),
    )


def statistics(signal: Pixels) -> Statistics:
    """Median and robust standard deviation of a signal, from about 20 000 of its pixels.

    The deviation is the distance from the median down to the 16 % quantile, because the laser only
    adds on the other side. Values are integers more often than not, so quantiles are taken as if
    each were spread evenly over its own grey level: smooth in the true noise, also below one.
    """
    flat = signal.ravel()
    stride = max(1, flat.size // SAMPLES) | 1  # odd: meets every column and row parity
    values, counts = np.unique(flat[::stride], return_counts=True)
    if len(values) == 1:
        return Statistics(float(values[0]), 0.0)
    edges = np.concatenate(([values[0] - 0.5], (values[1:] + values[:-1]) / 2, [values[-1] + 0.5]))
    share = np.concatenate(([0.0], np.cumsum(counts) / counts.sum()))
    low, middle = np.interp((0.158655, 0.5), share, edges)
    return Statistics(float(middle), float(middle - low))
