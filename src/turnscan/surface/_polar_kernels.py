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
    cosine: Any,
    sigma: Any,
    between: Any,
    step: Any,
    columns: Any,
    bottom: float,
    rise: float,
    alike: float,
    radius: Any,
    strength: Any,
    noise: Any,
    spread: Any,
    source: Any,
) -> tuple[int, int]:
    """Radius of a mesh in every cell of angle and height: fills five (s, n) arrays.

    ``around`` (v,) are the vertices' angles and ``columns`` (s,) those of the cells, both in turns,
    from 0 to 1, the columns ascending. ``noise`` is what the sigma of a face's corners makes of it,
    ``spread`` that and what the surface may do ``between`` (v,) its profiles, none of it on them
    and all half-way. Where a cell is met twice the stronger face (cosine / spread²) counts. Gives
    how many cells were met, and how often at a radius more than ``alike`` mm away.
    """
    s, n = radius.shape
    met, clashes = 0, 0
    away = np.hypot(points[:, 0], points[:, 1])
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        xa, xb, xc = around[a], around[b], around[c]
        # The face lies where its corners are nearest to the first, across the seam too.
        xb -= np.round(xb - xa)
        xc -= np.round(xc - xa)
        za = (points[a, 2] - bottom) / rise
        zb = (points[b, 2] - bottom) / rise
        zc = (points[c, 2] - bottom) / rise
        area = (xb - xa) * (zc - za) - (xc - xa) * (zb - za)
        left, right = min(xa, xb, xc), max(xa, xb, xc)
        if area == 0.0 or right - left > 0.25:
            continue
        ra, rb, rc = away[a], away[b], away[c]
        low = max(0, int(np.ceil(min(za, zb, zc) - 1e-9)))
        high = min(n - 1, int(np.floor(max(za, zb, zc) + 1e-9)))
        gap = max(between[a], between[b], between[c])
        whole = np.floor(left - 1e-9)
        k = np.searchsorted(columns, left - 1e-9 - whole)
        while True:
            if k == s:
                k, whole = 0, whole + 1.0
            x = columns[k] + whole
            if x > right + 1e-9:
                break
            for z in range(low, high + 1):
                u = ((x - xa) * (zc - za) - (xc - xa) * (z - za)) / area
                v = ((xb - xa) * (z - za) - (x - xa) * (zb - za)) / area
                w = 1.0 - u - v
                if u < -1e-6 or v < -1e-6 or w < -1e-6:
                    continue
                r = w * ra + u * rb + v * rc
                part = w + (u if step[b] == step[a] else 0.0) + (v if step[c] == step[a] else 0.0)
                own = (w * sigma[a]) ** 2 + (u * sigma[b]) ** 2 + (v * sigma[c]) ** 2
                wide = own + (4.0 * part * (1.0 - part) * gap) ** 2
                strong = (w * cosine[a] + u * cosine[b] + v * cosine[c]) / max(wide, 1e-12)
                if np.isnan(radius[k, z]):
                    met += 1
                else:
                    if abs(r - radius[k, z]) > alike:
                        clashes += 1
                    if strong <= strength[k, z]:
                        continue
                radius[k, z] = r
                strength[k, z] = strong
                noise[k, z] = np.sqrt(own)
                spread[k, z] = np.sqrt(wide)
                source[k, z] = a if w >= u and w >= v else (b if u >= v else c)
            k += 1
    return met, clashes
