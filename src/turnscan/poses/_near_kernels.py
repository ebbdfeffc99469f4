"""Compiled kernels: the nearest point of a view, by cubes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Bytes, Floats, Ints, Longs
from turnscan.compiled import njit


class Cubes(NamedTuple):
    """Points of a view, by the cubes that they lie in."""

    points: Floats
    """(n, 3) mm, cube after cube."""
    numbers: Ints
    """(n,) the number of each in the view."""
    starts: Ints
    """(cubes + 1,) the points of cube k are starts[k] to starts[k + 1]."""
    rings: Bytes
    """(cubes,) cubes to the nearest one that holds a point, side by side or over edge or corner."""
    low: Floats
    """(3,) mm: corner of the first cube."""
    side: float
    """mm."""
    shape: tuple[int, int, int]
    """Cubes along x, y and z."""


@njit(cache=True, nogil=True)
def _home(p: float, cubes: int) -> int:
    """The layer that a place ``p`` sides after the first cube lies in."""
    return min(int(p), cubes - 1)


@njit(cache=True, nogil=True)
def _aside(p: float, layer: int) -> float:
    """Squared distance of p from a layer of cubes, both in sides after the first cube."""
    gap = max(layer - p, p - layer - 1.0, 0.0)
    return gap * gap


@njit(cache=True, nogil=True)
def nearest(c: Cubes, places: Floats, reach: float) -> tuple[Floats, Longs]:
    """Distance (m,) mm to the nearest point and its number in the view (m,), of places (m, 3) mm.

    Infinite and -1 where none is nearer than ``reach`` mm. Ring after ring of cubes is searched,
    from the first one that holds a point, as long as the next can hold a nearer one.
    """
    X, Y, Z = c.shape
    points, starts, side = c.points, c.starts, c.side
    scale = 1.0 / side**2
    away, found = np.full(len(places), np.inf), np.full(len(places), -1, np.int64)
    for n in range(len(places)):
        x, y, z = places[n, 0], places[n, 1], places[n, 2]
        # Of a place outside of all cubes the nearest place within has the same bounds: all points
        # lie in them.
        p = min(max((x - c.low[0]) / side, 0.0), float(X))
        q = min(max((y - c.low[1]) / side, 0.0), float(Y))
        s = min(max((z - c.low[2]) / side, 0.0), float(Z))
        i, j, k = _home(p, X), _home(q, Y), _home(s, Z)
        free = min(p - i, i + 1 - p, q - j, j + 1 - q, s - k, k + 1 - s) - 1.0
        best, at = (reach / side) ** 2, -1
        r, last = int(c.rings[(i * Y + j) * Z + k]), max(X, Y, Z)
        while r <= last and (r == 0 or (free + r) ** 2 < best):
            for a in range(max(i - r, 0), min(i + r, X - 1) + 1):
                over = _aside(p, a)
                if over >= best:
                    continue
                for b in range(max(j - r, 0), min(j + r, Y - 1) + 1):
                    if over + _aside(q, b) >= best:
                        continue
                    whole = abs(a - i) == r or abs(b - j) == r  # else its two ends are in the ring
                    row = (a * Y + b) * Z
                    for half in range(1 if whole else 2):
                        first = max(k - r, 0) if whole else k + (2 * half - 1) * r
                        end = min(k + r, Z - 1) if whole else first
                        if first < 0 or end >= Z:
                            continue
                        for m in range(starts[row + first], starts[row + end + 1]):
                            u, v, w = points[m, 0] - x, points[m, 1] - y, points[m, 2] - z
                            square = scale * (u * u + v * v + w * w)
                            if square < best:
                                best, at = square, m
            r += 1
        if at >= 0:
            away[n], found[n] = np.sqrt(best) * side, c.numbers[at]
    return away, found


@njit(cache=True, nogil=True)
def cube_numbers(points: Floats, low: Floats, side: float, shape: tuple[int, int, int]) -> Longs:
    """(n,) the cube that each of the points (n, 3) lies in."""
    out = np.empty(len(points), np.int64)
    for n in range(len(points)):
        i = min(int((points[n, 0] - low[0]) / side), shape[0] - 1)
        j = min(int((points[n, 1] - low[1]) / side), shape[1] - 1)
        k = min(int((points[n, 2] - low[2]) / side), shape[2] - 1)
        out[n] = (i * shape[1] + j) * shape[2] + k
    return out
