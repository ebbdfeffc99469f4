"""The fused kernel of stripe detection: scan, segment and measure, touching each pixel once.

Everything here works on vertical stripes: a line is an image row. ``dark`` is the laser-off
picture, or one row of zeros when there is none; ``base`` is the level of the background in
``lit - dark``, so that the light of a pixel is ``lit - dark - base``.
"""
# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from turnscan.stripes._measure import (
    HALF_WINDOW,
    NOISE_FACTOR,
    PHASE_ERROR,
    WINDOW,
    by_strategy,
    half_width,
    measure_window,
    plateau,
)

BLOCK = 128
"""Pixels that are passed over together when none is above the threshold."""
PEAKS = 12
"""Peaks of a line that are looked at before the brightest K are kept."""
FWHM = 2.3548
"""Full width at half maximum of a Gaussian, in sigma."""
SATURATED, HALO, EDGE = 8, 16, 32

RIPPLE = 0.15
"""A dip below this part of a peak starts a new peak in the first pass."""
SPLIT_DEPTH = 0.5
"""Two peaks are two stripes when the valley is below this part of the lower one …"""
SPLIT_DISTANCE = 5.0
"""… and they are this many rms widths apart …"""
SPLIT_DEEP = 0.15
"""… or when the valley is below this part of the lower one, at any distance."""

PEDESTAL_LIMIT = 0.12
"""Light beside the stripe above this part of its amplitude is a halo …"""
SKEW_LIMIT = 0.35
"""… and so is a window this skewed."""
CLIPPED_PHASE = 0.11
"""Error from the phase of the pixels on a clipped stripe, px·px² (÷ width²)."""
HALO_BIAS = 0.24
"""Bias of the window, in widths, when half of the light is a one-sided halo (ALGORITHMS §2.2)."""


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


@njit(cache=True, nogil=True)
def block_above(lit: Any, dark: Any, limit: int) -> bool:
    """True where a pixel of the block is above ``limit``; small types, so that it becomes SIMD."""
    best = lit.dtype.type(0)
    for x in range(lit.size):
        a = lit[x]
        b = dark[x]
        d = lit.dtype.type((a if a > b else b) - b)
        best = d if d > best else best
    return best > limit


@njit(cache=True, nogil=True)
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
    low = np.int64(reach)
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
    for d in range(low, reach + 1):
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


@njit(cache=True, nogil=True)
def light_at(lit: Any, dark: Any, base: float, x: int) -> float:
    """The light of one pixel."""
    return np.float64(lit[x]) - np.float64(dark[x]) - base


@njit(cache=True, nogil=True)
def fill(light: Any, lit: Any, dark: Any, base: float, first: int, stop: int) -> None:
    """Put the light of the pixels first … stop-1 into the buffer."""
    for x in range(first, stop):
        light[x] = light_at(lit, dark, base, x)


@njit(cache=True, nogil=True)
def keep_peak(
    peaks: Any, count: int, seed: int, left: int, right: int, top: float, valley: float
) -> int:
    """Append a peak (seed, left, right, top, light at right); a full list drops its lowest."""
    if count == PEAKS:
        lowest = 0
        for j in range(1, PEAKS):
            if peaks[j, 3] < peaks[lowest, 3]:
                lowest = j
        if peaks[lowest, 3] >= top:
            return count
        for j in range(lowest, PEAKS - 1):
            peaks[j] = peaks[j + 1]
        count -= 1
    peaks[count, 0] = seed
    peaks[count, 1] = left
    peaks[count, 2] = right
    peaks[count, 3] = top
    peaks[count, 4] = valley
    return count + 1


@njit(cache=True, nogil=True)
def segment(light: Any, first: int, last: int, noise: float, peaks: Any, count: int) -> int:
    """Split the run first … last at its valleys, and append its peaks to the list."""
    left = first
    seed = first
    valley = first
    rising = True
    for x in range(first + 1, last + 1):
        q = light[x]
        top = light[seed]
        if rising:
            if q > top:
                seed = x
            elif q < top - max(4.0 * noise, RIPPLE * top):
                rising = False
                valley = x
        elif q < light[valley]:
            valley = x
        elif q > light[valley] + max(4.0 * noise, RIPPLE * q):
            count = keep_peak(peaks, count, seed, left, valley, light[seed], light[valley])
            left = valley
            seed = x
            rising = True
    return keep_peak(peaks, count, seed, left, last, light[seed], light[last])


