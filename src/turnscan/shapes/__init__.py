"""Mesh and points → planes and other primitives, with residuals and uncertainty; deviations."""

from turnscan.shapes._deviation import Deviation, deviation, sample_surface
from turnscan.shapes._fit import (
    Circle,
    Cylinder,
    Plane,
    Sphere,
    fit_circle,
    fit_cylinder,
    fit_plane,
    fit_sphere,
)
from turnscan.shapes._measure import (
    Measured,
    Spot,
    area,
    corner_angle,
    distance,
    plane_of,
    planes_angle,
    region_diameter,
    section_diameter,
    to_plane,
    volume,
)
from turnscan.shapes._planes import PlaneAngle, PlaneRegion, find_planes, plane_angles

__all__ = [
    "Circle",
    "Cylinder",
    "Deviation",
    "Measured",
    "Plane",
    "PlaneAngle",
    "PlaneRegion",
    "Sphere",
    "Spot",
    "area",
    "corner_angle",
    "deviation",
    "distance",
    "find_planes",
    "fit_circle",
    "fit_cylinder",
    "fit_plane",
    "fit_sphere",
    "plane_angles",
    "plane_of",
    "planes_angle",
    "region_diameter",
    "sample_surface",
    "section_diameter",
    "to_plane",
    "volume",
]
