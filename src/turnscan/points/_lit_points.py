"""What is known of the light of the points of one grid."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from turnscan.arrays import Floats

_LEAST = 0.25
"""Part of the median arc below which no step is believed to be: beside the axis it is none."""


@dataclass(frozen=True)
class LitPoints:
    """What is known of the light of the points of one grid, in the object's frame."""

    points: Floats
    """(s, n, 3) mm, NaN where missing."""
    eyes: Floats
    """(s, 3) mm: the camera at each step."""
    moves: Floats
    """(s, n, 3) mm: where the ray of the next pixel across ends, at the point's depth."""
    sheets: Floats
    """(s, n, 3) the laser sheet's normal."""
    width: Floats
    """(s, n) px rms of the stripe."""
    amplitude: Floats
    """(s, n) grey levels."""
    angles: Floats
    """(s,) rad."""
    closed: bool
    noise: float = 0.0
    """mm: how far noise usually moves a point."""
    stated: float = 0.0
    """mm rms: how thick the rig says that the sheet is; 0 where it does not."""
    skew: Floats | None = None
    """(s, n) third standardised moment of the light; NaN where missing, None where nothing
    measured it."""

    @cached_property
    def arcs(self) -> Floats:
        """(s, n) mm: the usual way of each point from step to step."""
        turn = np.abs(np.diff(np.unwrap(self.angles)))
        usual = float(np.median(turn)) if len(turn) else 0.0
        arc = np.hypot(self.points[..., 0], self.points[..., 1]) * usual
        have = arc[~np.isnan(arc)]
        return np.asarray(np.maximum(arc, _LEAST * float(np.median(have)) if len(have) else 0.0))

    @cached_property
    def along(self) -> Floats:
        """(s, n, 3) mm: how a centre that is off by one pixel moves its point, in the sheet."""
        ray = self.points - self.eyes[:, None]
        slope = np.einsum("sni,sni->sn", self.sheets, self.moves)
        slope = slope / np.einsum("sni,sni->sn", self.sheets, ray)
        return np.asarray(self.moves - ray * slope[..., None])
