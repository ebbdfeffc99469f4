"""Holes: where the surface is open, why, and how it is filled."""

from turnscan.surface.holes._bridge import bridge
from turnscan.surface.holes._causes import explain
from turnscan.surface.holes._close import Bottom, ClosingOptions, Top, close, closings
from turnscan.surface.holes._fill import FillHow, fill
from turnscan.surface.holes._holes import CAUSE_WORDS, Cause, Hole, holes
from turnscan.surface.holes._left_out import LeftOut
from turnscan.surface.holes._reach import reached
from turnscan.surface.holes._sound_fill import Filled, fill_soundly, unfilled
from turnscan.surface.holes._visibility import ScanCoverage

__all__ = [
    "CAUSE_WORDS",
    "Bottom",
    "Cause",
    "ClosingOptions",
    "FillHow",
    "Filled",
    "Hole",
    "LeftOut",
    "ScanCoverage",
    "Top",
    "bridge",
    "close",
    "closings",
    "explain",
    "fill",
    "fill_soundly",
    "holes",
    "reached",
    "unfilled",
]
