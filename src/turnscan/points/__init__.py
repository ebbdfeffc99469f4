"""Stripe + Rig + angle → Profile → RangeGrid and PointCloud, with sigma and provenance."""

from turnscan.points._build import build_grid, every, goes_round, one_turn
from turnscan.points._grid import PointCloud, RangeGrid
from turnscan.points._profile import Profile, Spacing, profiles, resample
from turnscan.points._range_scan import RangeScan, placements_from_conf, range_scan_from_ply
from turnscan.points._triangulate import point_covariance, to_object, triangulate
from turnscan.points._volume import Volume, clip, cloud, drop_specks, without, working_volume

__all__ = [
    "PointCloud",
    "Profile",
    "RangeGrid",
    "RangeScan",
    "Spacing",
    "Volume",
    "build_grid",
    "clip",
    "cloud",
    "drop_specks",
    "every",
    "goes_round",
    "one_turn",
    "placements_from_conf",
    "point_covariance",
    "profiles",
    "range_scan_from_ply",
    "resample",
    "to_object",
    "triangulate",
    "without",
    "working_volume",
]
