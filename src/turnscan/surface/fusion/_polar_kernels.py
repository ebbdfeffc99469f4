"""Compiled kernel of the merge in angle and height; imported only when it is used."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from turnscan.arrays import Floats, Ints
from turnscan.compiled import njit
from turnscan.surface.fusion._variance_kernels import Vertices, rise, variances

_STEEP = 0.5
"""Cosine between normal and radius below which a bulge moves the radius no further."""


class Cells(NamedTuple):
    """What is known of one surface in each cell (s, n) of angle and height."""

    radius: Floats
    """mm, NaN where the cell was not met."""
    weight: Floats
    """cos(incidence)/spread², 0 where the cell was not met."""
    slope: Floats
    """Cosine between the surface's normal and the radius."""
    noise: Floats
    """mm along the normal: sigma of the vertices."""
    spread: Floats
    """mm along the normal: that and what the surface may do between its profiles."""
    bend: Floats
    """mm along the normal: the same, but for edges between profiles."""
    source: Ints
    """The nearest vertex, −1 where the cell was not met."""


@njit(cache=True, nogil=True)
def _facing(points: Floats, a: int, b: int, c: int, normal: Floats) -> bool:
    """Write the unit normal of a face; False for one without area."""
    size = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        normal[i] = (points[b, j] - points[a, j]) * (points[c, k] - points[a, k])
        normal[i] -= (points[b, k] - points[a, k]) * (points[c, j] - points[a, j])
        size += normal[i] ** 2
    if size == 0.0:
        return False
    for i in range(3):
        normal[i] /= np.sqrt(size)
    return True


@njit(cache=True, nogil=True)
def _turned(
    points: Floats, face: Ints, east: float, north: float, along: Floats, across: Floats
) -> None:
    """Write how far the vertices of a face lie along a ray from the axis, and across it."""
    for i in range(3):
        x, y = points[face[i], 0], points[face[i], 1]
        along[i], across[i] = x * east + y * north, y * east - x * north


@njit(cache=True, nogil=True)
def raster(
    vertices: Vertices,
    bends: Floats,
    normals: Floats,
    around: Floats,
    cosine: Floats,
    faces: Ints,
    columns: Floats,
    lines: tuple[float, float],
    alike: float,
    cells: Cells,
) -> tuple[int, int]:
    """Fill the ``cells`` with the radius of a mesh at every angle and height.

    Between its vertices a face bulges as the ``normals`` (v, 3) there say (`rise`); ``lines`` are
    how high the lowest cells lie and how far others over each other, mm.
    ``bends`` (v,) mm are what of ``vertices.between`` no edge makes.
    ``around`` (v,) are the vertices' angles and ``columns`` (s,) those of the cells, both in turns,
    from 0 to 1, the columns ascending. Where a cell is met twice the face of more weight counts.
    Returns how many cells were met, and how often at a radius more than ``alike`` mm away.
    """
    points, sigma, between, step = vertices
    bottom, apart = lines
    radius, weight, slope, noise, spread, bend, source = cells
    s, n = radius.shape
    met, clashes = 0, 0
    along, across, normal = np.empty(3), np.empty(3), np.empty(3)
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        xa = around[a]
        # The face lies where its vertices are nearest to the first, across the seam too.
        xb, xc = (around[b] - np.round(around[b] - xa), around[c] - np.round(around[c] - xa))
        za = (points[a, 2] - bottom) / apart
        zb, zc = (points[b, 2] - bottom) / apart, (points[c, 2] - bottom) / apart
        left, right = min(xa, xb, xc), max(xa, xb, xc)
        if right - left > 0.25 or not _facing(points, a, b, c, normal):
            continue
        ab, bc = rise(points, normals, a, b), rise(points, normals, b, c)
        ca = rise(points, normals, c, a)
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
            # Along the ray from the axis, and across it: faces are flat in space, not in radius.
            east, north = np.cos(2 * np.pi * x), np.sin(2 * np.pi * x)
            _turned(points, faces[f], east, north, along, across)
            xa, xb, xc = across
            area = (xb - xa) * (zc - za) - (xc - xa) * (zb - za)
            if area == 0.0:
                k += 1
                continue
            steep = abs(normal[0] * east + normal[1] * north)
            for z in range(low, high + 1):
                u = (-xa * (zc - za) - (xc - xa) * (z - za)) / area
                v = ((xb - xa) * (z - za) + xa * (zb - za)) / area
                w = 1.0 - u - v
                if u < -1e-6 or v < -1e-6 or w < -1e-6:
                    continue
                bulge = w * (u * ab + v * ca) + u * v * bc
                r = w * along[0] + u * along[1] + v * along[2] + bulge / max(steep, _STEEP)
                own, wide = variances(faces[f], u, v, sigma, between, step)
                strong = (w * cosine[a] + u * cosine[b] + v * cosine[c]) / max(wide, 1e-12)
                there = not np.isnan(radius[k, z])
                met += not there
                clashes += there and abs(r - radius[k, z]) > alike
                if there and strong <= weight[k, z]:
                    continue
                radius[k, z], weight[k, z], slope[k, z] = r, strong, steep
                noise[k, z], spread[k, z] = np.sqrt(own), np.sqrt(wide)
                bend[k, z] = np.sqrt(variances(faces[f], u, v, sigma, bends, step)[1])
                source[k, z] = a if w >= u and w >= v else (b if u >= v else c)
            k += 1
    return met, clashes
