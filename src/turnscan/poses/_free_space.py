"""Empty space: where a camera looked through, no other pose may have a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.poses._view import View

_RAYS = 40_000
_SIDE = 160
"""Cubes along the longest side of the box, at most."""
_CRACK, _MARGIN = 1, 2
"""Cubes by which cracks between rays are closed, and by which the border is kept clear of."""


@dataclass(frozen=True)
class Empty:
    """Cubes that rays of light passed on their way to a camera, in the frame of the view."""

    origin: Floats
    """(3,) mm."""
    cell: float
    """mm."""
    cubes: Bools
    """(x, y, z)."""

    def holds(self, points: Floats) -> Bools:
        """(n,) True for points (n, 3) of the view's frame in space that was seen to be empty."""
        at = np.floor((points - self.origin) / self.cell).astype(np.int64)
        inside = np.asarray(((at >= 0) & (at < self.cubes.shape)).all(axis=1))
        x, y, z = np.where(inside[:, None], at, 0).T
        return np.asarray(inside & self.cubes[x, y, z])


def empty(v: View, step: float) -> Empty:
    """What a view saw to be empty, in cubes of about ``step``/2 mm, a step before its surface.

    Nothing is empty within a cube of a measured point, nor within a step of the border of what
    was seen: rays that graze a surface pass it closely. Cracks between rays are closed.
    """
    from turnscan.poses import _kernels as kernels

    low, high = v.points.min(axis=0), v.points.max(axis=0)
    margin = 0.5 * float((high - low).max())  # where the rest of the part may be
    low, high = low - margin, high + margin
    cell = max(step / 2, float((high - low).max()) / _SIDE)
    shape = np.ceil((high - low) / cell).astype(np.int64)
    some: Ints | slice = slice(None, None, max(1, len(v.points) // _RAYS))
    cubes = kernels.seen_through(v.points[some], v.eyes[some], low, cell, shape, step)
    near: npt.NDArray[np.bool_] = np.zeros(tuple(shape), dtype=np.bool_)
    near[tuple(np.floor((v.points - low) / cell).astype(np.int64).T)] = True
    clear = _grown(cubes) & ~_grown(near)
    return Empty(low, cell, _shrunk(clear, _CRACK + _MARGIN))


def _grown(cubes: Bools) -> Bools:
    """With the 26 neighbours of every cube."""
    from scipy.ndimage import maximum_filter

    # It goes axis by axis, which `binary_dilation` does not.
    return np.asarray(maximum_filter(cubes.view(np.uint8), 3, mode="constant").view(np.bool_))


def _shrunk(cubes: Bools, by: int) -> Bools:
    """Without what is within so many cubes of others, or of the rim."""
    from scipy.ndimage import minimum_filter

    return np.asarray(
        minimum_filter(cubes.view(np.uint8), 2 * by + 1, mode="constant").view(np.bool_)
    )
