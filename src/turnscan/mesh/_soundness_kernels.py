"""Compiled kernels of what is not sound about a mesh; imported only when they are used."""

from __future__ import annotations

import numpy as np

from turnscan.arrays import Bools, Floats, Ints, Longs, Singles
from turnscan.compiled import njit

_FULL = 0.5
"""Share of a table's places that are taken at most."""


@njit(cache=True, nogil=True)
def without_area(points: Floats, faces: Ints, thin: float) -> Bools:
    """(f,) True where a face's height is less than a share of its longest side."""
    out = np.empty(len(faces), np.bool_)
    for f in range(len(faces)):
        longest, twice = _size(points, faces, f)
        out[f] = twice <= thin * (longest * longest)
    return out


@njit(cache=True, nogil=True)
def thinner(points: Floats, faces: Ints, least: float) -> Bools:
    """(f,) True where a face's height is less than ``least`` mm."""
    out = np.empty(len(faces), np.bool_)
    for f in range(len(faces)):
        longest, twice = _size(points, faces, f)
        out[f] = twice / max(longest, 1e-300) < least
    return out


@njit(cache=True, nogil=True)
def _size(points: Floats, faces: Ints, f: int) -> tuple[float, float]:
    """The longest edge of a face, and twice its area."""
    a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
    ux, uy, uz = (
        points[b, 0] - points[a, 0], points[b, 1] - points[a, 1], points[b, 2] - points[a, 2]
    )  # fmt: skip
    vx, vy, vz = (
        points[c, 0] - points[b, 0], points[c, 1] - points[b, 1], points[c, 2] - points[b, 2]
    )  # fmt: skip
    wx, wy, wz = (
        points[a, 0] - points[c, 0], points[a, 1] - points[c, 1], points[a, 2] - points[c, 2]
    )  # fmt: skip
    longest = max(_length(ux, uy, uz), _length(vx, vy, vz), _length(wx, wy, wz))
    return longest, _length(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx)


@njit(cache=True, nogil=True, inline="always")
def _length(x: float, y: float, z: float) -> float:
    return np.sqrt(x * x + y * y + z * z)  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def again(places: Singles, used: Bools) -> Longs:
    """Numbers of the used places (n, 3) that are equal to one before them, in their order.

    A table of numbers by the hash of the place, with open addressing.
    """
    bits = 4
    while (1 << bits) * _FULL < len(places):
        bits += 1
    table = np.full(1 << bits, -1, np.int32)
    words = places.view(np.int32)
    out = np.empty(len(places), np.int64)
    made = 0
    for i in range(len(places)):
        if not used[i]:
            continue
        mixed = np.int64(0)
        for k in range(3):
            mixed = (mixed ^ np.int64(words[i, k])) * np.int64(0x2545F4914F6CDD1D)
            mixed ^= (mixed >> 29) & 0x7FFFFFFFF
        at = mixed & ((1 << bits) - 1)
        while table[at] >= 0:
            j = table[at]
            if (
                places[i, 0] == places[j, 0]
                and places[i, 1] == places[j, 1]
                and places[i, 2] == places[j, 2]
            ):
                break
            at = (at + 1) & ((1 << bits) - 1)
        if table[at] >= 0:
            out[made] = i
            made += 1
        else:
            table[at] = i
    return out[:made].copy()
