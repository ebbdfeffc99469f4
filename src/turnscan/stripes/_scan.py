"""The fused kernel of stripe detection: scan, segment and measure, touching each pixel once.

Everything here works on vertical stripes: a line is an image row. ``dark`` is the laser-off
picture, or one row of zeros when there is none; ``base`` is the level of the background in
``lit - dark``, so that the light of a pixel is ``lit - dark - base``.
"""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from turnscan.arrays import Floats, Image, Ints, Longs, Region
from turnscan.compiled import njit
from turnscan.stripes._levels import typical
from turnscan.stripes._measure import half_width, plateau

BLOCK = 128
"""Pixels that are looked through together; their number must fit in a byte."""
PEAKS = 8
"""Peaks of a line that are looked at before the brightest K are kept."""
SEED, LEFT, RIGHT, TOP, VALLEY, LOW, HIGH = range(7)
"""What is known of a peak: middle of its plateau, the valleys (or ends of the run) on both sides,
its height, the light in the right valley, and where it falls to half."""
PEAK_COLUMNS = 7
PLATEAU = 3
"""Equal pixels in a row that no peak has by chance: two may lie on either side of its middle."""
LEVEL = 0.01
"""Of a grey level: what counts as equal. In a projected colour picture the other channels' noise
lies on a clipped one; three pixels of a peak are that level only where it is 7 px wide (sigma)."""
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


class Row(NamedTuple):
    """Where a run is followed."""

    v: int
    """The line, a row of ``lit``, and …"""
    w: int
    """… the row of ``dark`` that belongs to it."""
    stop: int
    """The first pixel beyond the region of interest."""
    low: int
    """A run goes on while ``lit - dark`` is above this."""


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def first_above(lit: Image, dark: Image, v: int, w: int, start: int, after: int, limit: int) -> int:
    """First pixel of a block above ``limit`` and not before ``after``, or the end of the block.

    Small types, unsigned counters and products in place of branches: the compiler makes it SIMD.
    """
    small = lit.dtype.type
    least = small(limit)
    room = small(start + BLOCK - after)
    best = small(0)
    x = np.uint64(start)
    for i in range(np.uint64(BLOCK)):
        a = lit[v, x + i]
        b = dark[w, x + i]
        d = small((a if a > b else b) - b)
        left = small(np.uint64(BLOCK) - i)
        left = small(left * small((d > least) & (left <= room)))
        best = left if left > best else best
    return int(start + BLOCK - np.int64(best))


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def difference(lit: Image, dark: Image, v: int, w: int, x: int) -> int:
    """``lit - dark`` of one pixel."""
    u = np.uint64(x)
    return int(np.int64(lit[v, u]) - np.int64(dark[w, u]))


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def move_peak(peaks: Floats, source: int, target: int) -> None:
    """Copy one row of the list of peaks over another."""
    for k in range(PEAK_COLUMNS):
        peaks[target, k] = peaks[source, k]


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def keep_peak(
    run: Ints,
    peaks: Floats,
    line: int,
    count: int,
    left: int,
    right: int,
    seed: float,
    top: int,
    base: float,
) -> int:
    """Append the peak between two valleys to the line's list; a full list drops its lowest."""
    if count == PEAKS:
        lowest = line
        for j in range(line + 1, line + PEAKS):
            if peaks[j, TOP] < peaks[lowest, TOP]:
                lowest = j
        if peaks[lowest, TOP] >= top - base:
            return count
        for j in range(lowest, line + PEAKS - 1):
            move_peak(peaks, j + 1, j)
        count -= 1
    low, high = half_width(run, seed, top, left, right, base)
    j = line + count
    peaks[j, SEED] = seed
    peaks[j, LEFT] = left
    peaks[j, RIGHT] = right
    peaks[j, TOP] = top - base
    peaks[j, VALLEY] = run[right] - base
    peaks[j, LOW] = low
    peaks[j, HIGH] = high
    return count + 1


@njit(cache=True, nogil=True, error_model="numpy")
def split(
    run: Ints,
    first: int,
    last: int,
    slack: float,
    peaks: Floats,
    line: int,
    count: int,
    base: float,
) -> int:
    """Split the run first … last at its valleys, and append its peaks to the list."""
    left = first
    valley = first
    top = bottom = run[first]
    rising = True
    for x in range(first + 1, last + 1):
        q = run[x]
        if rising:
            if q > top:
                top = q
            elif q < top - slack and q - base < (1.0 - RIPPLE) * (top - base):
                rising = False
                valley = x
                bottom = q
        elif q < bottom:
            valley = x
            bottom = q
        elif q > bottom + slack and (1.0 - RIPPLE) * (q - base) > bottom - base:
            middle, top = plateau(run, left, valley)
            count = keep_peak(run, peaks, line, count, left, valley, middle, top, base)
            left = valley
            top = q
            rising = True
    middle, top = plateau(run, left, last)
    return keep_peak(run, peaks, line, count, left, last, middle, top, base)


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def follow_run(
    lit: Image, dark: Image, v: int, w: int, first: int, stop: int, low: int, run: Ints
) -> tuple[int, int, int, int, int]:
    """Copy the pixels from ``first`` on that are above ``low`` to ``run``.

    Returns the end, both ends and the height of the first highest plateau, and the largest rise
    after a fall, which tells whether there is one peak only; without branches but the last one.
    """
    seed = end = x = first
    top = bottom = q = difference(lit, dark, v, w, first)
    rise = 0
    while q > low:
        run[np.uint64(x)] = q
        higher = q > top
        end = x if higher or (q == top and end == x - 1) else end
        seed = x if higher else seed
        bottom = q if higher or q < bottom else bottom
        top = q if higher else top
        rise = max(rise, q - bottom)
        x += 1
        if x == stop:
            break
        q = difference(lit, dark, v, w, x)
    return x, seed, end, top, rise


