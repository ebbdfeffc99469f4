"""Near: the points of a view by cubes, for the nearest one of them to many places."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from turnscan.arrays import Floats

if TYPE_CHECKING:
    from turnscan.poses._near_kernels import Cubes

_SIDE = 4.0
"""Usual spacings between points, or …"""
_MOST = 150.0
"""… the diagonal of the box round the points over this: the side of a cube. Trials look for points
from a sample spacing (a thirtieth of the diagonal) down to a fifth of that: with this a few cubes
answer."""
_FAR = 255
"""Rings of cubes are counted so far."""


def cubes_of(points: Floats, spacing: float) -> Cubes:
    """Points (n, 3) mm, n at least 1, about ``spacing`` mm apart, by cubes.

    A tree is asked by thousands of places at each round of a refinement, in steps that mostly wait
    for memory; a surface of about even spacing has a few points in each cube, and places with
    nothing near are known by the ring of cubes that is empty round them.
    """
    from scipy.ndimage import distance_transform_cdt

    from turnscan.poses import _near_kernels as kernels

    low = points.min(axis=0)
    box = points.max(axis=0) - low
    side = max(_SIDE * spacing, float(np.linalg.norm(box)) / _MOST, 1e-9)
    x, y, z = (int(n) + 1 for n in box / side)
    number = kernels.cube_numbers(points, low, side, (x, y, z))
    order = np.argsort(number, kind="stable").astype(np.int32)
    count = np.bincount(number, minlength=x * y * z)
    starts = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
    empty = np.pad((count == 0).reshape(x, y, z), 1, constant_values=True)
    away = distance_transform_cdt(empty, metric="chessboard")[1:-1, 1:-1, 1:-1]
    rings = np.minimum(away, _FAR).astype(np.uint8).reshape(-1)
    return kernels.Cubes(points[order], order, starts, rings, low, side, (x, y, z))
