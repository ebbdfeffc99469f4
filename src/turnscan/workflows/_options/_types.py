"""Types and limits of the rooms below that the doors need by name."""

from __future__ import annotations

from turnscan import acquire as scan_events
from turnscan.acquire import Control as ScanControl
from turnscan.edit import Figures as SurfaceFigures
from turnscan.rig import Rig as KnownRig
from turnscan.scanner import LONGEST_PAUSE, MOST_PICTURES, Opened, Shot, photograph
from turnscan.stripes import Orientation

__all__ = [
    "LONGEST_PAUSE",
    "MOST_PICTURES",
    "KnownRig",
    "Opened",
    "Orientation",
    "ScanControl",
    "Shot",
    "SurfaceFigures",
    "photograph",
    "scan_events",
]
