"""One candidate → its centre, width, amplitude and uncertainty: the kernels of the strategies.

``light`` and ``variance`` are buffers of one line, filled for lo ≤ x < hi; ``left`` and ``right``
are the outermost pixels that belong to the candidate (the valleys towards its neighbours).
"""
# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

import math
from typing import Any

from numba import njit

WINDOW, MAXIMUM, CENTROID, MEDIAN, PARABOLA, GAUSS3, SQUARED, BLAIS_RIOUX = range(8)

HALF_WINDOW = 2.5
"""Half window in rms widths (ALGORITHMS: noise and truncation balance near 2.5)."""
TRUNCATION = 0.9113
"""Variance of a Gaussian cut at ±2.5 sigma, in units of sigma²: 1 - 5φ(2.5)/(2Φ(2.5) - 1)."""
ITERATIONS = 6
MIN_HALF_WINDOW = 0.9
"""px: less than this cannot see both sides of a stripe."""
SETTLED = 1e-4
"""px: the window stops moving here."""

# How much noisier than the window each strategy is, and its error from the phase of the pixels
# (px), so that the claimed sigma stays honest (docs/explain/stripes.md has the measured figures).
NOISE_FACTOR = (1.0, 4.0, 1.25, 1.45, 3.5, 3.5, 1.4, 1.4)
PHASE_ERROR = (0.005, 0.29, 0.055, 0.04, 0.08, 0.06, 0.02, 0.012)


@njit(cache=True, nogil=True)
def plateau(light: Any, left: int, right: int) -> Any:
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


@njit(cache=True, nogil=True)
def half_width(light: Any, seed: float, top: float, left: int, right: int) -> Any:
    """Both places where the light falls to half, above the lower of the two ends."""
    floor = max(0.0, min(light[left], light[right]))
    level = floor + 0.5 * (top - floor)
    x = int(math.floor(seed))
    while x > left and light[x - 1] >= level:
        x -= 1
    low = x - 0.5
    if x > left:
        step = light[x] - light[x - 1]
        low = x - (light[x] - level) / step if step > 0.0 else x - 0.5
    x = int(math.ceil(seed))
    while x < right and light[x + 1] >= level:
        x += 1
    high = x + 0.5
    if x < right:
        step = light[x] - light[x + 1]
        high = x + (light[x] - level) / step if step > 0.0 else x + 0.5
    return low, high


@njit(cache=True, nogil=True)
def flank(light: Any, edge: int, step: int, count: int, last: int) -> float:
    """Mean of up to ``count`` pixels from ``edge`` outwards, not beyond ``last``."""
    total = 0.0
    n = 0
    x = edge
    while n < count and (last - x) * step >= 0:
        total += light[x]
        n += 1
        x += step
    if n == 0:
        return float(light[last])
    return total / n


@njit(cache=True, nogil=True)
def window_sums(
    light: Any,
    first: int,
    last: int,
    c: float,
    h: float,
    pedestal: float,
    slope: float,
    pivot: float,
) -> Any:
    """Moments 0 to 3 about ``c`` of the light above the background in the window c ± h.

    The end pixels count with the part of them that the window covers.
    """
    s0 = s1 = s2 = s3 = 0.0
    for x in range(first, last + 1):
        part = min(1.0, c + h + 0.5 - x, x + 0.5 - c + h)
        e = x - c
        q = part * (light[x] - pedestal - slope * (x - pivot))
        s0 += q
        s1 += q * e
        s2 += q * e * e
        s3 += q * e * e * e
    return s0, s1, s2, s3


