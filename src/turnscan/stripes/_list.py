"""Kernels of the list of candidates: what may be a stripe, and which of them belong together."""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import numpy as np

from turnscan.arrays import Floats, Longs, Region
from turnscan.compiled import njit
from turnscan.stripes._scan import (
    FWHM,
    HIGH,
    LEFT,
    LOW,
    RIGHT,
    SEED,
    TOP,
    Terms,
    merge_peaks,
    move_peak,
)
from turnscan.stripes._strategies import WINDOW

SPARE = 4.0
"""Pixels beside the seed that a measurement may look at, in rms widths, and …"""
MARGIN = 6
"""… px more, for the flanks."""
KIN_DISTANCE, KIN_WIDTH = 4.0, 8.0
"""Candidates of adjacent lines belong together within this many widths and this ratio of widths."""

# Columns of the list of candidates.
(
    ROW, START, PLACE, HEIGHT, HALF, MIDDLE, CENTRE, FLUX, SECOND, INSIDE, PEDESTAL, GAIN, REACH,
    WIDTH, NEAR, FAR,
) = range(16)  # fmt: skip
COLUMNS = 16


@njit(cache=True, nogil=True, error_model="numpy")
def keep_brightest(peaks: Floats, line: int, count: int, wanted: int) -> int:
    """Keep the ``wanted`` highest peaks of a line, in order of position."""
    while count > wanted:
        lowest = line
        for j in range(line + 1, line + count):
            if peaks[j, TOP] < peaks[lowest, TOP]:
                lowest = j
        for j in range(lowest, line + count - 1):
            move_peak(peaks, j + 1, j)
        count -= 1
    return count


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def reach_of(
    peaks: Floats, line: int, count: int, j: int, half: float, whole: bool, u0: int, u1: int
) -> tuple[int, int]:
    """First and last pixel that the measurement of peak j may look at.

    ``whole`` takes in the run above the threshold; the valleys towards neighbours are the limit.
    """
    margin = int(SPARE * half) + MARGIN
    left = int(peaks[j, SEED]) - margin
    right = int(peaks[j, SEED]) + margin
    if whole:
        left = min(left, int(peaks[j, LEFT]))
        right = max(right, int(peaks[j, RIGHT]))
    if j > line:
        before = int(peaks[j - 1, RIGHT])
        left = max(left, before + (before < peaks[j, LEFT]))
    if j < line + count - 1:
        after = int(peaks[j + 1, LEFT])
        right = min(right, after - (after > peaks[j, RIGHT]))
    return max(left, u0), min(right, u1 - 1)


@njit(cache=True, nogil=True, error_model="numpy")
def list_candidates(
    roi: Region,
    terms: Terms,
    peaks: Floats,
    counts: Longs,
    usual: float,
    wanted: int,
    some: Floats,
    stops: Longs,
) -> tuple[int, int]:
    """Fill the list ``some`` (n, COLUMNS) and, per candidate, where its pixels end in the pool."""
    u0, v0, u1, _ = roi
    n = 0
    total = 0
    line = 0
    whole = terms.strategy != WINDOW
    for i in range(counts.size):
        if counts[i] == 0:
            continue
        count = counts[i]
        if count > 1:
            count = merge_peaks(peaks, line, count, usual)
            count = keep_brightest(peaks, line, count, wanted)
        for j in range(line, line + count):
            half = max(0.45, (peaks[j, HIGH] - peaks[j, LOW]) * (1.0 / FWHM))
            left, right = reach_of(peaks, line, count, j, half, whole, u0, u1)
            total += right - left + 2
            stops[n] = total
            some[n, ROW] = v0 + i
            some[n, START] = left
            some[n, PLACE] = peaks[j, SEED]
            some[n, HEIGHT] = peaks[j, TOP]
            some[n, HALF] = half
            some[n, MIDDLE] = 0.5 * (peaks[j, LOW] + peaks[j, HIGH])
            some[n, CENTRE] = some[n, MIDDLE] - left
            some[n, FLUX] = peaks[j, TOP] * half
            some[n, SECOND] = half * half
            n += 1
        line += counts[i]
    return n, total


@njit(cache=True, nogil=True, error_model="numpy")
def find_kin(some: Floats, n: int, up: Longs, down: Longs) -> None:
    """For every candidate, the one of the line before and after that it belongs to, or -1."""
    up[:n] = -1
    down[:n] = -1
    start = 0
    for i in range(n):
        row = some[i, ROW]
        while some[start, ROW] < row - 1:
            start += 1
        best = np.inf
        j = start
        while some[j, ROW] < row:
            a, b = some[i, HALF], some[j, HALF]
            distance = abs(some[i, PLACE] - some[j, PLACE])
            if (
                distance < min(best, KIN_DISTANCE * max(a, b) + 2.0)
                and a < KIN_WIDTH * b
                and b < KIN_WIDTH * a
            ):
                best = distance
                up[i] = j
            j += 1
        if up[i] >= 0:
            down[up[i]] = i
