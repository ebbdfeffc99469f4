"""Compiled kernels: a running median, and stripes on print. Import them inside functions."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Ints
from turnscan.compiled import njit

Words = npt.NDArray[np.uint16]

_REACH = 2.5
"""Standard deviations of a stripe's profile that are fitted, to each side, and two pixels."""
_NARROW, _WIDE = 1.0, 12.0
"""px rms: a stripe that is thinner or wider than this is fitted from here."""
_OTHER_WIDTH = 2.0
"""By which factor the fitted width may differ from the one that was found."""
_AWAY = 2.0
"""Widths from where it was found: farther away something else was fitted."""
_LIT = 4.0
"""Grey levels of the print, in the mean, without which nothing is known of it."""
_GRAIN = 0.5
"""Grey levels² of variance per grey level of laser light: shot noise and speckle."""
_ROUNDS, _STILL = 12, 1e-3
_LEAST_PIXELS = 5
_SINGULAR = 1e-9


@njit(cache=True, nogil=True)
def running_median(lines: Words, window: int) -> Words:
    """Median of ``window`` (odd) neighbours along the last axis of (n, m); the ends are repeated.

    The window is kept sorted: one value leaves and one enters at every place.
    """
    n, m = lines.shape
    half = window // 2
    out = np.empty_like(lines)
    held = np.empty(window, np.uint16)
    for i in range(n):
        for k in range(window):
            value = lines[i, min(max(k - half, 0), m - 1)]
            at = k
            while at > 0 and held[at - 1] > value:
                held[at] = held[at - 1]
                at -= 1
            held[at] = value
        out[i, 0] = held[half]
        for j in range(1, m):
            gone = lines[i, max(j - 1 - half, 0)]
            value = lines[i, min(j + half, m - 1)]
            if gone != value:
                at = 0
                while held[at] != gone:
                    at += 1
                while at < window - 1 and held[at + 1] < value:
                    held[at] = held[at + 1]
                    at += 1
                while at > 0 and held[at - 1] > value:
                    held[at] = held[at - 1]
                    at -= 1
                held[at] = value
            out[i, j] = held[half]
    return out


@njit(cache=True, nogil=True)
def stripes_on_print(
    lit: Words, dark: Words, line: Ints, across: Floats, width: Floats, level: float, top: float
) -> Floats:
    """Where stripes lie that cross a print, and how wide they are: (2, n) px and px rms along a
    line.

    ``lit`` and ``dark`` (lines, columns) are the pictures with the laser and without, ``line`` (n,)
    and ``across`` (n,) px where stripes were found, ``width`` (n,) px rms; ``level`` is one grey
    level of 256, and pixels from ``top`` are clipped. The profile a · dark · exp(-(u - c)² / 2 w²)
    is fitted to lit - dark. Where pixels are clipped, where the print is dark or the fit goes
    astray, a stripe stays where it was found.
    """
    columns = lit.shape[1]
    out = np.empty((2, len(across)))
    for i in range(len(across)):
        out[0, i], out[1, i] = across[i], width[i]
        if not width[i] > 0.0:
            continue
        found = min(max(width[i], _NARROW), _WIDE)
        reach = math.ceil(_REACH * found) + 2
        first = max(int(across[i]) - reach, 0)
        last = min(int(across[i]) + reach + 1, columns)
        paper, clipped = 0.0, False
        for u in range(first, last):
            paper += float(dark[line[i], u]) / level
            clipped = clipped or lit[line[i], u] >= top
        if clipped or last - first < _LEAST_PIXELS or paper < _LIT * (last - first):
            continue
        start = across[i] - first
        seen, ground = lit[line[i], first:last], dark[line[i], first:last]
        place, wide = _profile(seen, ground, start, found, level)
        if abs(place - start) < _AWAY * found:
            out[0, i], out[1, i] = first + place, wide
    return out


@njit(cache=True, nogil=True)
def _profile(
    lit: Words, dark: Words, start: float, found: float, level: float
) -> tuple[float, float]:
    """The place c and width w of a · dark · exp(-(u - c)² / 2 w²) in lit - dark, (n,) along a line.

    By Gauss-Newton in (a, c, w) weighted by the noise of both pictures; ``start`` and ``found``
    where it fails.
    """
    c, w, a = start, found, 0.0
    for turn in range(_ROUNDS):
        haa = hac = haw = hcc = hcw = hww = ga = gc = gw = 0.0
        for u in range(len(lit)):
            ground = float(dark[u]) / level
            t = (u - c) / w
            shape = math.exp(-0.5 * t * t)
            by_a, share = ground * shape, a * shape
            model = a * by_a
            weight = 1.0 / (1.0 + share * share + _GRAIN * max(model, 0.0))
            by_c, by_w = model * t / w, model * t * t / w
            off = float(lit[u]) / level - ground - model
            haa += weight * by_a * by_a
            hac += weight * by_a * by_c
            haw += weight * by_a * by_w
            hcc += weight * by_c * by_c
            hcw += weight * by_c * by_w
            hww += weight * by_w * by_w
            ga += weight * by_a * off
            gc += weight * by_c * off
            gw += weight * by_w * off
        if haa <= 0.0:
            return start, found
        if turn == 0:
            a = ga / haa  # of the profile as it was found; no other term has a slope yet
            continue
        da, dc, dw = _solved(haa, hac, haw, hcc, hcw, hww, ga, gc, gw)
        if not math.isfinite(dc) or a + da <= 0.0:
            return start, found
        a += da
        c += min(max(dc, -0.5 * w), 0.5 * w)
        w = min(max(w + dw, found / _OTHER_WIDTH), found * _OTHER_WIDTH)
        if abs(dc) < _STILL:
            return c, w
    return start, found


@njit(cache=True, nogil=True)
def _solved(
    aa: float, ab: float, ac: float, bb: float, bc: float, cc: float, a: float, b: float, c: float
) -> tuple[float, float, float]:
    """Solution of a symmetric 3 × 3 system by Cholesky; NaN where it has none."""
    p = math.sqrt(aa)
    q, r = ab / p, ac / p
    ss = bb - q * q
    if ss <= _SINGULAR * bb:
        return math.nan, math.nan, math.nan
    s = math.sqrt(ss)
    x = (bc - q * r) / s
    yy = cc - r * r - x * x
    if yy <= _SINGULAR * cc:
        return math.nan, math.nan, math.nan
    first = a / p
    second = (b - q * first) / s
    z3 = (c - r * first - x * second) / yy
    z2 = (second - x * z3) / s
    return (first - q * z2 - r * z3) / p, z2, z3
