"""Compiled kernel of the merge in angle and height; imported only when it is used."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.compiled import njit
from turnscan.surface.fusion._variance_kernels import Vertices, variances


class Cells(NamedTuple):
    """What is known of one surface in each cell (s, n) of angle and height."""

    radius: Floats
    """mm, NaN where the cell was not met."""
    weight: Floats
    """cos(incidence)/spread², 0 where the cell was not met."""
    noise: Floats
    """mm: what the sigma of the vertices makes of the radius."""
    spread: Floats
    """mm: that and what the surface may do between its profiles."""
    source: Ints
    """The nearest vertex, −1 where the cell was not met."""


@njit(cache=True, nogil=True)
def raster(
    vertices: Vertices,
    around: Floats,
    cosine: Floats,
    faces: Ints,
    columns: Floats,
    bottom: float,
    rise: float,
    alike: float,
    cells: Cells,
) -> tuple[int, int]:
    """Fill the ``cells`` with the radius of a mesh at every angle and height.

    ``around`` (v,) are the vertices' angles and ``columns`` (s,) those of the cells, both in turns,
    from 0 to 1, the columns ascending. Where a cell is met twice the face of more weight counts.
    Returns how many cells were met, and how often at a radius more than ``alike`` mm away.
    """
    points, sigma, between, step = vertices
    radius, weight, noise, spread, source = cells
    s, n = radius.shape
    met, clashes = 0, 0
    away = np.hypot(points[:, 0], points[:, 1])
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        xa, xb, xc = around[a], around[b], around[c]
        # The face lies where its vertices are nearest to the first, across the seam too.
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
                own, wide = variances(faces[f], u, v, sigma, between, step)
                strong = (w * cosine[a] + u * cosine[b] + v * cosine[c]) / max(wide, 1e-12)
                if np.isnan(radius[k, z]):
                    met += 1
                else:
                    if abs(r - radius[k, z]) > alike:
                        clashes += 1
                    if strong <= weight[k, z]:
                        continue
                radius[k, z] = r
                weight[k, z] = strong
                noise[k, z] = np.sqrt(own)
                spread[k, z] = np.sqrt(wide)
                source[k, z] = a if w >= u and w >= v else (b if u >= v else c)
            k += 1
    return met, clashes
