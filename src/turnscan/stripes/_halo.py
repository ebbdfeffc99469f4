"""Kernels of light that spread beside a stripe, in the material or on its surface."""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import math

import numpy as np

from turnscan.arrays import Bools, Floats, Longs
from turnscan.compiled import njit
from turnscan.stripes._list import (
    CENTRE,
    FAR,
    FLUX,
    HEIGHT,
    MIDDLE,
    NEAR,
    PEDESTAL,
    REACH,
    ROW,
    START,
    WIDTH,
)
from turnscan.stripes._measure import BESIDE, FLANK, mean_light
from turnscan.stripes._scan import Terms

PEDESTAL_LIMIT = 0.1
"""Light beside the stripe above this part of its amplitude is a halo …"""
LEAN_LIMIT = 0.3
"""… and so is a centre this many widths away from the middle of the half-height."""
GLOW_REACH, GLOW_SHARE = 60, 0.2
"""Lines on either side, and the share of their stripes that glow from which all are said to."""
HALO_LIMIT = 0.02
"""Tails of a stripe with less than this part of its light's amplitude are clean:
under a window of five widths such a pedestal holds 4 % of the light, and all on one side it would
move the centre by a fiftieth of a width (`HALO_BIAS`)."""
TAIL = 3
"""px of a tail, beginning beside the window's end, and of the next piece of it."""
TAIL_POWER, TAIL_FALL, TAIL_RISE = 1.73, 0.15, 2.0
"""A tail of D amplitudes more on one side than on the other, of which a share r is left in its next
piece, moves the centre by D r^-1.73 widths: a law that holds within a third for exponential halos
of 2 to 60 px beside stripes of 1.2 to 3 px, of one side and of two (docs/explain/stripes.md). What
falls off faster than to this share is cut off by the window, and not known; the difference of two
that fall off at different rates may rise. They cancel inside the window: with twice the power."""
APART, JUMP = 2, 1.0
"""Lines between the centres whose second differences show how they scatter, as neighbours may
share a grain; and what counts as a jump of the surface, in widths."""
HALO_REACH = 15
"""Lines on either side over which a halo is the same and speckle is not: the mean of some thirty
grains of a pixel varies by a sixth of itself."""


@njit(cache=True, nogil=True, error_model="numpy")
def glows(some: Floats, i: int, terms: Terms) -> bool:
    """Whether light spread beside a stripe."""
    pedestal = some[i, PEDESTAL]
    amplitude = max(some[i, HEIGHT] - pedestal, 1.0)
    return pedestal > PEDESTAL_LIMIT * amplitude and pedestal > 4.0 * terms.noise


@njit(cache=True, nogil=True, error_model="numpy")
def glowing_nearby(some: Floats, n: int, terms: Terms, lines: int) -> Bools:
    """(H,) True for lines about which many stripes glow."""
    many = np.zeros((lines + 1, 2), np.int64)
    for i in range(n):
        v = int(some[i, ROW]) + 1
        many[v, 0] += 1
        many[v, 1] += glows(some, i, terms)
    for v in range(lines):
        for k in range(2):
            many[v + 1, k] += many[v, k]
    near = np.zeros(lines, np.bool_)
    for v in range(lines):
        a, b = max(0, v - GLOW_REACH), min(lines, v + GLOW_REACH + 1)
        near[v] = many[b, 1] - many[a, 1] > GLOW_SHARE * (many[b, 0] - many[a, 0])
    return near


@njit(cache=True, nogil=True, error_model="numpy")
def tails(some: Floats, n: int, pool: Longs, stops: Longs) -> None:
    """How much more light there is after a stripe than before it, near its window and farther off.

    NaN where what belongs to the candidate ends before that.
    """
    start = 0
    for i in range(n):
        last = stops[i] - start - 2
        left = some[i, CENTRE] - some[i, REACH] - BESIDE
        right = some[i, CENTRE] + some[i, REACH] + BESIDE
        some[i, NEAR] = some[i, FAR] = math.nan
        if left - 2 * TAIL >= -0.5 and right + 2 * TAIL <= last + 0.5:
            some[i, NEAR] = mean_light(pool, start, last, right, right + TAIL) - mean_light(
                pool, start, last, left - TAIL, left
            )
            some[i, FAR] = mean_light(
                pool, start, last, right + TAIL, right + 2 * TAIL
            ) - mean_light(pool, start, last, left - 2 * TAIL, left - TAIL)
        start = stops[i]


