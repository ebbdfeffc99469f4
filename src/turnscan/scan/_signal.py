"""The light that the laser adds to a picture, and how much of it is noise."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Image

Pixels = npt.NDArray[Any]

NOISE_FACTOR = 4.0
"""Automatic threshold of what is kept = this × the noise: well below what detectors go by, and
one pixel in 30 000 is above it by chance."""
LEAST_THRESHOLD = 3.0
"""Grey levels; the automatic threshold is not below."""
SAMPLES = 20_000
"""Pixels, about, that are enough for a median."""


_IN_CACHE = 1 << 17
"""Bytes of a picture that are compared at a time."""


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


def above(
    lit: Image, dark: Image | None, weights: tuple[float, ...] | None, threshold: float
) -> Bools:
    """(H, W) True where `signal_of` the pictures is above the threshold.

    Grey pictures are compared some lines at a time, which stay in the processor's cache.
    """
    if lit.dtype.kind != "u" or weights is not None or (dark is not None and threshold < 0.0):
        return np.asarray(signal_of(lit, dark, weights) > threshold)
    least = math.floor(threshold)
    if dark is None:
        return np.asarray(lit > least)
    out = np.empty(lit.shape, np.bool_)
    added = np.empty((max(1, _IN_CACHE // lit[:1].nbytes), *lit.shape[1:]), lit.dtype)
    for k in range(0, len(lit), len(added)):
        some = added[: len(lit) - k]
        off = dark[k : k + len(some)]
        np.maximum(lit[k : k + len(some)], off, out=some)
        some -= off
        np.greater(some, least, out=out[k : k + len(some)])
    return out


def sample(picture: Pixels) -> Pixels:
    """(k, 1, C): some `SAMPLES` pixels of a picture, evenly spread; of a sample all."""
    planes = picture.reshape(picture.shape[0] * picture.shape[1], 1, -1)
    return np.asarray(planes[:: _stride(len(planes))])


def sampled_signal(lit: Image, dark: Image | None, weights: tuple[float, ...] | None) -> Pixels:
    """(k, 1): `signal_of` the `sample` of pictures, of which `statistics` says the same."""
    off = None if dark is None else sample(dark)
    return signal_of(sample(lit), off, weights).reshape(-1, 1)


def _stride(pixels: int) -> int:
    return max(1, pixels // SAMPLES) | 1  # odd: meets every column and row parity


def statistics(signal: Pixels) -> Statistics:
    """Median and robust standard deviation of a signal, from about 20 000 of its pixels.

    The deviation is the distance from the median down to the 16 % quantile, because the laser only
    adds on the other side. Values are integers more often than not, so quantiles are taken as if
    each were spread evenly over its own grey level: smooth in the true noise, also below one.
    """
    flat = signal.ravel()
    values, counts = np.unique(flat[:: _stride(flat.size)], return_counts=True)
    if len(values) == 1:
        return Statistics(float(values[0]), 0.0)
    edges = np.concatenate(([values[0] - 0.5], (values[1:] + values[:-1]) / 2, [values[-1] + 0.5]))
    share = np.concatenate(([0.0], np.cumsum(counts) / counts.sum()))
    low, middle = np.interp((0.158655, 0.5), share, edges)
    return Statistics(float(middle), float(middle - low))
