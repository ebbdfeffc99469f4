"""Compiled kernel of packed pixels; imported only when it is used."""
# mypy: disable-error-code="no-any-return"

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bytes
from turnscan.compiled import njit


@njit(cache=True, nogil=True)
def running_sums(steps: Bytes) -> Bytes:
    """(n,) the sum of each of the ``steps`` (n,) and all before it, modulo 256."""
    out = np.empty(len(steps), np.uint8)
    total = np.uint64(0)
    for k in range(len(steps)):
        total += np.uint64(steps[k])
        out[k] = np.uint8(total & np.uint64(255))
    return out
