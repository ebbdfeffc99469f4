"""Counter-based random numbers: a draw is a hash of (seed, counter), never of what came before.

So a picture is a function of its seed alone, whatever the order or the number of threads.
This module imports numba; import it inside functions only.
"""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import math
from functools import cache, lru_cache

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, frozen
from turnscan.compiled import njit

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S32 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(32)
_LOW = np.uint64(0xFFFFFFFF)
_ONE = np.uint64(1)

_BINS = 8192
_TAIL_FROM = 7  # the tail table begins at probability 2**-7
_TAIL_TO = 34
_TAIL_STEPS = 16  # table steps per factor 2 in probability


@njit(cache=True, nogil=True, inline="always")
def mix(seed: np.uint64, counter: np.uint64) -> np.uint64:
    """64 random bits for this seed and counter (finaliser of SplitMix64, Steele 2014)."""
    z = seed + (counter + _ONE) * _GOLDEN
    z = (z ^ (z >> _S30)) * _MIX_1
    z = (z ^ (z >> _S27)) * _MIX_2
    return z ^ (z >> _S31)


@njit(cache=True, nogil=True, inline="always")
def uniform_pair(bits: np.uint64) -> tuple[float, float]:
    """Two numbers in (0, 1), 32 bits each, from 64 random bits."""
    low = (float(bits & _LOW) + 0.5) * (1.0 / 4294967296.0)
    high = (float(bits >> _S32) + 0.5) * (1.0 / 4294967296.0)
    return low, high


@njit(cache=True, nogil=True, inline="always")
def normal(u: float, centre: Floats, tail: Floats) -> float:
    """The standard normal quantile of u in (0, 1), from the tables of `normal_tables`."""
    if u < 1.0 / 128.0 or u > 127.0 / 128.0:
        t = (-math.log2(min(u, 1.0 - u)) - 7.0) * 16.0
        i = min(int(t), len(tail) - 2)
        z = tail[i] + (t - i) * (tail[i + 1] - tail[i])
        return z if u < 0.5 else -z
    t = u * 8192.0
    i = int(t)
    return centre[i] + (t - i) * (centre[i + 1] - centre[i])


@cache
def normal_tables() -> tuple[Floats, Floats]:
    """Normal quantiles at i/8192, and at 2**-(7 + i/16) for the tail."""
    from scipy.special import ndtri

    p = np.clip(np.arange(_BINS + 1) / _BINS, 1.0 / _BINS, 1.0 - 1.0 / _BINS)
    steps = np.arange((_TAIL_TO - _TAIL_FROM) * _TAIL_STEPS)
    return (
        frozen(ndtri(p), (None,), "normal quantiles"),
        frozen(ndtri(np.exp2(-_TAIL_FROM - steps / _TAIL_STEPS)), (None,), "normal tail"),
    )


@cache
def phasor_table() -> npt.NDArray[np.complex64]:
    """(65536,) circular complex Gaussian numbers of mean 0 and mean power exactly 1."""
    rng = np.random.default_rng(20140)
    # Stratified exponential powers: the table's own moments are those of the distribution.
    power = -np.log((np.arange(65536) + 0.5) / 65536)
    rng.shuffle(power)
    turn = (np.arange(65536) + 0.5) / 65536
    table = np.sqrt(power / power.mean()) * np.exp(2j * np.pi * turn)
    table = (table - table.mean()).astype(np.complex64)
    table.flags.writeable = False
    return table


@lru_cache(maxsize=64)
def seed64(*parts: int) -> np.uint64:
    """One 64-bit seed from whole numbers of any size and sign."""
    word = np.random.SeedSequence([part % 2**64 for part in parts]).generate_state(1, np.uint64)
    return np.uint64(word[0])
