"""Stripe + Rig + angle → Profile → RangeGrid and PointCloud, with sigma and provenance."""

from turnscan.points._between import Between
from turnscan.points._build import build_grid, every, goes_round, whole_turns
from turnscan.points._findings import (
    angle_findings,
    grid_findings,
    lost_frames,
    swept_findings,
    together_findings,
)
from turnscan.points._grid import Origin, RangeGrid
from turnscan.points._normal_sigma import normal_sigma, usual_sigma
from turnscan.points._placements import placed, placements_from_conf
from turnscan.points._profile import Along, Spacing, profiles, resample
from turnscan.points._range_scan import RangeScan, range_scan_from_ply
from turnscan.points._sweep import Swept, paths_of, refine
from turnscan.points._triangulate import (
    pixel_moves,
    pixels_of,
    point_covariance,
    rig_moves,
    systematic_sigma,
    to_object,
    triangulate,
)
from turnscan.points._view import view_mask, widened
from turnscan.points._volume import (
    Volume,
    clip,
    cloud,
    drop_specks,
    without,
    working_volume,
)

__all__ = [
    "Along",
    "Between",
    "Origin",
    "RangeGrid",
    "RangeScan",
    "Spacing",
    "Swept",
    "Volume",
    "angle_findings",
    "build_grid",
    "clip",
    "cloud",
    "drop_specks",
    "every",
    "goes_round",
    "grid_findings",
    "lost_frames",
    "normal_sigma",
    "paths_of",
    "pixel_moves",
    "pixels_of",
    "placed",
    "placements_from_conf",
    "point_covariance",
    "profiles",
    "range_scan_from_ply",
    "refine",
    "resample",
    "rig_moves",
    "swept_findings",
    "systematic_sigma",
    "to_object",
    "together_findings",
    "triangulate",
    "usual_sigma",
    "view_mask",
    "whole_turns",
    "widened",
    "without",
    "working_volume",
]
