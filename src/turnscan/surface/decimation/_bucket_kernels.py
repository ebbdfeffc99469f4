"""Compiled kernels of a queue of vertices by what they cost: nearly the least first, near by first.

By cost alone, each vertex would be far from the one before, and memory be waited for. So the
regions of the mesh take turns, four from a cost to its double, and within a turn the vertices of a
region wait in four buckets. Who came first into a bucket leaves first. Each waits in one bucket,
and whoever takes it out asks again what it costs: more, mostly; who got a new neighbour may wait
longer than it need.
"""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Ints
from turnscan.compiled import njit
from turnscan.surface.decimation._net_kernels import FOLLOW, WAITS

_REGION = 11
"""Vertices in a region, as a power of two: with their faces they fit into a cache."""
_TURNS, _FINE = 2, 2
"""Turns of the regions from 2^k to 2^(k+1), and buckets of a region in each, as powers of two."""
_MANTISSA, _BIAS = 52, 1023
"""Bits of a number, and what is added to its power of two."""
_LOW, _HIGH = -70, 50
"""Powers of two; what costs less or more waits with those, in a mesh that reaches `_USUAL`."""
_USUAL, _DEGREE = 32.0, 4
"""mm, and the power of the size of a mesh by which all its costs grow."""
LEAST, SIZE, REGIONS, FROM = 0, 1, 2, 3
"""Of the state of a queue: a bucket below which none waits, how many wait, the regions, and the
bits of the least cost."""


@njit(cache=True, nogil=True)
def empty(vertices: int, reach: float) -> tuple[Ints, Ints]:
    """Of each bucket who leaves next and who came last, (2, buckets), −1 for none; the state.

    ``reach`` mm is how far the mesh goes from its middle.
    """
    regions = (vertices >> _REGION) + 1
    buckets = ((_HIGH - _LOW) << (_TURNS + _FINE)) * regions
    larger = int(np.floor(np.log2(reach / _USUAL))) if reach > 0.0 else 0
    least = max(_BIAS + _LOW + _DEGREE * larger, 0) << _MANTISSA
    return np.full((2, buckets), -1, dtype=np.int32), np.array([buckets, 0, regions, least])


@njit(cache=True, nogil=True, forceinline=True)
def bucket(state: Ints, v: int, cost: float) -> int:
    """Where v waits that costs so much, ≥ 0."""
    # Numbers that are not negative stand in the order of their bits.
    bits = np.float64(cost).view(np.int64) - state[FROM]
    bits = max(min(bits, (_HIGH - 1 - _LOW) << _MANTISSA), 0)
    turn = bits >> (_MANTISSA - _TURNS)
    fine = (bits >> (_MANTISSA - _TURNS - _FINE)) & ((1 << _FINE) - 1)
    return ((turn * state[REGIONS] + (v >> _REGION)) << _FINE) + fine  # type: ignore[no-any-return]


@njit(cache=True, nogil=True, forceinline=True)
def put(ends: Ints, state: Ints, ids: Ints, v: int, at: int) -> None:
    """Let v, which does not wait, wait in a bucket."""
    if ends[0, at] < 0:
        ends[0, at] = v
    else:
        ids[ends[1, at], FOLLOW] = v
    ends[1, at] = v
    ids[v, FOLLOW], ids[v, WAITS] = -1, 1
    state[LEAST] = min(state[LEAST], at)
    state[SIZE] += 1


@njit(cache=True, nogil=True, forceinline=True)
def take(ends: Ints, state: Ints, ids: Ints) -> int:
    """Who leaves next, out of the bucket that is least from now on; one must wait."""
    at = state[LEAST]
    while ends[0, at] < 0:
        at += 1
    v = ends[0, at]
    ends[0, at], ids[v, WAITS] = ids[v, FOLLOW], 0
    state[LEAST] = at
    state[SIZE] -= 1
    return v  # type: ignore[no-any-return]
