"""Stripes that are cut off at the top: how many pixels are full, and what that leaves unknown."""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import math

import numpy as np

from turnscan.arrays import Floats, Image, Longs, Region
from turnscan.compiled import njit
from turnscan.stripes._list import CENTRE, FLUX, HEIGHT, REACH, ROW, SECOND, START, WIDTH

CLIPPED_PHASE = 0.11
"""Error from the phase of the pixels on a clipped stripe, px·px² (÷ width²)."""
STEEP_PHASE, STEEP_FROM = 0.0185, 0.8
"""… and px for each 1/px of log slope beyond this, in the flanks of a stripe clipped far down:
fitted to Gaussians cut off 2 to 6 of their widths out (``python -m bench flags``)."""
UPPER, LOWER = 0.5, 0.05
"""Parts of what is full between which the fall of a flank is measured: the upper one lies below the
pixel in which it begins to be clipped."""
FARTHEST = 64
"""px over which a flank may fall so far; a longer one is light that spread beside the stripe."""
CUT_SHIFT, CUT_FLANKS = 0.4, 3.0
"""A stripe of which c pixels are full, the flanks beside are as much light as F full pixels, and
these flanks differ by a share q, is moved by q·CUT_SHIFT·c² / (c + CUT_FLANKS·F) px when it is
clipped: for two halves of Gaussians of widths 1 : 1.2 to 1 : 2 and c of 4 to 14 px, to a tenth."""
FALL_PHASE, LARGEST_PHASE = 0.5, 0.2
"""Scatter of q from the phase of the pixels, where the falls of both flanks together take one
pixel, and what it is at most; it goes with the inverse cube of that (Gaussians of 1 to 5 px)."""
USUAL_SHARE = 0.2
"""q of stripes before anything is known of them, rms; half as much again makes one flank twice
as wide as the other."""
NEIGHBOURS = 15
"""Lines on either side whose flanks are taken together."""


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def clipped(
    lit: Image, v: int, first: float, last: float, u0: int, u1: int, level: float
) -> tuple[int, int, int]:
    """How many pixels between first and last are saturated, and the first and the last of them."""
    count, low, high = 0, -1, -1
    for x in range(max(u0, int(first)), min(u1 - 1, int(last)) + 1):
        if lit[v, x] >= level:
            low = low if count else x
            high = x
            count += 1
    return count, low, high


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def clipped_phase(some: Floats, i: int, count: int) -> float:
    """Variance, px², that the phase of the pixels gives the centre of a stripe with so many full.

    Flanks that fall within a pixel place the centre no better than the pixels lie; how far they
    reach is told by the light beside what is full.
    """
    flank = (some[i, FLUX] / max(some[i, HEIGHT], 1.0) - count) / 2.0
    steep = max(1.0 / max(flank, 0.1) - STEEP_FROM, 0.0)
    wide = CLIPPED_PHASE / max(some[i, SECOND], 0.25)
    return wide * wide + (STEEP_PHASE * steep) ** 2


@njit(cache=True, nogil=True, error_model="numpy")
def fall(line: Floats, start: int, step: int, level: float) -> float:
    """px over which light falls from `UPPER` to `LOWER` of ``level``, from ``start`` outwards.

    NaN where it does not. Between pixels its logarithm is taken to be straight.
    """
    upper = math.nan
    x, far = start, 0
    while far < FARTHEST and 0 <= x + step < len(line):
        here, there = max(line[x], 1e-3 * level), max(line[x + step], 1e-3 * level)
        for share in (UPPER, LOWER):
            if there < share * level <= here:
                at = far + math.log(here / (share * level)) / math.log(here / there)
                if share == LOWER:
                    return at - upper
                upper = at
        x += step
        far += 1
    return math.nan


