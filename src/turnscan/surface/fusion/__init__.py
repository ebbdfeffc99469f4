"""Fusion: the grids of several lasers, passes and poses → one surface, and where they disagree."""

from turnscan.surface.fusion._combine import paste
from turnscan.surface.fusion._merge import MergeMethod, merge
from turnscan.surface.fusion._overlap import Overlap, overlaps
from turnscan.surface.fusion._range_surface import RangeSurface, range_surfaces
from turnscan.surface.fusion._respace import respace
from turnscan.surface.fusion._tsdf import fuse

__all__ = [
    "MergeMethod",
    "Overlap",
    "RangeSurface",
    "fuse",
    "merge",
    "overlaps",
    "paste",
    "range_surfaces",
    "respace",
]
