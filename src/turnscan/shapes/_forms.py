"""Planes, spheres, circles and cylinders, with their uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, frozen


@dataclass(frozen=True)
class Plane:
    """The plane n·x = d."""

    normal: Floats
    """(3,) unit."""
    distance: float
    """d, mm from the origin along the normal."""
    centre: Floats
    """(3,) mm: centroid of the points, which the uncertainty is about."""
    rms: float
    """mm, root mean square distance of the points."""
    covariance: Floats
    """(3, 3): tilt in its two principal directions (radians), shift along the normal at the
    centre (mm)."""
    count: int
    """Points used."""

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "normal", frozen(self.normal, (3,), "Plane.normal"))
        put(self, "centre", frozen(self.centre, (3,), "Plane.centre"))
        put(self, "covariance", frozen(self.covariance, (3, 3), "Plane.covariance"))

    @property
    def normal_sigma(self) -> float:
        """Standard uncertainty of the normal's direction, radians (the worse of the two tilts)."""
        return float(np.sqrt(max(self.covariance[0, 0], self.covariance[1, 1])))

    def distances(self, points: npt.ArrayLike) -> Floats:
        """Signed distances (...) mm of points (..., 3)."""
        away: Floats = np.asarray(points, dtype=np.float64) @ self.normal - self.distance
        return away


@dataclass(frozen=True)
class Sphere:
    """A sphere."""

    centre: Floats
    """(3,) mm."""
    radius: float
    """mm."""
    rms: float
    """mm, root mean square distance of the points."""
    covariance: Floats
    """(4, 4) mm²: centre x, y, z, radius."""
    count: int
    """Points used."""

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "centre", frozen(self.centre, (3,), "Sphere.centre"))
        put(self, "covariance", frozen(self.covariance, (4, 4), "Sphere.covariance"))

    def distances(self, points: npt.ArrayLike) -> Floats:
        """Signed distances (...) mm of points (..., 3), positive outside."""
        away = np.linalg.norm(np.asarray(points, dtype=np.float64) - self.centre, axis=-1)
        return np.asarray(away - self.radius)


@dataclass(frozen=True)
class Circle:
    """A circle in a plane."""

    centre: Floats
    """(3,) mm."""
    normal: Floats
    """(3,) unit vector: of the plane it lies in, as given."""
    radius: float
    """mm."""
    rms: float
    """mm, root mean square distance of the points, within the plane."""
    covariance: Floats
    """(3, 3) mm²: shift of the centre in two directions in the plane, radius."""
    count: int
    """Points used."""

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "centre", frozen(self.centre, (3,), "Circle.centre"))
        put(self, "normal", frozen(self.normal, (3,), "Circle.normal"))
        put(self, "covariance", frozen(self.covariance, (3, 3), "Circle.covariance"))


@dataclass(frozen=True)
class Cylinder:
    """A cylinder without ends."""

    point: Floats
    """(3,) mm: the point of the axis nearest to the centroid of the points."""
    axis: Floats
    """(3,) unit direction of the axis, z ≥ 0."""
    radius: float
    """mm."""
    rms: float
    """mm, root mean square distance of the points."""
    covariance: Floats
    """(5, 5): tilt of the axis in two directions across it (radians), shift of the point in the
    same two (mm), radius (mm)."""
    count: int
    """Points used."""

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "point", frozen(self.point, (3,), "Cylinder.point"))
        put(self, "axis", frozen(self.axis, (3,), "Cylinder.axis"))
        put(self, "covariance", frozen(self.covariance, (5, 5), "Cylinder.covariance"))

    def distances(self, points: npt.ArrayLike) -> Floats:
        """Signed distances (...) mm of points (..., 3), positive outside."""
        away = np.asarray(points, dtype=np.float64) - self.point
        away = away - (away @ self.axis)[..., None] * self.axis
        return np.asarray(np.linalg.norm(away, axis=-1) - self.radius)
