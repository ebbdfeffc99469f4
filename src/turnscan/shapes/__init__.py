"""Mesh and points → planes and other primitives, with residuals and uncertainty; deviations."""

from turnscan.shapes._deviation import Deviation, deviation, sample_surface
from turnscan.shapes._fit import fit_circle, fit_cylinder, fit_plane, fit_sphere
from turnscan.shapes._forms import Circle, Cylinder, Plane, Sphere
from turnscan.shapes._measure import (
    Measured,
    Spot,
    area,
    corner_angle,
    distance,
    measured_points,
    plane_of,
    planes_angle,
    region_diameter,
    section_diameter,
    to_plane,
    volume,
)
from turnscan.shapes._planes import PlaneAngle, PlaneRegion, find_planes, plane_angles
from turnscan.shapes._shared import Source, calibration_moves
from turnscan.shapes._volume import (
    VolumeSigma,
    mean_curvature,
    volume_figures,
    volume_in_words,
    volume_sigma,
)

__all__ = [
    "Circle",
    "Cylinder",
    "Deviation",
    "Measured",
    "Plane",
    "PlaneAngle",
    "PlaneRegion",
    "Source",
    "Sphere",
    "Spot",
    "VolumeSigma",
    "area",
    "calibration_moves",
    "corner_angle",
    "deviation",
    "distance",
    "find_planes",
    "fit_circle",
    "fit_cylinder",
    "fit_plane",
    "fit_sphere",
    "mean_curvature",
    "measured_points",
    "plane_angles",
    "plane_of",
    "planes_angle",
    "region_diameter",
    "sample_surface",
    "section_diameter",
    "to_plane",
    "volume",
    "volume_figures",
    "volume_in_words",
    "volume_sigma",
]
