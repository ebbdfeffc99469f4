"""Mesh and points → planes and other primitives, with residuals and uncertainty; deviations."""

from turnscan.shapes._deviation import Deviation, deviation
from turnscan.shapes._fit import fit_cylinder, fit_plane, fit_sphere
from turnscan.shapes._forms import Sphere
from turnscan.shapes._measure import (
    Measured,
    Spot,
    area,
    area_base,
    corner_angle,
    distance,
    measured_points,
    plane_of,
    planes_angle,
    region_diameter,
    section_base,
    section_diameter,
    to_plane,
    volume,
)
from turnscan.shapes._outline_curves import Arc, Line, Outline, Piece, Size, Spline
from turnscan.shapes._outline_fit import fit_outlines
from turnscan.shapes._planes import PlaneAngle, PlaneRegion, find_planes, plane_angles
from turnscan.shapes._section import (
    Chain,
    Cut,
    CutMisses,
    half_plane_cut,
    plane_cut,
)
from turnscan.shapes._section_fit import FittedSection, fit_section
from turnscan.shapes._shared import Source, View, calibration_moves, common_moves
from turnscan.shapes._volume import (
    VolumeSigma,
    mean_curvature,
    volume_figures,
    volume_in_words,
    volume_sigma,
)

__all__ = [
    "Arc",
    "Chain",
    "Cut",
    "CutMisses",
    "Deviation",
    "FittedSection",
    "Line",
    "Measured",
    "Outline",
    "Piece",
    "PlaneAngle",
    "PlaneRegion",
    "Size",
    "Source",
    "Sphere",
    "Spline",
    "Spot",
    "View",
    "VolumeSigma",
    "area",
    "area_base",
    "calibration_moves",
    "common_moves",
    "corner_angle",
    "deviation",
    "distance",
    "find_planes",
    "fit_cylinder",
    "fit_outlines",
    "fit_plane",
    "fit_section",
    "fit_sphere",
    "half_plane_cut",
    "mean_curvature",
    "measured_points",
    "plane_angles",
    "plane_cut",
    "plane_of",
    "planes_angle",
    "region_diameter",
    "section_base",
    "section_diameter",
    "to_plane",
    "volume",
    "volume_figures",
    "volume_in_words",
    "volume_sigma",
]
