"""What a range grid says of itself: how far apart its points usually are, how noisy they are."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats
from turnscan.points import RangeGrid

_TRUSTED = 1.5
"""A sigma above this many usual ones is a stray point's."""


def spacing(grid: RangeGrid) -> tuple[Floats, Floats]:
    """Usual distance (s, n) of every point to the next step and to the next line, mm.

    Between steps it is the arc that the table's turn makes of the point's radius, but not less
    than a quarter of the median; along a profile, and where the angles do not turn (the scans of
    another scanner), it is the median of the whole grid.
    """
    from turnscan.surface import _grid_kernels as kernels

    points = grid.points
    across, along = kernels.edges(points, np.zeros(grid.flags.shape, dtype=np.bool_), False)
    line = np.full(grid.flags.shape, _median(along))
    step = np.full(grid.flags.shape, _median(across))
    turn = np.abs(np.diff(np.unwrap(grid.angles)))
    if len(turn) and turn.min() > 0:
        turn = np.append(turn, np.median(turn))
        arc = np.hypot(points[..., 0], points[..., 1]) * turn[:, None]
        step = np.where(np.isnan(arc), step, np.maximum(arc, 0.25 * _median(arc)))
    return step, line


def noise(grid: RangeGrid) -> Floats:
    """Standard uncertainty (s, n) mm of every point, as far as it is believed; 0 where not known.

    No sigma is believed above three usual ones; and the usual one not above what the surface
    itself shows: the second difference along the profiles, which curvature only makes larger.
    """
    from turnscan.surface import _grid_kernels as kernels

    sigma = np.nan_to_num(grid.sigma)
    known = grid.sigma[~np.isnan(grid.sigma)]
    if not len(known):
        return sigma
    usual = float(np.median(known))
    shown = _median(kernels.bends(grid.points)) / np.sqrt(6.0)
    believed: Floats = np.minimum(sigma, _TRUSTED * min(usual, max(shown, 1e-12)))
    return believed


def _median(values: npt.NDArray[np.float64]) -> float:
    have = values[np.isfinite(values)]
    return float(np.median(have, overwrite_input=True)) if len(have) else 1.0