@njit(cache=True, nogil=True, error_model="numpy")
def merge_peaks(peaks: Floats, line: int, count: int, usual: float) -> int:
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
                move_peak(peaks, j, i)
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


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def limits_of(lit: Image, terms: Terms) -> tuple[int, int]:
    """Levels of ``lit - dark``: a run rises above the first, and goes on above the second."""
    limit = min(max(0, math.floor(terms.level + terms.base)), int(np.iinfo(lit.dtype).max))
    return limit, min(math.floor(terms.low + terms.base), limit)


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def keep_run(
    lit: Image,
    dark: Image,
    row: Row,
    first: int,
    done: int,
    run: Ints,
    peaks: Floats,
    line: int,
    count: int,
    terms: Terms,
) -> tuple[int, int]:
    """Append the peaks of the run about ``first``, a pixel above the threshold, to the line's list.

    The run does not reach back before ``done``. Returns where it ends, and the line's count.
    """
    v, w, stop, low = row
    slack = 4.0 * terms.noise
    while first > done and difference(lit, dark, v, w, first - 1) > low:
        first -= 1
    done, seed, end, top, rise = follow_run(lit, dark, v, w, first, stop, low, run)
    if rise <= slack:
        middle = 0.5 * (seed + end)
        return done, keep_peak(run, peaks, line, count, first, done - 1, middle, top, terms.base)
    return done, split(run, first, done - 1, slack, peaks, line, count, terms.base)


@njit(cache=True, nogil=True, error_model="numpy")
def first_pass(
    lit: Image, dark: Image, roi: Region, terms: Terms, peaks: Floats, counts: Longs
) -> None:
    """Peaks of every line, one after the other in ``peaks``; their number per line in ``counts``.

    A peak is in a run of pixels that rises above ``level`` and goes on down to ``low``. Pictures
    are at least `BLOCK` wide.
    """
    u0, v0, u1, v1 = roi
    paired = dark.shape[0] > 1
    limit, low = limits_of(lit, terms)
    run = np.empty(u1, np.int32)
    line = 0
    for v in range(v0, v1):
        w = v if paired else 0
        row = Row(v, w, u1, low)
        count = 0
        done = u0
        for place in range(u0, u1, BLOCK):
            start = min(place, lit.shape[1] - BLOCK)
            stop = min(start + BLOCK, u1)
            while done < stop:
                first = first_above(lit, dark, v, w, start, max(start, done), limit)
                if first >= stop:
                    break
                done, count = keep_run(lit, dark, row, first, done, run, peaks, line, count, terms)
        counts[v - v0] = count
        line += count


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def plateau_at(lit: Image, v: int, x: int) -> bool:
    """Whether `PLATEAU` pixels in a row about x are as bright as the one there."""
    lowest = (1.0 - LEVEL) * lit[v, x]
    first = last = x
    while last - first + 1 < PLATEAU and first > 0 and lit[v, first - 1] >= lowest:
        first -= 1
    while last - first + 1 < PLATEAU and last < lit.shape[1] - 1 and lit[v, last + 1] >= lowest:
        last += 1
    return last - first + 1 >= PLATEAU


@njit(cache=True, nogil=True, error_model="numpy")
def usual_peak(lit: Image, v0: int, peaks: Floats, counts: Longs) -> tuple[float, int, bool]:
    """Usual rms width of the highest peaks of the lines, the brightest raw grey level, and whether
    `PLATEAU` pixels in a row are as bright."""
    widths = np.empty(counts.size)
    found = 0
    brightest = 0
    flat = False
    line = 0
    for i in range(counts.size):
        if counts[i] == 0:
            continue
        best = line
        for j in range(line + 1, line + counts[i]):
            if peaks[j, TOP] > peaks[best, TOP]:
                best = j
        seed = int(peaks[best, SEED])
        raw = int(lit[v0 + i, seed])
        if raw >= brightest:
            flat = plateau_at(lit, v0 + i, seed) or (flat and raw == brightest)
            brightest = raw
        widths[found] = (peaks[best, HIGH] - peaks[best, LOW]) * (1.0 / FWHM)
        found += 1
        line += counts[i]
    return typical(widths, found), brightest, flat
