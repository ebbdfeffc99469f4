# mypy: disable-error-code="no-any-return"
"""The exponential function from a table, for kernels that work out many at once.

The library's own is called for one number at a time. It imports numba; import it inside functions.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from turnscan.arrays import Floats, frozen
from turnscan.compiled import njit

MOST = 16.0
"""Largest exponent."""
_STEPS = 64


@cache
def powers_of_e() -> Floats:
    """exp(−i/64) for exponents from 0 to 16."""
    powers = np.exp(-np.arange(MOST * _STEPS + 1) / _STEPS)
    return frozen(powers, (None,), "powers of e")


@njit(cache=True, nogil=True, inline="always", error_model="numpy")
def faded(exponent: float, powers: Floats) -> float:
    """exp(−exponent) for exponents from 0 to 16, right to the last digits."""
    i = int(exponent * _STEPS)
    r = i * (1.0 / _STEPS) - exponent
    tail = r * (1.0 / 24 + r * (1.0 / 120 + r * (1.0 / 720)))
    return powers[i] * (1.0 + r * (1.0 + r * (0.5 + r * (1.0 / 6 + tail))))
