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
    random: Floats
    """mm along the normal: of that, what averages out."""
    spread: Floats
    """mm along the normal: that and what the surface may do between its profiles and lines."""
    bend: Floats
    """mm along the normal: the same, but for edges between profiles."""
    source: Ints
    """The nearest vertex, −1 where the cell was not met."""
    aside: Floats
    """How far beside the cell's column the place lies, in turns: 0 where the surface meets the
    column, else where it ends before that; NaN where the cell was not met."""


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
def _end(
    across: Floats, along: Floats, heights: Floats, face: Ints, step: Ints, z: float
) -> tuple[float, float, float]:
    """Where the profile of a face is nearest to a ray from the axis at the height ``z``: the
    barycentric coordinates of its second and third vertex, and the angle to the ray, in turns,
    infinite where no side on a profile passes that height: others were not measured.

    For a ray beside the face, its vertices ``across`` and ``along`` the ray (`_turned`).
    """
    best, at_u, at_v = np.inf, 0.0, 0.0
    for i in range(3):
        j = (i + 1) % 3
        if step[face[i]] != step[face[j]] or heights[i] == heights[j]:
            continue
        t = (z - heights[i]) / (heights[j] - heights[i])
        if t < -1e-6 or t > 1.0 + 1e-6:
            continue
        x, y = across[i] + t * (across[j] - across[i]), along[i] + t * (along[j] - along[i])
        angle = np.arctan2(x, y) / (2.0 * np.pi)
        if abs(angle) < abs(best):
            best = angle
            at_u = (1.0 - t if i == 1 else 0.0) + (t if j == 1 else 0.0)
            at_v = (1.0 - t if i == 2 else 0.0) + (t if j == 2 else 0.0)
    return at_u, at_v, best


@njit(cache=True, nogil=True)
def _counts(cells: Cells, k: int, z: int, aside: float, evidence: float) -> bool:
    """Whether a place counts in a cell rather than what is there: what meets the column before what
    ends beside it, that by how far; else by its ``evidence``, weight times radius.

    A cell stands for an area that grows with the radius: beside the axis it is next to nothing.
    """
    if np.isnan(cells.radius[k, z]):
        return True
    if abs(aside) != abs(cells.aside[k, z]):
        return abs(aside) < abs(cells.aside[k, z])  # type: ignore[no-any-return]
    return evidence > cells.weight[k, z] * cells.radius[k, z]  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def _reach(
    along: Floats,
    place: tuple[float, float, float],
    bulges: tuple[float, float, float],
    steep: float,
) -> float:
    """mm: how far from the axis a ``place`` on a face lies, its barycentric coordinates and its
    angle to the ray `_turned` took, with what the face bulges between its vertices."""
    u, v, beside = place
    w = 1.0 - u - v
    bulge = w * (u * bulges[0] + v * bulges[2]) + u * v * bulges[1]
    flat = w * along[0] + u * along[1] + v * along[2]
    return flat / np.cos(2.0 * np.pi * beside) + bulge / max(steep, _STEEP)  # type: ignore[no-any-return]


@njit(cache=True, nogil=True)
def _put(
    cells: Cells,
    k: int,
    z: int,
    place: tuple[float, float, float, float],
    variance: tuple[float, float, float, float],
    source: int,
) -> None:
    """Write a cell: radius, weight, slope and how far aside; the four variances, mm²; a vertex."""
    cells.radius[k, z], cells.weight[k, z], cells.slope[k, z], cells.aside[k, z] = place
    cells.random[k, z], cells.noise[k, z] = np.sqrt(variance[0]), np.sqrt(variance[1])
    cells.spread[k, z], cells.bend[k, z] = np.sqrt(variance[2]), np.sqrt(variance[3])
    cells.source[k, z] = source


@njit(cache=True, nogil=True)
def raster(
    vertices: Vertices,
    between: tuple[Floats, Floats],
    between_lines: Floats,
    around: Floats,
    cosine: Floats,
    faces: Ints,
    columns: Floats,
    lines: tuple[float, float],
    limits: tuple[float, float],
    cells: Cells,
) -> tuple[int, int]:
    """Fill the ``cells`` with the radius of a mesh at every angle and height.

    Between its vertices a face bulges as these bend (`rise`); ``lines`` are how high the lowest
    cells lie and how far others over each other, mm; ``between`` (f,) mm what the surface may do
    between two profiles but for edges, and with them, ``between_lines`` (v,) mm between lines.
    ``around`` (v,) are the vertices' angles and ``columns`` (s,) those of the cells, in turns from
    0 to 1, ascending. ``limits`` are the mm within which two radii are alike, and the turns within
    which a face that ends beside a column is met at its end. Which counts where a cell is met
    twice: `_counts`. Returns how many cells were met, and how often at a radius that is not alike.
    """
    points, (bottom, apart), (alike, room) = vertices.points, lines, limits
    flex, steps = vertices.bend, vertices.step
    s, n = cells.radius.shape
    met, clashes = 0, 0
    along, across, heights, normal = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
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
        ab, bc = rise(points, flex, steps, a, b), rise(points, flex, steps, b, c)
        bulges = ab, bc, rise(points, flex, steps, c, a)
        low = max(0, int(np.ceil(min(za, zb, zc) - 1e-9)))
        high = min(n - 1, int(np.floor(max(za, zb, zc) + 1e-9)))
        heights[0], heights[1], heights[2] = za, zb, zc
        whole = np.floor(left - room - 1e-9)
        k = np.searchsorted(columns, left - room - 1e-9 - whole)
        while True:
            if k == s:
                k, whole = 0, whole + 1.0
            x = columns[k] + whole
            if x > right + room + 1e-9:
                break
            # Along the ray from the axis, and across it: faces are flat in space, not in radius.
            east, north = np.cos(2 * np.pi * x), np.sin(2 * np.pi * x)
            _turned(points, faces[f], east, north, along, across)
            xa, xb, xc = across
            area = (xb - xa) * (zc - za) - (xc - xa) * (zb - za)
            steep = abs(normal[0] * east + normal[1] * north)
            for z in range(low, high + 1 if area != 0.0 else low):
                u = (-xa * (zc - za) - (xc - xa) * (z - za)) / area
                v = ((xb - xa) * (z - za) + xa * (zb - za)) / area
                beside = 0.0
                if u < -1e-6 or v < -1e-6 or u + v > 1.0 + 1e-6:
                    u, v, beside = _end(across, along, heights, faces[f], vertices.step, z)
                    if abs(beside) > room or beside == 0.0:
                        continue
                r = _reach(along, (u, v, beside), bulges, steep)
                there = beside == 0.0 and cells.aside[k, z] == 0.0
                met += beside == 0.0 and not there
                clashes += there and abs(r - cells.radius[k, z]) > alike
                random, own, single, gap = variances(faces[f], u, v, vertices, between[1][f])
                w = 1.0 - u - v
                gap += (w * between_lines[a] + u * between_lines[b] + v * between_lines[c]) ** 2
                strong = (w * cosine[a] + u * cosine[b] + v * cosine[c]) / max(single + gap, 1e-12)
                if not _counts(cells, k, z, beside, strong * r):
                    continue
                bend = variances(faces[f], u, v, vertices, between[0][f])[3]
                source = a if w >= u and w >= v else (b if u >= v else c)
                known = (random, own, own + gap, own + bend)
                _put(cells, k, z, (r, strong, steep, beside), known, source)
            k += 1
    return met, clashes