@njit(cache=True, nogil=True, error_model="numpy")
def cut_share(line: Floats, full: Floats, level: float, flank: float) -> tuple[float, float, float]:
    """q of the flanks of a clipped stripe, its variance from the phase of the pixels, and the px by
    which being clipped moves the centre for each 1 of q.

    ``line`` is the light of a line of the picture, ``full`` (2,) the first and last pixel that is
    saturated, ``level`` the light of one, ``flank`` what is beside them in full pixels. q is NaN
    where a flank does not fall: nothing is known of it.
    """
    left, right = fall(line, int(full[0]), -1, level), fall(line, int(full[1]), 1, level)
    both = left + right
    count = full[1] - full[0] + 1.0
    unit = CUT_SHIFT * count * count / (count + CUT_FLANKS * max(flank, 0.0))
    if math.isnan(both) or both <= 0.0:
        return math.nan, 0.0, unit
    return (right - left) / both, min(FALL_PHASE / both**3, LARGEST_PHASE) ** 2, unit


@njit(cache=True, nogil=True, error_model="numpy")
def lopsided(
    some: Floats, n: int, lit: Image, dark: Image, base: float, roi: Region, saturation: float
) -> tuple[Longs, Floats]:
    """(n,) saturated pixels of each candidate, and (n,) px² by which clipping may have moved its
    centre, squared: of one that is clipped the light that is lost was not in its middle.

    Flanks of lines nearby are taken together: speckle and the phase of the pixels differ from line
    to line. What they leave open counts, too.
    """
    u0, _, u1, _ = roi
    count, out = np.zeros(n, np.int64), np.zeros(n)
    share, phase, unit, middle = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    line, full = np.zeros(lit.shape[1]), np.zeros(2)
    paired = dark.shape[0] > 1
    for i in range(n):
        v = int(some[i, ROW])
        middle[i] = some[i, CENTRE] + some[i, START]
        first, last = middle[i] - some[i, REACH], middle[i] + some[i, REACH]
        count[i], low, high = clipped(lit, v, first, last, u0, u1, saturation)
        if not count[i]:
            continue
        w = v if paired else 0
        a, b = max(u0, low - FARTHEST), min(u1, high + FARTHEST + 1)
        for x in range(a, b):
            line[x] = np.float64(np.int64(lit[v, x]) - np.int64(dark[w, x])) - base
        level = saturation - dark[w, low] - base
        flank = some[i, FLUX] / max(some[i, HEIGHT], 1.0) - count[i]
        full[0], full[1] = low - a, high - a
        share[i], phase[i], unit[i] = cut_share(line[a:b], full, level, flank)
    for i in range(n):
        if count[i]:
            out[i] = unit[i] ** 2 * _square(some, i, n, count, middle, share, phase)
    return count, out


@njit(cache=True, nogil=True, error_model="numpy")
def _square(
    some: Floats, i: int, n: int, count: Longs, middle: Floats, share: Floats, phase: Floats
) -> float:
    """Expected square of q at i, from the clipped stripes about it that tell it, and from what is
    usual.

    Lines between which the stripe moves by less than a pixel have much of its phase in common.
    """
    total, squares, chance, many = 0.0, 0.0, 0.0, 0
    low, high = middle[i], middle[i]
    for way in (-1, 1):
        j = i if way < 0 else i + 1
        while 0 <= j < n:
            rows = abs(some[j, ROW] - some[i, ROW])
            if rows > NEIGHBOURS:
                break
            near = abs(middle[j] - middle[i]) <= rows + some[i, WIDTH]
            if count[j] and near and not math.isnan(share[j]):
                total += share[j]
                squares += share[j] * share[j]
                chance += phase[j]
                many += 1
                low, high = min(low, middle[j]), max(high, middle[j])
            j += way
    if not many:
        return USUAL_SHARE**2
    mean = total / many
    error = max(1.0 - (high - low), 1.0 / many) * chance / many
    error += max(squares / many - mean * mean, 0.0) / max(many - 1, 1)
    believed = USUAL_SHARE**2 / (USUAL_SHARE**2 + error)
    return believed * (believed * mean * mean + error)
