"""All candidates of a picture: listed (`_list`), measured in rounds, written down."""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from turnscan.arrays import Flags, Floats, Image, Longs, Region
from turnscan.compiled import njit
from turnscan.stripes._choice import drop_glow
from turnscan.stripes._clipped import clipped_phase, lopsided
from turnscan.stripes._halo import (
    LEAN_LIMIT,
    glowing_nearby,
    glows,
    haloed,
    tails,
)
from turnscan.stripes._levels import learned_saturation
from turnscan.stripes._list import (
    CENTRE,
    COLUMNS,
    FLUX,
    GAIN,
    HALF,
    HEIGHT,
    INSIDE,
    MIDDLE,
    PEDESTAL,
    PLACE,
    REACH,
    ROW,
    SECOND,
    START,
    WIDTH,
    find_kin,
    list_candidates,
)
from turnscan.stripes._measure import (
    HALF_WINDOW,
    accumulate,
    centre_window,
    skew_of,
    variance_of,
)
from turnscan.stripes._scan import PEAK_COLUMNS, PEAKS, Terms, first_pass, usual_peak
from turnscan.stripes._strategies import (
    BLAIS_RIOUX,
    NOISE_FACTOR,
    WINDOW,
    by_strategy,
    fill,
    phase_error,
)

SATURATED, HALO, EDGE = 8, 16, 32

ROUNDS = 2
"""Times that the widths along the stripe and the centres are brought into agreement."""
FIXED_TURNS = 5
"""Moves of a window of fixed width; where the width is measured too, one in each round."""
MEMORY = 0.93
"""What a line's width counts for the width of the window in the next line."""
HALO_BIAS = 0.24
"""Bias of the window, in widths, with half of the light in a one-sided halo."""


class Listed(NamedTuple):
    """The candidates of a picture before they are measured."""

    some: Floats
    """(n, COLUMNS) the list; rows from ``size`` on are empty."""
    stops: Longs
    """The end of each one's pixels in the pool."""
    size: int
    pool: int
    """Pixels that they need together."""
    saturation: float
    """Grey level."""


@njit(cache=True, nogil=True, error_model="numpy")
def smooth_widths(some: Floats, n: int, up: Longs, down: Longs, ahead: Floats) -> None:
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
def measure_round(
    some: Floats, n: int, pool: Longs, stops: Longs, terms: Terms, turns: int
) -> None:
    """Move every window to its centre, and measure the width within it."""
    start = 0
    for i in range(n):
        last = stops[i] - start - 2
        if last < 1:
            some[i, SECOND] = some[i, INSIDE] = some[i, HALF] ** 2
            some[i, GAIN] = 1.0
        else:
            c, h, flux, second, pedestal, gain = centre_window(
                pool, start, last, some[i, CENTRE], some[i, WIDTH], terms.noise, turns
            )
            some[i, CENTRE] = c
            some[i, FLUX] = flux
            some[i, SECOND] = variance_of(second, h) if flux > 0.0 else some[i, HALF] ** 2
            some[i, INSIDE] = second
            some[i, PEDESTAL] = pedestal - terms.base
            some[i, GAIN] = gain
            some[i, REACH] = h
        start = stops[i]


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def uncertainty(some: Floats, i: int, terms: Terms, floor: float) -> float:
    """Variance of the window's centre from the camera, px². ``floor``: raw levels without light."""
    h = some[i, REACH]
    flux = some[i, FLUX]
    if flux <= 0.0:
        return some[i, HALF] ** 2
    squares = 2.0 / 3.0 * h * h * h
    pedestal = max(some[i, PEDESTAL], 0.0)
    spread = terms.variance * squares
    spread += terms.per_level * (flux * some[i, INSIDE] + (pedestal + floor) * squares)
    return spread * some[i, GAIN] ** 2 / (flux * flux)