@njit(cache=True, nogil=True)
def scan_line(lit: Any, dark: Any, light: Any, u0: int, u1: int, terms: Any, peaks: Any) -> int:
    """Find the peaks of one line: runs that rise above ``level`` and go on down to ``low``."""
    base = terms.base
    limit = max(0, int(math.floor(terms.level + base)))
    count = 0
    done = u0
    for start in range(u0, u1, BLOCK):
        stop = min(start + BLOCK, u1)
        if stop <= done or not block_above(lit[start:stop], dark[start:stop], limit):
            continue
        for x in range(max(start, done), stop):
            if x < done or light_at(lit, dark, base, x) <= terms.level:
                continue
            first = x
            while first > done and light_at(lit, dark, base, first - 1) > terms.low:
                first -= 1
            last = x
            while last + 1 < u1 and light_at(lit, dark, base, last + 1) > terms.low:
                last += 1
            fill(light, lit, dark, base, first, last + 1)
            count = segment(light, first, last, terms.noise, peaks, count)
            done = last + 1
    return count


@njit(cache=True, nogil=True)
def merge_peaks(peaks: Any, count: int, usual: float) -> int:
    """Join the peaks that speckle or noise broke: too near and with too shallow a valley."""
    kept = 0
    for j in range(count):
        together = kept > 0 and peaks[kept - 1, 2] == peaks[j, 1]
        if together:
            valley = peaks[kept - 1, 4]
            lower = min(peaks[kept - 1, 3], peaks[j, 3])
            near = peaks[j, 0] - peaks[kept - 1, 0] < SPLIT_DISTANCE * usual
            together = valley > SPLIT_DEEP * lower and (near or valley > SPLIT_DEPTH * lower)
        if together:
            peaks[kept - 1, 2] = peaks[j, 2]
            peaks[kept - 1, 4] = peaks[j, 4]
            if peaks[j, 3] > peaks[kept - 1, 3]:
                peaks[kept - 1, 0] = peaks[j, 0]
                peaks[kept - 1, 3] = peaks[j, 3]
        else:
            peaks[kept] = peaks[j]
            kept += 1
    return kept


@njit(cache=True, nogil=True)
def reach_of(peaks: Any, count: int, j: int, u0: int, u1: int) -> Any:
    """First and last pixel that the measurement of peak j may look at."""
    left = int(peaks[j, 1])
    right = int(peaks[j, 2])
    margin = 2 * (right - left) + 12
    if j == 0:
        left = max(u0, left - margin)
    elif peaks[j - 1, 2] < left:
        left = max(int(peaks[j - 1, 2]) + 1, left - margin)
    if j == count - 1:
        right = min(u1 - 1, right + margin)
    elif peaks[j + 1, 1] > right:
        right = min(int(peaks[j + 1, 1]) - 1, right + margin)
    return left, right


@njit(cache=True, nogil=True)
def clipped(lit: Any, first: float, last: float, left: int, right: int, level: float) -> bool:
    """True where a pixel between first and last is saturated."""
    for x in range(max(left, int(math.ceil(first))), min(right, int(math.floor(last))) + 1):
        if lit[x] >= level:
            return True
    return False


@njit(cache=True, nogil=True)
def measure_peak(
    lit: Any,
    dark: Any,
    light: Any,
    variance: Any,
    peak: Any,
    left: int,
    right: int,
    saturation: float,
    terms: Any,
    out: Any,
) -> int:
    """Measure one candidate: position, sigma, amplitude, width into ``out``; returns the flags."""
    fill(light, lit, dark, terms.base, left, right + 1)
    for x in range(left, right + 1):
        seen = np.float64(lit[x]) + np.float64(dark[x]) if terms.with_background else light[x]
        variance[x] = terms.variance + terms.per_level * max(seen, 0.0)
    seed, top = plateau(light, int(peak[1]), int(peak[2]))
    low, high = half_width(light, seed, top, left, right)
    width = terms.width if terms.width > 0.0 else max(0.45, (high - low) / FWHM)
    centre, width, spread, pedestal, skew, cut = measure_window(
        light, variance, left, right, 0.5 * (low + high), width, terms.width > 0.0, terms.noise
    )
    amplitude = top - pedestal
    flags = 0
    if cut:
        flags |= EDGE
    half = HALF_WINDOW * width
    if clipped(lit, centre - half, centre + half, left, right, saturation):
        flags |= SATURATED
        spread += (CLIPPED_PHASE / (width * width)) ** 2
    halo = pedestal / max(amplitude, 1.0)
    if (pedestal > 4.0 * terms.noise and halo > PEDESTAL_LIMIT) or abs(skew) > SKEW_LIMIT:
        flags |= HALO
        spread += (HALO_BIAS * width * min(1.0, halo + abs(skew))) ** 2
    spread += terms.speckle * width
    factor = NOISE_FACTOR[terms.strategy]
    phase = PHASE_ERROR[terms.strategy]
    position = centre
    if terms.strategy != WINDOW:
        position = by_strategy(light, terms.strategy, seed, left, right, terms.level)
    out[0] = position
    out[1] = math.sqrt(spread * factor * factor + phase * phase)
    out[2] = amplitude
    out[3] = width
    return flags