@njit(cache=True, nogil=True, error_model="numpy")
def haloed(some: Floats, n: int, terms: Terms, lines: int) -> tuple[Floats, Bools, Floats, Floats]:
    """(H,) the highest of each line, True where light has spread beside the stripe there, (2, H)
    how far that surely and likely moves its centre, in its widths, to the right if positive, and
    (H,) how the centres scatter thereabouts, px².

    A grain of speckle in the tail of one line looks like a halo. But grains differ from line to
    line and light that spread in the material does not, so the sums over many lines decide: of the
    pedestal beside the highest candidates, of how far they lean, weighted by their light, and of
    what is in the one tail more than in the other.
    """
    sums = np.zeros((lines + 1, 11))
    highest = np.zeros(lines)
    centres = np.full((lines, 2), math.nan)
    for i in range(n):
        v = int(some[i, ROW])
        if some[i, HEIGHT] > highest[v]:
            highest[v] = some[i, HEIGHT]
            lean = (some[i, CENTRE] + some[i, START] - some[i, MIDDLE]) / some[i, WIDTH]
            sums[v + 1, 0] = some[i, PEDESTAL]
            sums[v + 1, 1] = max(some[i, HEIGHT] - some[i, PEDESTAL], 1.0)
            sums[v + 1, 2] = lean * some[i, FLUX]
            sums[v + 1, 3] = some[i, FLUX]
            sums[v + 1, 4] = 1.0
            near = some[i, NEAR]
            whole = not math.isnan(near)
            sums[v + 1, 5] = near if whole else 0.0
            sums[v + 1, 6] = near * near if whole else 0.0
            sums[v + 1, 7] = some[i, FAR] if whole else 0.0
            sums[v + 1, 8] = 1.0 if whole else 0.0
            centres[v, 0] = some[i, CENTRE] + some[i, START]
            centres[v, 1] = some[i, WIDTH]
    for v in range(APART, lines - APART):
        bend = centres[v - APART, 0] - 2.0 * centres[v, 0] + centres[v + APART, 0]
        if abs(bend) < math.sqrt(6.0) * JUMP * centres[v, 1]:
            sums[v + 1, 9] = bend * bend / 6.0
            sums[v + 1, 10] = 1.0
    for v in range(lines):
        for k in range(11):
            sums[v + 1, k] += sums[v, k]
    out = np.zeros(lines, np.bool_)
    shift = np.zeros((2, lines))
    scatter = np.zeros(lines)
    part = np.empty(11)
    for v in range(lines):
        a, b = max(0, v - HALO_REACH), min(lines, v + HALO_REACH + 1)
        for k in range(11):
            part[k] = sums[b, k] - sums[a, k]
        noise = 4.0 * terms.noise * math.sqrt(part[4] / (2.0 * FLANK))
        out[v] = part[0] > max(HALO_LIMIT * part[1], noise) or abs(part[2]) > LEAN_LIMIT * part[3]
        light = part[1] / max(part[4], 1.0)
        shift[0, v], shift[1, v] = shift_of(part[5], part[6], part[7], part[8], light)
        scatter[v] = part[9] / max(part[10], 1.0)
    return highest, out, shift, scatter


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def shift_of(
    near: float, squares: float, far: float, count: float, amplitude: float
) -> tuple[float, float]:
    """Widths by which a tail surely and likely moves the centre, from sums over ``count`` lines of
    what is in it more than in the other, of its squares, and of what is left farther off.

    What speckle and the camera make of the sum is no tail: three standard errors are taken off what
    is sure.
    """
    if count < 2.0:
        return 0.0, 0.0
    mean = near / count
    error = math.sqrt(max(squares / count - mean * mean, 0.0) / (count - 1.0))
    sure = abs(mean) - 3.0 * error
    if sure <= 0.0:
        return 0.0, 0.0
    left = min(max(far / near, TAIL_FALL), TAIL_RISE)
    power = TAIL_POWER if left <= 1.0 else 2.0 * TAIL_POWER
    each = left**-power / amplitude
    return math.copysign(sure, mean) * each, mean * each
