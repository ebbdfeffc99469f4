"""Denoise: points move along their own rays, no further than their sigma allows."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.errors import InputError
from turnscan.points import RangeGrid
from turnscan.progress import Progress, no_progress
from turnscan.surface._grid_mesh import behind_of
from turnscan.surface._noise import noise

if TYPE_CHECKING:
    from turnscan.surface.clean._denoise_kernels import Measured

_REACH = 1.5
"""Steps and lines over which neighbours count, as the rms of a Gaussian."""
_SCALE = 2.0
"""Combined noises from which a neighbour counts for less: it is on another surface."""

_AT_A_TIME = 16
"""Profiles from one word about the progress to the next."""
_OWN = 0.25
"""Variance of the surface at a point that is left out of it, in that of one point."""


def denoise(grid: RangeGrid, most: float = 2.0, progress: Progress = no_progress) -> RangeGrid:
    """The grid with every point moved along its camera ray onto the surface about it.

    The surface about a point is fitted to its neighbours in the grid, weighted by their noise, by
    their distance, and by how far they lie off it in units of the noise, so that it does not go
    round an edge (bilateral filtering, Fleishman et al. 2003, of order 2, with the noise model for
    its range). No point moves further than ``most`` of its own sigma, and none that has no sigma
    or too few neighbours. Sigma stays that of the measurement: what was averaged is no longer
    independent. ``progress`` hears of the profiles. Raises InputError where the camera's place is
    not known, or ``most`` is not positive.
    """
    if not (most > 0 and np.isfinite(most)):
        raise InputError(f"denoise by {most} sigma", hint="give a positive number, like 2")
    if not grid.found.any():
        return grid
    off, _ = _offsets(grid, _measured(grid), _SCALE, progress, alone=False)
    limit = most * np.nan_to_num(grid.sigma)
    move = np.nan_to_num(np.clip(off, -limit, limit))
    ray = _eyes(grid)[:, None] - grid.points
    ray /= np.linalg.norm(ray, axis=2, keepdims=True)
    return replace(grid, points=grid.points + move[..., None] * ray)


def outliers(grid: RangeGrid, beyond: float) -> Bools:
    """(s, n) True for the points that lie off the surface which their neighbours make without them.

    Off means along their rays, by more than ``beyond`` combined sigma; sigma is the larger of the
    noise model's and what those neighbours scatter by. They are as far off the curve of their own
    profile, too: between coarse steps a surface bends by more than noise, and all points lie off
    what the profiles beside them make. Raises InputError where the camera's place is not known.
    """
    from turnscan.surface.clean import _denoise_kernels as kernels

    measured = _measured(grid)
    off, rest = _offsets(grid, measured, 2 * _SCALE, no_progress, alone=True)
    beyond *= np.sqrt(1.0 + _OWN)
    with np.errstate(invalid="ignore"):
        doubtful = np.abs(off) > beyond * measured.noise * np.maximum(rest, 1.0)
    from_profile = np.zeros(off.shape)
    kernels.off_profile(measured, doubtful, from_profile)
    return np.asarray(np.abs(from_profile) > beyond)


def _offsets(
    grid: RangeGrid, measured: Measured, scale: float, progress: Progress, *, alone: bool
) -> tuple[Floats, Floats]:
    """(s, n) each: how far off the surface about it a point lies, mm, and the residual there."""
    from turnscan.surface.clean import _denoise_kernels as kernels

    closed, size = grid.closed and len(grid.steps) > 4 * _REACH, len(grid.steps)
    off, rest = np.full(grid.flags.shape, np.nan), np.full(grid.flags.shape, np.nan)
    for first in range(0, size, _AT_A_TIME):
        progress(first / size)
        kernels.offsets(
            measured,
            closed,
            _REACH,
            scale,
            alone,
            (first, min(first + _AT_A_TIME, size)),
            off,
            rest,
        )
    return off, rest


def _measured(grid: RangeGrid) -> Measured:
    from turnscan.surface.clean import _denoise_kernels as kernels

    return kernels.Measured(grid.points, behind_of(grid), _eyes(grid), noise(grid))


def _eyes(grid: RangeGrid) -> Floats:
    if grid.eyes is None:
        raise InputError(
            f"{grid.laser}: the camera position is unknown", hint="leave denoising out"
        )
    return grid.eyes
