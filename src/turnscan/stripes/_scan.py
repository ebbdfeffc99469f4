"""The fused kernel of stripe detection: scan, segment and measure, touching each pixel once.

Everything here works on vertical stripes: a line is an image row. ``dark`` is the laser-off
picture, or one row of zeros when there is none; ``base`` is the level of the background in
``lit - dark``, so that the light of a pixel is ``lit - dark - base``.
"""
# mypy: disable-error-code="untyped-decorator,no-any-return"

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from turnscan.stripes._measure import half_width, plateau

BLOCK = 128
"""Pixels that are passed over together when none is above the threshold."""
PART = 32
"""And, where one is, these together."""
PEAKS = 8
"""Peaks of a line that are looked at before the brightest K are kept."""
SEED, LEFT, RIGHT, TOP, VALLEY, LOW, HIGH = range(7)
"""What is known of a peak: middle of its plateau, the valleys (or ends of the run) on both sides,
its height, the light in the right valley, and where it falls to half."""
FWHM = 2.3548
"""Full width at half maximum of a Gaussian, in sigma."""


RIPPLE = 0.15
"""A dip below this part of a peak starts a new peak in the first pass."""
SPLIT_DEPTH = 0.5
"""Two peaks are two stripes when the valley is below this part of the lower one …"""
SPLIT_DISTANCE = 6.0
"""… and they are this many rms widths apart …"""
SPLIT_DEEP = 0.05
"""… or when the valley is below this part of the lower one, at any distance."""


class Terms(NamedTuple):
    """What the kernel needs to know; all grey levels, all above the background."""

    base: float
    level: float
    """The threshold."""
    low: float
    """A run that rose above ``level`` goes on down to here."""
    noise: float
    """rms of one pixel of ``lit - dark``, without light."""
    variance: float
    """Of one pixel without the shot noise that ``per_level`` adds, grey levels²."""
    per_level: float
    """Shot noise: variance per grey level, 0 when unknown."""
    with_background: bool
    """The background's shot noise is not yet in ``variance``."""
    speckle: float
    """Variance of the centre per px of rms width, px²/px."""
    width: float
    """px rms width, 0 measures it."""
    saturation: float
    """Raw grey level, 0 learns it from the picture."""
    strategy: int


@njit(cache=True, nogil=True, error_model="numpy")
def block_above(lit: Any, dark: Any, v: int, w: int, start: int, stop: int, limit: int) -> bool:
    """True where a pixel of the block is above ``limit``.

    Small types and unsigned counters, so that the compiler makes it SIMD.
    """
    best = lit.dtype.type(0)
    for x in range(np.uint64(start), np.uint64(stop)):
        a = lit[v, x]
        b = dark[w, x]
        d = lit.dtype.type((a if a > b else b) - b)
        best = d if d > best else best
    return bool(best > limit)


