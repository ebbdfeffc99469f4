"""Compiled kernel of the merge in angle and height; imported only when it is used."""
# mypy: disable-error-code="untyped-decorator"

from __future__ import annotations

from typing import Any

import numpy as np

from turnscan.compiled import njit


@njit(cache=True, nogil=True)
def raster(
    around: Any,
    points: Any,
    faces: Any,
    weight: Any,
    sigma: Any,
    bottom: float,
    rise: float,
    alike: float,
    radius: Any,
    strength: Any,
    spread: Any,
    source: Any,
) -> tuple[int, int]:
    """Radius of a mesh in every cell of angle and height: fills four (s, n) arrays.

    ``around`` (v,) are the vertices' angles in cells. Where a cell is met twice the stronger face
    counts. Gives how many cells were met, and how often at a radius more than ``alike`` mm away.
    """
    s, n = radius.shape
    met, clashes = 0, 0
    away = np.hypot(points[:, 0], points[:, 1])
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        xa, xb, xc = around[a], around[b], around[c]
        # The face lies where its corners are nearest to the first, across the seam too.
        xb -= s * np.round((xb - xa) / s)
        xc -= s * np.round((xc - xa) / s)
        za = (points[a, 2] - bottom) / rise
        zb = (points[b, 2] - bottom) / rise
        zc = (points[c, 2] - bottom) / rise
        area = (xb - xa) * (zc - za) - (xc - xa) * (zb - za)
        if area == 0.0 or max(xa, xb, xc) - min(xa, xb, xc) > s / 4:
            continue
        ra, rb, rc = away[a], away[b], away[c]
        low = max(0, int(np.ceil(min(za, zb, zc) - 1e-9)))
        high = min(n - 1, int(np.floor(max(za, zb, zc) + 1e-9)))
        for x in range(int(np.ceil(min(xa, xb, xc) - 1e-9)), int(max(xa, xb, xc) + 1e-9) + 1):
            for z in range(low, high + 1):
                u = ((x - xa) * (zc - za) - (xc - xa) * (z - za)) / area
                v = ((xb - xa) * (z - za) - (x - xa) * (zb - za)) / area
                w = 1.0 - u - v
                if u < -1e-6 or v < -1e-6 or w < -1e-6:
                    continue
                k = x % s
                r = w * ra + u * rb + v * rc
                strong = w * weight[a] + u * weight[b] + v * weight[c]
                if np.isnan(radius[k, z]):
                    met += 1
                else:
                    if abs(r - radius[k, z]) > alike:
                        clashes += 1
                    if strong <= strength[k, z]:
                        continue
                radius[k, z] = r
                strength[k, z] = strong
                spread[k, z] = w * sigma[a] + u * sigma[b] + v * sigma[c]
                source[k, z] = a if w >= u and w >= v else (b if u >= v else c)
    return met, clashes