@njit(cache=True, nogil=True)
def place(table: Any, bits: Any, v: int, count: int, out: Any, flags: int) -> int:
    """Put one measured candidate into line v, in order of position, keeping the brightest K."""
    k = table.shape[2]
    if count == k:
        weakest = 0
        for j in range(1, k):
            if table[2, v, j] < table[2, v, weakest]:
                weakest = j
        if table[2, v, weakest] >= out[2]:
            return count
        for j in range(weakest, k - 1):
            table[:, v, j] = table[:, v, j + 1]
            bits[v, j] = bits[v, j + 1]
        count -= 1
    j = count
    while j > 0 and table[0, v, j - 1] > out[0]:
        table[:, v, j] = table[:, v, j - 1]
        bits[v, j] = bits[v, j - 1]
        j -= 1
    for i in range(4):
        table[i, v, j] = out[i]
    bits[v, j] = flags
    return count + 1


@njit(cache=True, nogil=True)
def first_pass(
    lit: Any, dark: Any, roi: Any, terms: Any, peaks: Any, counts: Any, light: Any
) -> Any:
    """Peaks of every line; returns the usual rms width and the brightest raw grey level."""
    u0, v0, u1, v1 = roi
    paired = dark.shape[0] > 1
    widths = np.empty(v1 - v0)
    found = 0
    brightest = 0.0
    for i in range(v1 - v0):
        line = lit[v0 + i]
        n = scan_line(line, dark[v0 + i if paired else 0], light, u0, u1, terms, peaks[i])
        counts[i] = n
        if n == 0:
            continue
        best = 0
        for j in range(1, n):
            if peaks[i, j, 3] > peaks[i, best, 3]:
                best = j
        left, right = int(peaks[i, best, 1]), int(peaks[i, best, 2])
        brightest = max(brightest, np.float64(line[int(peaks[i, best, 0])]))
        seed, top = plateau(light, left, right)
        low, high = half_width(light, seed, top, left, right)
        widths[found] = (high - low) / FWHM
        found += 1
    if found == 0:
        return 0.0, brightest
    return np.median(widths[:found]), brightest


@njit(cache=True, nogil=True)
def learned_saturation(lit: Any, brightest: float) -> float:
    """8 bits: 250 (JPEG rings around 255). 16: 98 % of the 10, 12, 14 or 16 bits in use."""
    if np.iinfo(lit.dtype).max == 255:
        return 250.0
    for bits in (10, 12, 14):
        if brightest < 2.0**bits:
            return 0.98 * (2.0**bits - 1.0)
    return 0.98 * 65535.0


@njit(cache=True, nogil=True)
def detect_lines(lit: Any, dark: Any, roi: Any, terms: Any, table: Any, bits: Any) -> None:
    """Fill ``table`` (4, H, K: position, sigma, amplitude, width) and ``bits`` (H, K).

    Both come filled with NaN and zeros.
    """
    u0, v0, u1, v1 = roi
    paired = dark.shape[0] > 1
    light = np.zeros(lit.shape[1])
    variance = np.zeros(lit.shape[1])
    peaks = np.empty((v1 - v0, PEAKS, 5))
    counts = np.zeros(v1 - v0, np.int32)
    out = np.empty(4)
    usual, brightest = first_pass(lit, dark, roi, terms, peaks, counts, light)
    if terms.width > 0.0:
        usual = terms.width
    saturation = terms.saturation
    if saturation <= 0.0:
        saturation = learned_saturation(lit, brightest)
    for i in range(v1 - v0):
        v = v0 + i
        n = merge_peaks(peaks[i], counts[i], usual)
        placed = 0
        for j in range(n):
            left, right = reach_of(peaks[i], n, j, u0, u1)
            flags = measure_peak(
                lit[v],
                dark[v if paired else 0],
                light,
                variance,
                peaks[i, j],
                left,
                right,
                saturation,
                terms,
                out,
            )
            placed = place(table, bits, v, placed, out, flags)
