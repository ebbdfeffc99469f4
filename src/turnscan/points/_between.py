"""A spacing of the user's choice between the profiles of a grid, in degrees or in mm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from turnscan.errors import InputError
from turnscan.points._grid import RangeGrid


@dataclass(frozen=True)
class Between:
    """How far apart profiles are wanted."""

    size: float
    unit: Literal["rad", "mm"]
    """mm: along the circle of the outermost point, so nowhere further apart than that."""

    def __post_init__(self) -> None:
        if not (self.size > 0 and np.isfinite(self.size)):
            raise InputError(f"{self.size} {self.unit} between profiles", hint="give more than 0")

    def angle(self, grid: RangeGrid) -> float:
        """Radians, for the part in this grid."""
        if self.unit == "rad":
            return self.size
        reach = float(np.nanmax(np.hypot(grid.points[..., 0], grid.points[..., 1])))
        return self.size / max(reach, 1e-9)
