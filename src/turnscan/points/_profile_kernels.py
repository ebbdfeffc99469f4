"""Compiled kernels of the profiles' resampling; imported only when they are used."""
# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

from typing import Any

import numpy as np

from turnscan.compiled import njit


@njit(cache=True, nogil=True)
def place_heights(
    points: Any, runs: Any, found: Any, spacing: float, low: int, count: int
) -> tuple[Any, Any]:
    """For every profile and height (low + i)·spacing: the line that ends its segment, and where.

    ``runs`` (s, n) is True where an unbroken run leads from the line before to this one. Gives
    ``at`` (s, count), −1 where no segment passes, and the fraction ``part`` of the way.
    """
    s, n, _ = points.shape
    at = np.full((s, count), -1, dtype=np.int32)
    part = np.full((s, count), np.nan)
    for k in range(s):
        for j in range(n):
            if not found[k, j]:
                continue
            z1 = points[k, j, 2]
            z0 = points[k, j - 1, 2] if runs[k, j] else z1
            first = int(np.ceil(min(z0, z1) / spacing))
            last = int(np.floor(max(z0, z1) / spacing))
            for h in range(first, last + 1):
                i = h - low
                if 0 <= i < count and at[k, i] < 0:
                    at[k, i] = j
                    part[k, i] = (h * spacing - z0) / (z1 - z0) if z1 != z0 else 1.0
    return at, part


@njit(cache=True, nogil=True)
def place_arcs(points: Any, runs: Any, found: Any, spacing: float, count: int) -> tuple[Any, Any]:
    """The same at equal arc length along each unbroken run, the first point at its beginning."""
    s, n, _ = points.shape
    at = np.full((s, count), -1, dtype=np.int32)
    part = np.full((s, count), np.nan)
    for k in range(s):
        done = 0.0
        new = 0
        for j in range(n):
            if not found[k, j] or new >= count:
                continue
            if not runs[k, j]:
                at[k, new], part[k, new] = j, 1.0
                new += 1
                done = 0.0
                continue
            d = points[k, j] - points[k, j - 1]
            length = np.sqrt((d * d).sum())
            ahead = spacing - done
            while ahead <= length and new < count:
                at[k, new], part[k, new] = j, ahead / length
                new += 1
                ahead += spacing
            done = spacing - (ahead - length)
    return at, part
