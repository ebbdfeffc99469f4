"""What is known of the light of the points of one grid."""

from __future__ import annotations

from dataclasses import dataclass

from turnscan.arrays import Floats


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