@njit(cache=True, nogil=True, error_model="numpy")
def write_down(
    lit: Image,
    dark: Image,
    roi: Region,
    terms: Terms,
    listed: Listed,
    light: Floats,
    table: Floats,
    bits: Flags,
) -> None:
    """From the list to ``table`` and ``bits``: sigma, flags, and the centre by the strategy."""
    u0, _, u1, _ = roi
    some, stops, n, _, saturation = listed
    paired = dark.shape[0] > 1
    nearby = glowing_nearby(some, n, terms, table.shape[1])
    highest, halos, shift, scatter = haloed(some, n, terms, table.shape[1])
    full, cut = lopsided(some, n, lit, dark, terms.base, roi, saturation)
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
        if full[i]:
            flags |= SATURATED
            spread += clipped_phase(some, i, full[i]) + cut[i]
        amplitude = some[i, HEIGHT] - some[i, PEDESTAL]
        halo = some[i, PEDESTAL] / max(amplitude, 1.0)
        lean = abs(some[i, CENTRE] + left - some[i, MIDDLE]) / some[i, WIDTH]
        glow = glows(some, i, terms)
        if glow or lean > LEAN_LIMIT:
            spread += (HALO_BIAS * some[i, WIDTH] * min(1.0, halo + lean)) ** 2
        strategy = terms.strategy
        if strategy == WINDOW and (glow or nearby[v]):
            # Light that spread beside the stripe drags the window along; its core stays in place.
            # A line between glowing ones is measured as they are, lest the surface be stepped.
            strategy = BLAIS_RIOUX
        moved = shift[0, v] * some[i, WIDTH]
        factor = NOISE_FACTOR[strategy]
        phase = phase_error(strategy, some[i, WIDTH], terms.level / max(amplitude, 1.0))
        if strategy != WINDOW:
            fill(light, lit, dark, v, w, terms.base, left, right + 1)
            position = by_strategy(
                light, strategy, some[i, PLACE], some[i, HALF], left, right, terms.level
            )
        variance = spread * factor * factor + phase * phase
        if some[i, HEIGHT] < highest[v]:
            # A weaker peak that stands in light may be that light's alone.
            told = glow or halos[v]
        else:
            # By more than its sigma, speckle included; a halo alike on both sides moves nothing.
            told = moved * moved > max(variance, scatter[v])
            if told:
                table[4, v, j] = shift[1, v] * some[i, WIDTH]
        flags |= HALO * told
        table[0, v, j] = position
        table[1, v, j] = math.sqrt(variance)
        table[2, v, j] = amplitude
        table[3, v, j] = math.sqrt(some[i, SECOND])
        ends = left, right
        level = some[i, PEDESTAL] + terms.base
        table[5, v, j] = skew_of(
            lit, dark, (v, w), some[i, CENTRE] + left, table[3, v, j], ends, level
        )
        bits[v, j] = flags


@njit(cache=True, nogil=True, error_model="numpy")
def list_peaks(
    lit: Image, roi: Region, terms: Terms, peaks: Floats, counts: Longs, wanted: int
) -> Listed:
    """From the peaks of all lines to the list of candidates."""
    usual, brightest, flat = usual_peak(lit, roi[1], peaks, counts)
    room = counts.sum()
    some = np.zeros((room + 1, COLUMNS))
    stops = np.empty(room, np.int64)
    expected = terms.width if terms.width > 0.0 else usual
    n, total = list_candidates(roi, terms, peaks, counts, expected, wanted, some, stops)
    saturation = terms.saturation
    if saturation <= 0.0:
        saturation = learned_saturation(lit, brightest, flat)
    return Listed(some, stops, n, total, saturation)


@njit(cache=True, nogil=True, error_model="numpy")
def measure_candidates(
    lit: Image, dark: Image, roi: Region, terms: Terms, listed: Listed, table: Floats, bits: Flags
) -> None:
    """Measure what `list_peaks` listed and write it down."""
    some, stops, n, total, _ = listed
    paired = dark.shape[0] > 1
    light = np.empty(lit.shape[1])
    pool = np.empty((total, 3), np.int64)
    for i in range(n):
        start = stops[i - 1] if i else 0
        v = int(some[i, ROW])
        left = int(some[i, START])
        right = left + stops[i] - start - 2
        accumulate(lit, dark, v, v if paired else 0, left, right, pool, start)
    if terms.width > 0.0:
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
    tails(some, n, pool, stops)
    write_down(lit, dark, roi, terms, listed, light, table, bits)
    drop_glow(table, bits)


@njit(cache=True, nogil=True, error_model="numpy")
def detect_lines(
    lit: Image, dark: Image, roi: Region, terms: Terms, table: Floats, bits: Flags
) -> None:
    """Fill ``table`` (6, H, K: position, sigma, amplitude, width, halo, skew) and ``bits`` (H, K).

    Both come filled with NaN and zeros.
    """
    _, v0, _, v1 = roi
    peaks = np.empty(((v1 - v0) * PEAKS, PEAK_COLUMNS))
    counts = np.zeros(v1 - v0, np.int64)
    first_pass(lit, dark, roi, terms, peaks, counts)
    listed = list_peaks(lit, roi, terms, peaks, counts, table.shape[2])
    measure_candidates(lit, dark, roi, terms, listed, table, bits)
