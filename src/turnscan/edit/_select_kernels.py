"""Compiled kernels of the selections; imported only when they are used."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bools, Floats, Ints
from turnscan.compiled import njit


@njit(cache=True, nogil=True)
def flood(chosen: Bools, beside: Ints, normals: Floats, cosine: float) -> Bools:
    """Faces (f,) reached from the chosen ones across sides whose faces turn by less than a limit.

    ``beside`` (f, 3) is the face across each side or −1, ``normals`` (f, 3) are unit, NaN for a
    face without area, which stops nothing.
    """
    out = chosen.copy()
    stack = np.empty(len(chosen), dtype=np.int32)
    n = 0
    for face in range(len(chosen)):
        if chosen[face]:
            stack[n] = face
            n += 1
    while n > 0:
        n -= 1
        face = stack[n]
        for side in range(3):
            other = beside[face, side]
            if other < 0 or out[other]:
                continue
            turn = 0.0
            for axis in range(3):
                turn += normals[face, axis] * normals[other, axis]
            if turn < cosine:  # never so for NaN
                continue
            out[other] = True
            stack[n] = other
            n += 1
    return out
