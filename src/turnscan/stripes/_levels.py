"""Kernels of what a picture says of its own grey levels: background, noise, saturation, medians."""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Image, Region
from turnscan.compiled import njit

TYPICAL = 200
"""Values that are enough for a median."""


@njit(cache=True, nogil=True, error_model="numpy")
def background(lit: Image, dark: Image, roi: Region) -> tuple[float, float]:
    """Median and robust noise of ``lit - dark`` from some five thousand pixels.

    The noise is the distance from the median down to the 16 % quantile: light only ever adds on
    the other side.
    """
    u0, v0, u1, v1 = roi
    step_v = max(1, (v1 - v0) // 64)
    step_u = max(1, (u1 - u0) // 80)
    paired = dark.shape[0] > 1
    seen = np.empty((1 + (v1 - v0) // step_v) * (1 + (u1 - u0) // step_u), np.int32)
    n = 0
    for v in range(v0, v1, step_v):
        a = lit[v]
        b = dark[v if paired else 0]
        for u in range(u0 + (7 * v) % step_u, u1, step_u):
            seen[n] = np.int32(a[u]) - np.int32(b[u])
            n += 1
    seen = seen[:n]
    low = seen.min()
    counts = np.zeros(seen.max() - low + 1, np.int32)
    for d in seen:
        counts[d - low] += 1
    below = 0
    quantile = low - 0.5
    wanted = 0.1587 * n
    for i in range(counts.size):
        d = low + i
        here = counts[i]
        if here > 0 and below + here >= wanted:
            level = d - 0.5 + (wanted - below) / here
            if wanted == 0.5 * n:
                return level, level - quantile
            quantile = level
            wanted = 0.5 * n
            if below + here >= wanted:
                level = d - 0.5 + (wanted - below) / here
                return level, level - quantile
        below += here
    return float(low), 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def typical(values: Floats, n: int) -> float:
    """Median of some hundred of the first n values, evenly spread; 0 of none."""
    if n == 0:
        return 0.0
    step = 1 + n // TYPICAL
    some = np.empty(1 + (n - 1) // step)
    for i in range(some.size):
        some[i] = values[i * step]
    return np.median(some)


@njit(cache=True, nogil=True, error_model="numpy")
def learned_saturation(lit: Image, brightest: float, plateau: bool) -> float:
    """8 bits: 250 (JPEG rings around 255). 16: 98 % of the 10, 12, 14 or 16 bits in use.

    How many bits those are only a ``plateau`` at the very top of them tells: a peak may end there
    by itself.
    """
    if np.iinfo(lit.dtype).max == 255:
        return 250.0
    for bits in (10, 12, 14):
        top = 0.98 * (2.0**bits - 1.0)
        if plateau and top <= brightest < 2.0**bits:
            return top
    return 0.98 * 65535.0
