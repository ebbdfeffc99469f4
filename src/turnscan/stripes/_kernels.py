"""Everything about all candidates of a picture: list, measure in rounds, write down."""
# mypy: disable-error-code="untyped-decorator,no-any-return"

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit

from turnscan.stripes._choice import drop_glow
from turnscan.stripes._measure import (
    BLAIS_RIOUX,
    CENTROID,
    FLANK,
    HALF_WINDOW,
    MEDIAN,
    NOISE_FACTOR,
    PHASE_ERROR,
    WINDOW,
    accumulate,
    by_strategy,
    centre_window,
    fill,
    variance_of,
)
from turnscan.stripes._scan import (
    FWHM,
    HIGH,
    LEFT,
    LOW,
    PEAKS,
    RIGHT,
    SEED,
    TOP,
    first_pass,
    learned_saturation,
    merge_peaks,
    move_peak,
    usual_peak,
)

SATURATED, HALO, EDGE = 8, 16, 32

ROUNDS = 2
"""Times that the widths along the stripe and the centres are brought into agreement."""
FIXED_TURNS = 5
"""Moves of a window of fixed width; where the width is measured too, one in each round."""
SPARE = 4.0
"""Pixels beside the seed that a measurement may look at, in rms widths, and …"""
MARGIN = 6
"""… px more, for the flanks."""
MEMORY = 0.93
"""What a line's width counts for the width of the window in the next line."""
KIN_DISTANCE, KIN_WIDTH = 4.0, 8.0
"""Candidates of adjacent lines belong together within this many widths and this ratio of widths."""
PEDESTAL_LIMIT = 0.1
"""Light beside the stripe above this part of its amplitude is a halo …"""
GLOW_REACH, GLOW_SHARE = 60, 0.2
"""Lines on either side, and the share of their stripes that glow from which all are said to."""
LEAN_LIMIT = 0.3
"""… and so is a centre this many widths away from the middle of the half-height."""
HALO_LIMIT = 0.02
"""Tails of a stripe with less than this part of its light's amplitude are clean (ALGORITHMS §2.3):
under a window of five widths such a pedestal holds 4 % of the light, and all on one side it would
move the centre by a fiftieth of a width (`HALO_BIAS`)."""
HALO_REACH = 15
"""Lines on either side over which a halo is the same and speckle is not: the mean of some thirty
grains of a pixel varies by a sixth of itself."""
CLIPPED_PHASE = 0.11
"""Error from the phase of the pixels on a clipped stripe, px·px² (÷ width²)."""
HALO_BIAS = 0.24
"""Bias of the window, in widths, when half of the light is a one-sided halo (ALGORITHMS §2.2)."""

# Columns of the list of candidates.
ROW, START, PLACE, HEIGHT, HALF, MIDDLE, CENTRE, FLUX, SECOND, PEDESTAL, GAIN, REACH, WIDTH = range(
    13
)
COLUMNS = 13


@njit(cache=True, nogil=True, error_model="numpy")
def keep_brightest(peaks: Any, line: int, count: int, wanted: int) -> int:
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
    peaks: Any, line: int, count: int, j: int, half: float, whole: bool, u0: int, u1: int
) -> Any:
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
    roi: Any,
    terms: Any,
    peaks: Any,
    counts: Any,
    usual: float,
    wanted: int,
    some: Any,
    stops: Any,
) -> Any:
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
def find_kin(some: Any, n: int, up: Any, down: Any) -> None:
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


