"""One candidate → its centre, by any strategy but the window; ``light`` is a buffer of one line."""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import math

import numpy as np

from turnscan.arrays import Floats, Image
from turnscan.compiled import njit

WINDOW, MAXIMUM, CENTROID, MEDIAN, PARABOLA, GAUSS3, SQUARED, BLAIS_RIOUX = range(8)

# How much noisier than the window each strategy is, and its error from the phase of the pixels
# (px), so that the claimed sigma stays honest (docs/explain/stripes.md has the measured figures).
NOISE_FACTOR = (1.0, 4.0, 1.25, 1.45, 3.5, 3.5, 1.4, 1.4)
PHASE_ERROR = (0.001, 0.29, 0.055, 0.04, 0.08, 0.06, 0.02, 0.012)
NARROW_PHASE, NARROW_MEDIAN, NARROW = 0.004, 0.03, 0.75
"""px by which the phase moves window and median on stripes of this width (rms px) or less; it falls
with the fourth power of the width."""


@njit(cache=True, nogil=True, error_model="numpy")
def fill(
    light: Floats, lit: Image, dark: Image, v: int, w: int, base: float, first: int, stop: int
) -> None:
    """Put the light of the pixels first … stop-1 of a line into the buffer."""
    for x in range(first, stop):
        light[x] = np.float64(np.int64(lit[v, x]) - np.int64(dark[w, x])) - base


@njit(cache=True, nogil=True, error_model="numpy")
def run_above(light: Floats, seed: int, left: int, right: int, threshold: float) -> tuple[int, int]:
    """First and last pixel above the threshold around the seed, within the candidate."""
    first = seed
    while first > left and light[first - 1] > threshold:
        first -= 1
    last = seed
    while last < right and light[last + 1] > threshold:
        last += 1
    return first, last


@njit(cache=True, nogil=True, error_model="numpy")
def weighted(light: Floats, first: int, last: int, power: int) -> float:
    """Centre of gravity of the light, or of its square, over a run."""
    total = 0.0
    moment = 0.0
    for x in range(first, last + 1):
        q = light[x] if power == 1 else light[x] * max(light[x], 0.0)
        total += q
        moment += q * x
    return moment / total


@njit(cache=True, nogil=True, error_model="numpy")
def energy_median(light: Floats, first: int, last: int) -> float:
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


@njit(cache=True, nogil=True, error_model="numpy")
def three_point(light: Floats, seed: float, left: int, right: int, logarithm: bool) -> float:
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


@njit(cache=True, nogil=True, error_model="numpy")
def blais_rioux(light: Floats, seed: float, half: float, left: int, right: int) -> float:
    """Zero crossing, nearest to the seed, of the pixels ahead minus as many behind.

    Four on each side, as in Blais & Rioux 1986, or more on a stripe so wide (``half``, rms px) that
    four would see nothing but its flat top.
    """
    arm = max(4, int(1.2 * half) + 1)
    best = seed
    distance = arm + 0.0
    before = 0.0
    for x in range(max(left + arm, int(seed) - arm - 1), min(right - arm, int(seed) + arm + 2) + 1):
        f = 0.0
        for k in range(1, arm + 1):
            f += light[x + k] - light[x - k]
        if before > 0.0 >= f:
            crossing = x - 1 + before / (before - f)
            if abs(crossing - seed) < distance:
                best = crossing
                distance = abs(crossing - seed)
        before = f
    return best


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def phase_error(strategy: int, width: float, cut: float) -> float:
    """Error of a strategy from the phase of the pixels, px, on a stripe of this width, rms px.

    ``cut`` is the threshold as a share of the stripe's height: what it cuts off moves those that
    look at a run above it.
    """
    phase = PHASE_ERROR[strategy]
    if strategy in (CENTROID, MEDIAN):
        phase = PHASE_ERROR[WINDOW] + phase * min(1.0, cut / 0.2)
    narrow = NARROW_MEDIAN if strategy == MEDIAN else NARROW_PHASE
    return max(phase, narrow * min(1.0, (NARROW / width) ** 4))


@njit(cache=True, nogil=True, error_model="numpy")
def by_strategy(
    light: Floats, strategy: int, seed: float, half: float, left: int, right: int, threshold: float
) -> float:
    """Centre by any strategy but the window; ``seed`` is the middle of the highest plateau.

    ``half`` is the rms width that belongs to the width at half height, px.
    """
    if strategy == MAXIMUM:
        return seed
    if strategy == PARABOLA:
        return three_point(light, seed, left, right, False)
    if strategy == GAUSS3:
        return three_point(light, seed, left, right, True)
    if strategy == BLAIS_RIOUX:
        return blais_rioux(light, seed, half, left, right)
    first, last = run_above(light, int(seed), left, right, threshold)
    if strategy == MEDIAN:
        return energy_median(light, first, last)
    return weighted(light, first, last, 2 if strategy == SQUARED else 1)
