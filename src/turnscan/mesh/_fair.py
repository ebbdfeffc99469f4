"""Fairing: new vertices go where the surface bends (or changes its bending) least."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from turnscan.arrays import Bools, Floats, Ints

Order = Literal[1, 2, 3]
_STEEPEST = 20.0
"""A cotangent above this belongs to a sliver."""
_RINGS = 6
"""Rings about a hole from which its border's tangents and curvature are taken."""
_STEADY = 8.0
"""Waves of this length, in spacings of the measured vertices, count half as noise there."""
_CALM = 2.0
"""Waves of this length, in sizes of the hole, bend as much as they change their bending."""
_LEAST = 1e-2
"""Share of the usual area about a vertex that every vertex has at least."""


def fair(vertices: Floats, faces: Ints, free: Bools, order: Order, size: Floats) -> Floats:
    """(v, 3) with the ``free`` (v,) vertices placed so that Δᵏx = 0 there, k = ``order``.

    All others stay where they are; but so that the noise of the border is not carried on, its
    tangents and curvature are those of a smoothing spline through a few rings about the hole.
    1 is the membrane, which takes no tangents and keeps to the border itself; 2 the thin plate,
    which continues the tangent planes at the border; 3
    changes its curvature least, which continues the curvature too (Botsch and Kobbelt 2004). 3
    has a share of 2, for else what noise is left in the curvature would grow with the way across
    the hole: waves longer than `_CALM` times ``size`` (v,), mm, the hole's at every free vertex,
    are kept low. Δ is the cotangent Laplacian over the areas about the vertices; it is made anew
    as the surface moves.
    """
    if not free.any():
        return vertices
    reach, near, band = free, np.zeros(len(faces), dtype=np.bool_), free
    rings = 0 if order == 1 else _RINGS
    for ring in range(rings + order):
        near = np.asarray(reach[faces].any(axis=1))
        reach = np.zeros_like(free)
        reach[faces[near]] = True
        if ring == rings - 1:
            band = reach
    index = np.flatnonzero(reach)
    new = np.full(len(vertices), -1, dtype=np.int32)
    new[index] = np.arange(len(index), dtype=np.int32)
    region = _Region(new[faces[near]], free[index], band[index] & ~free[index], vertices[index])
    points = vertices[index]
    plan: tuple[Order, ...] = (1, order, order)
    for k in plan if order > 1 else (1, 1):
        points[region.free] = _solved(points, region, k, size[index])[region.free]
    out = vertices.copy()
    out[index] = points
    return out


@dataclass(frozen=True)
class _Region:
    """A hole's new vertices and the rings about it."""

    faces: Ints
    free: Bools
    """(v,) New: they go where the surface wants them."""
    band: Bools
    """(v,) Measured: they may differ from their place by their noise, in this reckoning only."""
    measured: Floats
    """(v, 3) mm."""


def _solved(points: Floats, region: _Region, order: Order, size: Floats) -> Floats:
    from scipy.sparse import diags_array
    from scipy.sparse.linalg import splu

    stiff, area = _laplacian(points, region.faces)
    inverse = diags_array(1.0 / area)
    system = stiff
    for _ in range(order - 1):
        system = (stiff @ inverse @ system).tocsr()
    if order == 3:
        bent = diags_array(np.where(region.free, (2 * np.pi / (_CALM * size)) ** 2, 0.0) / area)
        system = (system + stiff @ bent @ stiff).tocsr()
    wave = (2 * np.pi / _STEADY) ** (2 * order) * area ** (1 - order)
    weight = np.where(region.band, wave, 0.0)
    move = region.free | region.band
    rows = (system + diags_array(weight)).tocsr()[np.flatnonzero(move)]
    inner = rows[:, np.flatnonzero(move)].tocsc()
    push = (weight[:, None] * region.measured)[move]
    push -= rows[:, np.flatnonzero(~move)] @ region.measured[~move]
    factors = splu(inner, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    solved = region.measured.copy()
    solved[move] = factors.solve(push)
    return solved


def _laplacian(points: Floats, faces: Ints) -> tuple[Any, Floats]:
    """The stiffness matrix (v, v) of the cotangent Laplacian, and the area (v,) of each vertex."""
    from scipy.sparse import coo_array

    v = len(points)
    p = points[faces]
    rows, columns, weights = [], [], []
    twice = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    for i in range(3):
        a, b = p[:, (i + 1) % 3] - p[:, i], p[:, (i + 2) % 3] - p[:, i]
        dot = np.einsum("ij,ij->i", a, b)
        cot = np.clip(dot / np.maximum(twice, 1e-12 * np.abs(dot).max(initial=1.0)), 0, _STEEPEST)
        rows.append(faces[:, (i + 1) % 3])
        columns.append(faces[:, (i + 2) % 3])
        weights.append(cot / 2)
    row, column, weight = (np.concatenate(x) for x in (rows, columns, weights))
    half = coo_array((weight + 1e-6, (row, column)), shape=(v, v)).tocsr()
    both = half + half.T
    total = np.asarray(both.sum(axis=1)).ravel()
    stiff = coo_array((total, (np.arange(v), np.arange(v))), shape=(v, v)).tocsr() - both
    area = np.zeros(v)
    for i in range(3):
        area += np.bincount(faces[:, i], twice / 6, minlength=v)
    return stiff, np.maximum(area, _LEAST * float(np.median(area)))
