"""One candidate → its window: centre, width, background, on running sums of its pixels.

``left`` and ``right`` are the outermost pixels that belong to the candidate (the valleys towards
its neighbours). On running sums a turn of the window costs the same however wide the stripe is.
"""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import math

import numpy as np

from turnscan.arrays import Image, Ints, Longs
from turnscan.compiled import njit

HALF_WINDOW = 2.5
"""Half window in rms widths (noise and truncation balance near 2.5: docs/explain/stripes.md)."""
MIN_HALF_WINDOW = 0.9
"""px: less than this cannot see both sides of a stripe."""

SKEW_WINDOW, LEAST_SKEW_WINDOW = 3.0, 1.5
"""Half window of the third moment in rms widths: the tails decide; and px, at least."""
LEAST_SECOND = 0.05
"""px²: no light has less, through pixels; noise may seem to."""
BESIDE = 1.5
"""px from the middle of a falling end of the window to where it has ended."""
FLANK = 4
"""px on each side, beside the ends of the window, that give the background."""
FLANK_DIFFERENCE = 4.0 / math.sqrt(0.5 * FLANK)
"""Difference of the two flanks that is more than noise: four of its own sigmas, in pixel noise."""


@njit(cache=True, nogil=True, error_model="numpy")
def plateau(light: Ints, left: int, right: int) -> tuple[float, int]:
    """Middle and height of the highest pixels between left and right, the first such run."""
    top = light[left]
    first = left
    for x in range(left + 1, right + 1):
        if light[x] > top:
            top = light[x]
            first = x
    last = first
    while last < right and light[last + 1] == top:
        last += 1
    return 0.5 * (first + last), top


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def half_width(
    run: Ints, seed: float, top: int, left: int, right: int, base: float
) -> tuple[float, float]:
    """Both places where the pixels fall to half, above the lower of the two ends or ``base``."""
    floor = max(base, np.float64(min(run[left], run[right])))
    level = floor + 0.5 * (top - floor)
    x = math.floor(seed)
    while x > left and run[x - 1] >= level:
        x -= 1
    low = x - 0.5
    if x > left:
        low = x - (run[x] - level) / (run[x] - run[x - 1])
    x = math.ceil(seed)
    while x < right and run[x + 1] >= level:
        x += 1
    high = x + 0.5
    if x < right:
        high = x + (run[x] - level) / (run[x] - run[x + 1])
    return low, high


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def accumulate(
    lit: Image, dark: Image, v: int, w: int, left: int, right: int, sums: Longs, start: int
) -> None:
    """Running sums of (lit - dark)·t^k, k = 0, 1, 2, over the pixels left … right.

    t counts from their middle. The right - left + 2 rows of ``sums`` from ``start`` begin with
    zeros: the sums over any run of pixels are then the difference of two rows. Integers, so that
    nothing is rounded.
    """
    q0 = q1 = q2 = np.int64(0)
    t = np.int64(-((right - left) // 2))
    i = np.uint64(start)
    sums[i, 0] = sums[i, 1] = sums[i, 2] = 0
    for x in range(np.uint64(left), np.uint64(right + 1)):
        i += np.uint64(1)
        q = np.int64(lit[v, x]) - np.int64(dark[w, x])
        q0 += q
        q *= t
        q1 += q
        q2 += q * t
        t += 1
        sums[i, 0] = q0
        sums[i, 1] = q1
        sums[i, 2] = q2


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def mean_light(sums: Longs, start: int, last: int, low: float, high: float) -> float:
    """Mean of ``lit - dark`` from ``low`` to ``high``, px, as far as there are pixels; where there
    are none, of the nearest one.

    A pixel counts with the part that is meant, so that what lies alike on both sides of a centre
    has the same mean on both, wherever the pixels are.
    """
    low = min(max(low, -0.5), last - 0.5)
    high = max(min(high, last + 0.5), low + 1.0)
    a = min(int(low + 0.5), last)
    b = min(int(high + 0.5), last)
    i = start + a
    j = start + b
    before = sums[i, 0] + (low + 0.5 - a) * (sums[i + 1, 0] - sums[i, 0])
    up_to = sums[j, 0] + (high + 0.5 - b) * (sums[j + 1, 0] - sums[j, 0])
    return (up_to - before) / (high - low)


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def moments(
    sums: Longs, start: int, last: int, c: float, h: float, pedestal: float, slope: float
) -> tuple[float, float, float, float]:
    """Moments 0 to 2 about ``c`` of the light above the background in the window c ± h.

    The background is ``pedestal + slope·(x - c)``. At its ends the window falls from one to nothing
    over three pixels, as the integral of a quadratic B-spline does: light that an end cuts where it
    falls within a pixel would draw the centre by up to 0.02 px, by where the pixels lie. The fourth
    value is how far the first moment lacks when the window moves, per px.
    """
    a = int(c - h + 0.5) + 2
    b = int(c + h + 0.5) - 1
    i = start + a
    j = start + b
    s0 = np.float64(sums[j, 0] - sums[i, 0])
    q1 = np.float64(sums[j, 1] - sums[i, 1])
    q2 = np.float64(sums[j, 2] - sums[i, 2])
    # From powers about the middle to powers about c.
    t = c - last // 2
    s1 = q1 - t * s0
    s2 = q2 - t * (2.0 * q1 - t * s0)
    # The same sums of the background: n pixels between the ends, centred on m.
    n = np.float64(b - a)
    m = 0.5 * (a + b - 1) - c
    e2 = n * (m * m + (n * n - 1.0) / 12.0)
    s0 -= pedestal * n + slope * n * m
    s1 -= pedestal * n * m + slope * e2
    s2 -= pedestal * e2
    lacks = 0.0
    for side in (-1, 1):
        k = int(c + side * h + 0.5)
        t = c + side * h - k
        t *= side
        low, high = 0.5 + t, 0.5 - t
        covers = low * low * low / 6.0, 0.5 + 0.75 * t - t * t * t / 3.0, 1.0 - high**3 / 6.0
        falls = 0.5 * low * low, 0.75 - t * t, 0.5 * high * high
        for r in range(3):
            x = k + side * (1 - r)
            if 0 <= x <= last:
                d = x - c
                q = sums[start + x + 1, 0] - sums[start + x, 0] - pedestal - slope * d
                s0 += covers[r] * q
                s1 += covers[r] * q * d
                s2 += covers[r] * q * d * d
                lacks += falls[r] * q * abs(d)
    return s0, s1, s2, lacks


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def skew_of(
    lit: Image, dark: Image, row: tuple[int, int], c: float, width: float, ends: tuple[int, int],
    level: float,
) -> float:  # fmt: skip
    """Third standardised moment of the light above a ``level`` within ± `SKEW_WINDOW` widths.

    Of the line ``row`` of ``lit`` and ``dark``, not beyond the pixels ``ends`` of the candidate.
    What an edge cuts falls off on one side only; the skew does not depend on how thick the sheet is
    or how its surface lies. NaN where there is no light, or noise cancels what there is.
    """
    h = max(SKEW_WINDOW * width, LEAST_SKEW_WINDOW)
    first = max(math.ceil(c - h - 0.5), ends[0])
    last = min(math.floor(c + h + 0.5), ends[1])
    v, w = row
    s0 = s1 = s2 = s3 = 0.0
    for x in range(np.uint64(first), np.uint64(last + 1)):
        d = x - c
        q = np.float64(np.int64(lit[v, x]) - np.int64(dark[w, x])) - level
        if abs(d) > h - 0.5:
            q *= h + 0.5 - abs(d)
        s0 += q
        q *= d
        s1 += q
        q *= d
        s2 += q
        s3 += q * d
    if s0 <= 0.0:
        return math.nan
    m = s1 / s0
    second = s2 / s0 - m * m
    if second < LEAST_SECOND:
        return math.nan
    third = s3 / s0 - m * (3.0 * s2 / s0 - 2.0 * m * m)
    return third / second**1.5


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def variance_of(second: float, h: float) -> float:
    """Variance of the Gaussian whose part within the window ± h has this variance.

    First what the falling ends make of a window with sharp ones (light alike everywhere has the
    variance h²/3 + 1/4 in place of h²/3), then a rational fit to the truncated Gaussian: within 1 %
    of the width from 2.2 to 3.2 sigma for stripes of 0.7 px or more, 2 % at 0.5 px.
    """
    r = second / (h * h + 0.75)
    second += r * r * (4.77 - 21.1 * r)
    r = min(max(second / (h * h), 0.003), 0.3)
    return h * h * r * (1.0 - 3.27 * r + 4.41 * r * r) / (1.0 - 3.0 * r)


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def background_line(
    sums: Longs, start: int, last: int, c: float, h: float, noise: float
) -> tuple[float, float]:
    """Pedestal at ``c`` and slope of the light beside the window.

    Only the difference beyond what the noise explains makes a slope, so that a clean stripe pays
    nothing for it.
    """
    beside = h + BESIDE
    below = mean_light(sums, start, last, c - beside - FLANK, c - beside)
    above = mean_light(sums, start, last, c + beside, c + beside + FLANK)
    excess = abs(above - below) - FLANK_DIFFERENCE * noise
    slope = 0.0
    if excess > 0.0:
        slope = math.copysign(excess, above - below) / (2.0 * beside + FLANK)
    return 0.5 * (below + above), slope


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def centre_window(
    sums: Longs, start: int, last: int, c: float, width: float, noise: float, turns: int
) -> tuple[float, float, float, float, float, float]:
    """Centre of gravity in a symmetric window of ± 2.5 widths that follows the centre.

    ``c`` counts pixels from the first of the ``last`` + 1 whose sums begin at ``start``. Returns
    the centre, the half window, the light in it, its variance about the centre, the pedestal, and
    how far the window amplifies the noise by following its own centre.
    """
    s0 = s1 = s2 = lacks = pedestal = slope = part = 0.0
    gain = 1.0
    h = MIN_HALF_WINDOW
    for turn in range(turns):
        room = min(c, last - c) + 0.4
        h = max(MIN_HALF_WINDOW, min(HALF_WINDOW * width, room))
        c = min(max(c, h - 0.4), last - h + 0.4)
        if turn == 0:
            pedestal, slope = background_line(sums, start, last, c, h, noise)
        s0, s1, s2, lacks = moments(sums, start, last, c, h, pedestal, slope)
        if s0 <= 0.0:
            return c, h, 0.0, 0.0, pedestal, 1.0
        part = 1.0 / s0
        gain = 1.0 / (1.0 - min(max(lacks * part, 0.0), 0.5))
        c += min(max(gain * s1 * part, -h), h)
    c = min(max(c, -0.5), last + 0.5)
    second = max(s2 * part - (s1 * part) ** 2, 0.02)
    return c, h, s0, second, pedestal, gain
