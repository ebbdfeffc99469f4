"""A range grid of given points."""

from __future__ import annotations

import numpy as np

from turnscan.points import RangeGrid


def plain_grid(points, angles=None, sigma=0.1):
    points = np.asarray(points, float)
    s = len(points)
    found = ~np.isnan(points[..., 0])
    return RangeGrid(
        "L0",
        np.arange(s),
        np.arange(s) * 0.1 if angles is None else angles,
        points,
        np.where(found, sigma, np.nan),
        np.where(found, 50.0, np.nan),
        np.where(found, 0, 1),
        closed=False,
    )
