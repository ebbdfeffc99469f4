"""Kernels of light that spread beside a stripe, in the material or on its surface."""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import math

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.compiled import njit
from turnscan.stripes._list import CENTRE, FLUX, HEIGHT, MIDDLE, PEDESTAL, ROW, START, WIDTH
from turnscan.stripes._measure import FLANK
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
def haloed(some: Floats, n: int, terms: Terms, lines: int) -> tuple[Floats, Bools, Floats]:
    """(H,) the highest of each line, True where light has spread beside the stripe there, and how
    far that moves its centre, in its widths.

    A grain of speckle in the tail of one line looks like a halo. But grains differ from line to
    line and light that spread in the material does not, so the sums over many lines decide: of the
    pedestal beside the highest candidates, and of how far they lean, weighted by their light.
    """
    sums = np.zeros((lines + 1, 6))
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
            sums[v + 1, 5] = lean * lean * some[i, FLUX]
    for v in range(lines):
        for k in range(6):
            sums[v + 1, k] += sums[v, k]
    out = np.zeros(lines, np.bool_)
    shift = np.zeros(lines)
    part = np.empty(6)
    for v in range(lines):
        a, b = max(0, v - HALO_REACH), min(lines, v + HALO_REACH + 1)
        for k in range(6):
            part[k] = sums[b, k] - sums[a, k]
        noise = 4.0 * terms.noise * math.sqrt(part[4] / (2.0 * FLANK))
        out[v] = part[0] > max(HALO_LIMIT * part[1], noise) or abs(part[2]) > LEAN_LIMIT * part[3]
        flux, count = max(part[3], 1.0), max(part[4], 2.0)
        mean = abs(part[2]) / flux
        # What speckle makes of the mean is no shift: three standard errors are taken off.
        error = math.sqrt(max(part[5] / flux - mean * mean, 0.0) / (count - 1.0))
        shift[v] = max(0.0, mean - 3.0 * error)
    return highest, out, shift