@njit(cache=True, nogil=True, error_model="numpy")
def background(lit: Any, dark: Any, roi: Any) -> Any:
    """Median and robust noise of ``lit - dark`` from some ten thousand pixels.

    The noise is the distance from the median down to the 16 % quantile: light only ever adds on
    the other side.
    """
    u0, v0, u1, v1 = roi
    reach = np.iinfo(lit.dtype).max
    counts = np.zeros(2 * reach + 1, np.int32)
    step_v = max(1, (v1 - v0) // 64)
    step_u = max(1, (u1 - u0) // 160)
    paired = dark.shape[0] > 1
    low: Any = np.int64(reach)
    n = 0
    for v in range(v0, v1, step_v):
        a = lit[v]
        b = dark[v if paired else 0]
        for u in range(u0 + (7 * v) % step_u, u1, step_u):
            d = np.int64(a[u]) - np.int64(b[u])
            counts[d + reach] += 1
            low = min(low, d)
            n += 1
    below = 0
    quantile = low - 0.5
    wanted = 0.1587 * n
    for d in range(low, reach + 1):  # type: ignore[assignment]
        here = counts[d + reach]
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
def fill(
    light: Any, lit: Any, dark: Any, v: int, w: int, base: float, first: int, stop: int
) -> None:
    """Put the light of the pixels first … stop-1 of a line into the buffer."""
    for x in range(first, stop):
        light[x] = np.float64(np.int64(lit[v, x]) - np.int64(dark[w, x])) - base


@njit(cache=True, nogil=True, error_model="numpy")
def keep_peak(
    light: Any, peaks: Any, line: int, count: int, left: int, right: int, seed: float, top: float
) -> int:
    """Append the peak between two valleys to the line's list; a full list drops its lowest."""
    if count == PEAKS:
        lowest = line
        for j in range(line + 1, line + PEAKS):
            if peaks[j, TOP] < peaks[lowest, TOP]:
                lowest = j
        if peaks[lowest, TOP] >= top:
            return count
        for j in range(lowest, line + PEAKS - 1):
            peaks[j] = peaks[j + 1]
        count -= 1
    low, high = half_width(light, seed, top, left, right)
    j = line + count
    peaks[j, SEED] = seed
    peaks[j, LEFT] = left
    peaks[j, RIGHT] = right
    peaks[j, TOP] = top
    peaks[j, VALLEY] = light[right]
    peaks[j, LOW] = low
    peaks[j, HIGH] = high
    return count + 1


@njit(cache=True, nogil=True, error_model="numpy")
def segment(
    light: Any, first: int, last: int, noise: float, peaks: Any, line: int, count: int
) -> int:
    """Split the run first … last at its valleys, and append its peaks to the list."""
    slack = 4.0 * noise
    # Nearly every run rises and falls once: find that out first, without branches.
    seed = end = first
    top = bottom = light[first]
    rise = 0.0
    for x in range(first + 1, last + 1):
        q = light[x]
        higher = q > top
        end = x if higher or (q == top and end == x - 1) else end
        seed = x if higher else seed
        top = q if higher else top
        bottom = q if higher or q < bottom else bottom
        rise = max(rise, q - bottom)
    if rise <= slack:
        return keep_peak(light, peaks, line, count, first, last, 0.5 * (seed + end), top)
    left = first
    valley = first
    top = bottom = light[first]
    rising = True
    for x in range(first + 1, last + 1):
        q = light[x]
        if rising:
            if q > top:
                top = q
            elif q < top - slack and q < (1.0 - RIPPLE) * top:
                rising = False
                valley = x
                bottom = q
        elif q < bottom:
            valley = x
            bottom = q
        elif q > bottom + slack and (1.0 - RIPPLE) * q > bottom:
            middle, top = plateau(light, left, valley)
            count = keep_peak(light, peaks, line, count, left, valley, middle, top)
            left = valley
            top = q
            rising = True
    middle, top = plateau(light, left, last)
    return keep_peak(light, peaks, line, count, left, last, middle, top)


@njit(cache=True, nogil=True, error_model="numpy")
def scan_line(
    lit: Any,
    dark: Any,
    v: int,
    w: int,
    light: Any,
    u0: int,
    u1: int,
    terms: Any,
    peaks: Any,
    line: int,
) -> int:
    """Find the peaks of one line: runs that rise above ``level`` and go on down to ``low``."""
    base = terms.base
    level = np.int64(math.floor(terms.level + base))
    low = np.int64(math.floor(terms.low + base))
    limit = max(0, level)
    count = 0
    done = u0
    for start in range(u0, u1, BLOCK):
        end = min(start + BLOCK, u1)
        if not block_above(lit, dark, v, w, start, end, limit):
            continue
        for part in range(start, end, PART):
            stop = min(part + PART, end)
            x = max(part, done)
            if x >= stop or not block_above(lit, dark, v, w, x, stop, limit):
                continue
            while x < stop:
                if np.int64(lit[v, x]) - np.int64(dark[w, x]) <= level:
                    x += 1
                    continue
                first = x
                while (
                    first > done
                    and np.int64(lit[v, first - 1]) - np.int64(dark[w, first - 1]) > low
                ):
                    first -= 1
                x += 1
                while x < u1 and np.int64(lit[v, x]) - np.int64(dark[w, x]) > low:
                    x += 1
                done = x
                fill(light, lit, dark, v, w, base, first, x)
                count = segment(light, first, x - 1, terms.noise, peaks, line, count)
    return count


@njit(cache=True, nogil=True, error_model="numpy")
def merge_peaks(peaks: Any, line: int, count: int, usual: float) -> int:
    """Join the peaks that speckle or noise broke: too near and with too shallow a valley."""
    if count < 2:
        return count
    i = line
    for j in range(line + 1, line + count):
        joined = False
        lower = min(peaks[i, TOP], peaks[j, TOP])
        higher = max(peaks[i, TOP], peaks[j, TOP])
        if peaks[i, RIGHT] == peaks[j, LEFT]:
            valley = peaks[i, VALLEY]
            near = peaks[j, SEED] - peaks[i, SEED] < SPLIT_DISTANCE * usual
            joined = valley > SPLIT_DEEP * lower and (near or valley > SPLIT_DEPTH * lower)
        if not joined:
            i += 1
            if i < j:
                peaks[i] = peaks[j]
            continue
        bridged = 2.0 * lower > higher
        second = peaks[j, TOP] > peaks[i, TOP]
        if bridged or second:
            peaks[i, HIGH] = peaks[j, HIGH]
        if second:
            if not bridged:
                peaks[i, LOW] = peaks[j, LOW]
            peaks[i, SEED] = peaks[j, SEED]
            peaks[i, TOP] = peaks[j, TOP]
        peaks[i, RIGHT] = peaks[j, RIGHT]
        peaks[i, VALLEY] = peaks[j, VALLEY]
    return i - line + 1


@njit(cache=True, nogil=True, error_model="numpy")
def first_pass(
    lit: Any, dark: Any, roi: Any, terms: Any, peaks: Any, counts: Any, light: Any
) -> Any:
    """Peaks of every line, one after the other in ``peaks``.

    Returns the usual rms width and the brightest raw grey level.
    """
    u0, v0, u1, v1 = roi
    paired = dark.shape[0] > 1
    widths = np.empty(v1 - v0)
    found = 0
    brightest = 0.0
    line = 0
    for i in range(v1 - v0):
        v = v0 + i
        n = scan_line(lit, dark, v, v if paired else 0, light, u0, u1, terms, peaks, line)
        counts[i] = n
        if n == 0:
            continue
        best = line
        for j in range(line + 1, line + n):
            if peaks[j, TOP] > peaks[best, TOP]:
                best = j
        brightest = max(brightest, np.float64(lit[v, int(peaks[best, SEED])]))
        widths[found] = (peaks[best, HIGH] - peaks[best, LOW]) / FWHM
        found += 1
        line += n
    if found == 0:
        return 0.0, brightest
    return np.median(widths[:found]), brightest


@njit(cache=True, nogil=True, error_model="numpy")
def learned_saturation(lit: Any, brightest: float) -> float:
    """8 bits: 250 (JPEG rings around 255). 16: 98 % of the 10, 12, 14 or 16 bits in use."""
    if np.iinfo(lit.dtype).max == 255:
        return 250.0
    for bits in (10, 12, 14):
        if brightest < 2.0**bits:
            return 0.98 * (2.0**bits - 1.0)
    return 0.98 * 65535.0
