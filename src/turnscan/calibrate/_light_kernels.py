"""Compiled kernel: a running median. It imports numba; import it inside functions."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.compiled import njit

Words = npt.NDArray[np.uint16]


@njit(cache=True, nogil=True)
def running_median(lines: Words, window: int) -> Words:
    """Median of ``window`` (odd) neighbours along the last axis of (n, m); the ends are repeated.

    The window is kept sorted: one value leaves and one enters at every place.
    """
    n, m = lines.shape
    half = window // 2
    out = np.empty_like(lines)
    held = np.empty(window, np.uint16)
    for i in range(n):
        for k in range(window):
            value = lines[i, min(max(k - half, 0), m - 1)]
            at = k
            while at > 0 and held[at - 1] > value:
                held[at] = held[at - 1]
                at -= 1
            held[at] = value
        out[i, 0] = held[half]
        for j in range(1, m):
            gone = lines[i, max(j - 1 - half, 0)]
            value = lines[i, min(j + half, m - 1)]
            if gone != value:
                at = 0
                while held[at] != gone:
                    at += 1
                while at < window - 1 and held[at + 1] < value:
                    held[at] = held[at + 1]
                    at += 1
                while at > 0 and held[at - 1] > value:
                    held[at] = held[at - 1]
                    at -= 1
                held[at] = value
            out[i, j] = held[half]
    return out
