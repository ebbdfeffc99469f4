"""The kernel of exposure fusion. This module imports numba; import it inside functions."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Singles
from turnscan.compiled import njit


@njit(cache=True, nogil=True)
def fuse(
    stack: npt.NDArray[np.generic],
    times: Floats,
    black: float,
    clip: float,
    dark_variance: float,
    shot: float,
    level: Singles,
    sigma: Singles,
) -> None:
    """(n, pixels) grey levels at n rising times → level and sigma at the first time.

    Variance of a level is ``dark_variance`` + ``shot`` × signal. Sigma is NaN where even the
    first clips.
    """
    count = len(times)
    for p in range(stack.shape[1]):
        if stack[0, p] >= clip:
            level[p], sigma[p] = clip, np.nan
            continue
        # Sum over sum is the best guess for shot noise, and without bias.
        signal = duration = 0.0
        for k in range(count):
            if stack[k, p] < clip:
                signal += stack[k, p] - black
                duration += times[k]
        light = signal / duration
        total = mean = 0.0
        for k in range(count):
            if stack[k, p] < clip:
                variance = dark_variance + shot * max(light * times[k], 0.0)
                weight = times[k] ** 2 / variance
                total += weight
                mean += weight * (stack[k, p] - black) / times[k]
        level[p] = black + mean / total * times[0]
        sigma[p] = times[0] / math.sqrt(total)