@njit(cache=True, nogil=True, error_model="numpy")
def smooth_widths(some: Any, n: int, up: Any, down: Any, ahead: Any) -> None:
    """Width of the window: light-weighted rms of the candidates along the stripe.

    A recursive filter forth and back along the kin; it follows a stripe whose width changes, and
    does not follow the speckle of one line.
    """
    for i in range(n):
        weight = some[i, FLUX]
        second = weight * some[i, SECOND]
        if up[i] >= 0:
            weight += MEMORY * ahead[up[i], 0]
            second += MEMORY * ahead[up[i], 1]
        ahead[i, 0] = weight
        ahead[i, 1] = second
    for i in range(n - 1, -1, -1):
        weight = some[i, FLUX]
        second = weight * some[i, SECOND]
        ahead[i, 2] = weight
        ahead[i, 3] = second
        if down[i] >= 0:
            ahead[i, 2] += MEMORY * ahead[down[i], 2]
            ahead[i, 3] += MEMORY * ahead[down[i], 3]
        weight = ahead[i, 0] + ahead[i, 2] - weight
        second = ahead[i, 1] + ahead[i, 3] - second
        some[i, WIDTH] = math.sqrt(second / weight) if weight > 0.0 else some[i, HALF]


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def measure_round(some: Any, n: int, pool: Any, stops: Any, terms: Any, turns: int) -> None:
    """Move every window to its centre, and measure the width within it."""
    start = 0
    for i in range(n):
        last = stops[i] - start - 2
        if last < 1:
            some[i, SECOND] = some[i, HALF] ** 2
            some[i, GAIN] = 1.0
        else:
            c, h, flux, second, pedestal, gain = centre_window(
                pool, start, last, some[i, CENTRE], some[i, WIDTH], terms.noise, turns
            )
            some[i, CENTRE] = c
            some[i, FLUX] = flux
            some[i, SECOND] = variance_of(second, h) if flux > 0.0 else some[i, HALF] ** 2
            some[i, PEDESTAL] = pedestal - terms.base
            some[i, GAIN] = gain
            some[i, REACH] = h
        start = stops[i]


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def clipped(lit: Any, v: int, first: float, last: float, u0: int, u1: int, level: float) -> bool:
    """True where a pixel between first and last is saturated."""
    for x in range(max(u0, int(first)), min(u1 - 1, int(last)) + 1):  # noqa: SIM110
        if lit[v, x] >= level:
            return True
    return False


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def uncertainty(some: Any, i: int, terms: Any, floor: float) -> float:
    """Variance of the window's centre from the camera, px². ``floor``: raw levels without light."""
    h = some[i, REACH]
    flux = some[i, FLUX]
    if flux <= 0.0:
        return some[i, HALF] ** 2
    squares = 2.0 / 3.0 * h * h * h
    pedestal = max(some[i, PEDESTAL], 0.0)
    spread = terms.variance * squares
    spread += terms.per_level * (
        flux * min(some[i, SECOND], h * h / 3.0) + (pedestal + floor) * squares
    )
    return spread * some[i, GAIN] ** 2 / (flux * flux)


@njit(cache=True, nogil=True, error_model="numpy")
def glows(some: Any, i: int, terms: Any) -> bool:
    """Whether light spread beside a stripe."""
    pedestal = some[i, PEDESTAL]
    amplitude = max(some[i, HEIGHT] - pedestal, 1.0)
    return pedestal > PEDESTAL_LIMIT * amplitude and pedestal > 4.0 * terms.noise


@njit(cache=True, nogil=True, error_model="numpy")
def glowing_nearby(some: Any, n: int, terms: Any, lines: int) -> Any:
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
def haloed(some: Any, n: int, terms: Any, lines: int) -> Any:
    """(H,) the highest of each line, and True where light has spread beside the stripe there.

    A grain of speckle in the tail of one line looks like a halo. But grains differ from line to
    line and light that spread in the material does not, so the sums over many lines decide: of the
    pedestal beside the highest candidates, and of how far they lean, weighted by their light.
    """
    sums = np.zeros((lines + 1, 5))
    highest = np.zeros(lines)
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
    for v in range(lines):
        for k in range(5):
            sums[v + 1, k] += sums[v, k]
    out = np.zeros(lines, np.bool_)
    part = np.empty(5)
    for v in range(lines):
        a, b = max(0, v - HALO_REACH), min(lines, v + HALO_REACH + 1)
        for k in range(5):
            part[k] = sums[b, k] - sums[a, k]
        noise = 4.0 * terms.noise * math.sqrt(part[4] / (2.0 * FLANK))
        out[v] = part[0] > max(HALO_LIMIT * part[1], noise) or abs(part[2]) > LEAN_LIMIT * part[3]
    return highest, out


