"""Mesh and points → planes and other primitives, with residuals and uncertainty; deviations."""

from turnscan.shapes._deviation import Deviation, deviation, sample_surface
from turnscan.shapes._fit import Cylinder, Plane, Sphere, fit_cylinder, fit_plane, fit_sphere
from turnscan.shapes._planes import PlaneAngle, PlaneRegion, find_planes, plane_angles

__all__ = [
    "Cylinder",
    "Deviation",
    "Plane",
    "PlaneAngle",
    "PlaneRegion",
    "Sphere",
    "deviation",
    "find_planes",
    "fit_cylinder",
    "fit_plane",
    "fit_sphere",
    "plane_angles",
    "sample_surface",
]