@njit(cache=True, nogil=True)
def measure_window(
    light: Any,
    variance: Any,
    left: int,
    right: int,
    centre: float,
    width: float,
    fixed: bool,
    noise: float,
) -> Any:
    """Centre of gravity in the symmetric window that follows the centre.

    The background is the line through the means of the flanks; its slope counts only where the
    flanks differ by more than the noise explains, so that a clean stripe pays nothing for it.
    ``fixed`` keeps ``width``; otherwise it is measured along with the centre.

    Returns centre, width, variance of the centre, pedestal, skewness, and whether the window was
    cut by the ends of the candidate.
    """
    c = centre
    s = width
    s0 = s1 = s2 = s3 = 0.0
    pedestal = slope = 0.0
    pivot = c
    h = 0.0
    first = last = 0
    cut = False
    for turn in range(ITERATIONS):
        room = min(c - left, right - c) + 0.5
        h = HALF_WINDOW * s
        cut = h > room
        h = max(MIN_HALF_WINDOW, min(h, room))
        first = max(left, int(math.floor(c - h + 0.5)))
        last = min(right, int(math.ceil(c + h - 0.5)))
        if turn < 3:
            count = 3 + int(s)
            below = flank(light, first - 2, -1, count, left)
            above = flank(light, last + 2, 1, count, right)
            pedestal = 0.5 * (below + above)
            slope = 0.0
            if abs(above - below) > 4.0 * noise * math.sqrt(2.0 / count):
                slope = (above - below) / (last - first + 3 + count)
            pivot = c
        s0, s1, s2, s3 = window_sums(light, first, last, c, h, pedestal, slope, pivot)
        if s0 <= 0.0:
            return c, s, 1.0e6, pedestal, 0.0, cut
        shift = min(max(s1 / s0, -h), h)
        if not fixed:
            second = max(s2 / s0 - shift * shift, 0.09)
            s = min(max(math.sqrt(second / TRUNCATION), 0.6 * s), 1.6 * s)
        c = min(max(c + shift, left - 0.5), right + 0.5)
        if turn > 2 and abs(shift) < SETTLED:
            break
    total = 0.0
    for x in range(first, last + 1):
        e = min(1.0, c + h + 0.5 - x, x + 0.5 - c + h) * (x - c)
        total += e * e * variance[x]
    # The window follows its own centre, which amplifies the noise: 1/(1 - light at its ends).
    ends = h * (light[first] + light[last] - 2.0 * pedestal) / s0
    gain = s0 * (1.0 - min(max(ends, 0.0), 0.5))
    second = max(s2 / s0, 1e-3)
    skew = s3 / (s0 * second * math.sqrt(second))
    return c, s, total / (gain * gain), pedestal, skew, cut


@njit(cache=True, nogil=True)
def run_above(light: Any, seed: int, left: int, right: int, threshold: float) -> Any:
    """First and last pixel above the threshold around the seed, within the candidate."""
    first = seed
    while first > left and light[first - 1] > threshold:
        first -= 1
    last = seed
    while last < right and light[last + 1] > threshold:
        last += 1
    return first, last


@njit(cache=True, nogil=True)
def weighted(light: Any, first: int, last: int, power: int) -> float:
    """Centre of gravity of the light, or of its square, over a run."""
    total = 0.0
    moment = 0.0
    for x in range(first, last + 1):
        q = light[x] if power == 1 else light[x] * max(light[x], 0.0)
        total += q
        moment += q * x
    return moment / total


@njit(cache=True, nogil=True)
def energy_median(light: Any, first: int, last: int) -> float:
    """The point with half the light on each side, the light spread evenly over each pixel."""
    total = 0.0
    for x in range(first, last + 1):
        total += light[x]
    passed = 0.0
    for x in range(first, last + 1):
        if passed + light[x] >= 0.5 * total:
            return x - 0.5 + (0.5 * total - passed) / light[x]
        passed += light[x]
    return float(last)


@njit(cache=True, nogil=True)
def three_point(light: Any, seed: float, left: int, right: int, logarithm: bool) -> float:
    """Vertex of the parabola through three pixels, or through their logarithms (a Gaussian)."""
    x = int(seed)
    if x != seed or x <= left or x >= right:
        return seed
    a, b, d = light[x - 1], light[x], light[x + 1]
    if logarithm:
        if min(a, b, d) <= 0.0:
            return seed
        a, b, d = math.log(a), math.log(b), math.log(d)
    bend = a - 2.0 * b + d
    if bend >= 0.0:
        return seed
    return seed + 0.5 * (a - d) / bend


@njit(cache=True, nogil=True)
def blais_rioux(light: Any, seed: float, left: int, right: int) -> float:
    """Zero crossing, nearest to the seed, of four pixels ahead minus four behind."""
    best = seed
    distance = 4.0
    before = 0.0
    for x in range(max(left + 4, int(seed) - 5), min(right - 4, int(seed) + 6) + 1):
        f = 0.0
        for k in range(1, 5):
            f += light[x + k] - light[x - k]
        if before > 0.0 >= f:
            crossing = x - 1 + before / (before - f)
            if abs(crossing - seed) < distance:
                best = crossing
                distance = abs(crossing - seed)
        before = f
    return best


@njit(cache=True, nogil=True)
def by_strategy(
    light: Any, strategy: int, seed: float, left: int, right: int, threshold: float
) -> float:
    """Centre by any strategy but the window; ``seed`` is the middle of the highest plateau."""
    if strategy == MAXIMUM:
        return seed
    if strategy == PARABOLA:
        return three_point(light, seed, left, right, False)
    if strategy == GAUSS3:
        return three_point(light, seed, left, right, True)
    if strategy == BLAIS_RIOUX:
        return blais_rioux(light, seed, left, right)
    first, last = run_above(light, int(seed), left, right, threshold)
    if strategy == MEDIAN:
        return energy_median(light, first, last)
    return weighted(light, first, last, 2 if strategy == SQUARED else 1)