@njit(cache=True, nogil=True, error_model="numpy")
def write_down(
    lit: Any,
    dark: Any,
    roi: Any,
    terms: Any,
    saturation: float,
    some: Any,
    n: int,
    light: Any,
    stops: Any,
    table: Any,
    bits: Any,
) -> None:
    """From the list to ``table`` and ``bits``: sigma, flags, and the centre by the strategy."""
    u0, _, u1, _ = roi
    paired = dark.shape[0] > 1
    factor = NOISE_FACTOR[terms.strategy]
    phase = PHASE_ERROR[terms.strategy]
    nearby = glowing_nearby(some, n, terms, table.shape[1])
    highest, halos = haloed(some, n, terms, table.shape[1])
    row = -1
    j = 0
    for i in range(n):
        v = int(some[i, ROW])
        j = j + 1 if v == row else 0
        row = v
        left = int(some[i, START])
        right = left + stops[i] - (stops[i - 1] if i else 0) - 2
        position = some[i, CENTRE] + left
        w = v if paired else 0
        floor = 0.0
        if terms.with_background:
            floor = max(0.0, 2.0 * dark[w, int(some[i, PLACE])] + terms.base)
        spread = uncertainty(some, i, terms, floor) + terms.speckle * some[i, WIDTH]
        h = some[i, REACH]
        flags = 0
        if h < HALF_WINDOW * some[i, WIDTH] - 0.5 and (
            position - h < u0 + 0.5 or position + h > u1 - 1.5
        ):
            flags |= EDGE
        if clipped(lit, v, position - h, position + h, u0, u1, saturation):
            flags |= SATURATED
            spread += (CLIPPED_PHASE / max(some[i, SECOND], 0.25)) ** 2
        amplitude = some[i, HEIGHT] - some[i, PEDESTAL]
        halo = some[i, PEDESTAL] / max(amplitude, 1.0)
        lean = abs(some[i, CENTRE] + left - some[i, MIDDLE]) / some[i, WIDTH]
        glow = glows(some, i, terms)
        if halos[v] or (glow and some[i, HEIGHT] < highest[v]):
            # A weaker peak that stands in light may be that light's alone.
            flags |= HALO
        if glow or lean > LEAN_LIMIT:
            spread += (HALO_BIAS * some[i, WIDTH] * min(1.0, halo + lean)) ** 2
        if terms.strategy in (CENTROID, MEDIAN):
            # Their phase error comes from what the threshold cuts off.
            phase = PHASE_ERROR[WINDOW] + PHASE_ERROR[terms.strategy] * min(
                1.0, terms.level / (0.2 * max(amplitude, 1.0))
            )
        strategy = terms.strategy
        if strategy == WINDOW and (glow or nearby[v]):
            # Light that spread beside the stripe drags the window along; its core stays in place.
            # A line between glowing ones is measured as they are, lest the surface be stepped.
            strategy = BLAIS_RIOUX
        if strategy != WINDOW:
            fill(light, lit, dark, v, w, terms.base, left, right + 1)
            position = by_strategy(
                light, strategy, some[i, PLACE], some[i, HALF], left, right, terms.level
            )
        table[0, v, j] = position
        table[1, v, j] = math.sqrt(spread * factor * factor + phase * phase)
        table[2, v, j] = amplitude
        table[3, v, j] = math.sqrt(some[i, SECOND])
        bits[v, j] = flags


@njit(cache=True, nogil=True, error_model="numpy")
def detect_lines(lit: Any, dark: Any, roi: Any, terms: Any, table: Any, bits: Any) -> None:
    """Fill ``table`` (4, H, K: position, sigma, amplitude, width) and ``bits`` (H, K).

    Both come filled with NaN and zeros.
    """
    _, v0, _, v1 = roi
    paired = dark.shape[0] > 1
    light = np.empty(lit.shape[1])
    peaks = np.empty(((v1 - v0) * PEAKS, 7))
    counts = np.zeros(v1 - v0, np.int64)
    first_pass(lit, dark, roi, terms, peaks, counts)
    usual, brightest = usual_peak(lit, v0, peaks, counts)
    fixed = terms.width > 0.0
    room = counts.sum()
    some = np.zeros((room + 1, COLUMNS))
    stops = np.empty(room, np.int64)
    wanted = table.shape[2]
    expected = terms.width if fixed else usual
    n, total = list_candidates(roi, terms, peaks, counts, expected, wanted, some, stops)
    pool = np.empty((total, 3), np.int64)
    for i in range(n):
        start = stops[i - 1] if i else 0
        v = int(some[i, ROW])
        left = int(some[i, START])
        right = left + stops[i] - start - 2
        accumulate(lit, dark, v, v if paired else 0, left, right, pool, start)
    if fixed:
        some[:, WIDTH] = terms.width
        measure_round(some, n, pool, stops, terms, FIXED_TURNS)
    else:
        up = np.empty(n, np.int64)
        down = np.empty(n, np.int64)
        ahead = np.empty((n, 4))
        find_kin(some, n, up, down)
        for _ in range(ROUNDS):
            smooth_widths(some, n, up, down, ahead)
            measure_round(some, n, pool, stops, terms, 1)
    saturation = terms.saturation
    if saturation <= 0.0:
        saturation = learned_saturation(lit, brightest)
    write_down(lit, dark, roi, terms, saturation, some, n, light, stops, table, bits)
    drop_glow(table, bits)
