"""Loose points with their provenance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Floats, Ints, frozen


@dataclass(frozen=True)
class PointCloud:
    """Loose points with their provenance."""

    points: Floats
    """(m, 3) mm."""
    sigma: Floats
    """(m,) mm, as `RangeGrid.sigma`; NaN where not known."""
    laser: Ints
    """(m,) index into ``lasers``."""
    step: Ints
    """(m,) step number."""
    line: Ints
    """(m,) image row (column for a horizontal stripe)."""
    lasers: tuple[str, ...]

    def __post_init__(self) -> None:
        m = len(self.points)
        put = object.__setattr__
        put(self, "points", frozen(self.points, (m, 3), "PointCloud.points"))
        put(self, "sigma", frozen(self.sigma, (m,), "PointCloud.sigma", nan=True))
        for name in ("laser", "step", "line"):
            put(self, name, frozen(getattr(self, name), (m,), f"PointCloud.{name}", np.int32))
