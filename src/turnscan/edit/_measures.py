"""Measurements as entries of the history: they are kept and replayed, and change nothing.

Each is taken on the surface as it is at its place in the history.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import ConfigDict, Field

from turnscan import shapes
from turnscan.arrays import Bools, Floats
from turnscan.edit._body import Body, Compact
from turnscan.edit._region import Region
from turnscan.errors import FormatError, InputError
from turnscan.mesh import Mesh, submesh
from turnscan.shapes import Measured, Source, Spot

STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Vector = tuple[Coordinate, Coordinate, Coordinate]
REACH = 5.0
"""mm from the surface within which a point that was picked on another scan still is on this one."""


@dataclass(frozen=True)
class MeasureDistance:
    """From one point of the surface to another."""

    __pydantic_config__ = STRICT
    a: Vector
    b: Vector
    kind: Literal["measure_distance"] = "measure_distance"


@dataclass(frozen=True)
class MeasureToPlane:
    """From a point of the surface to the plane of a region, positive outside."""

    __pydantic_config__ = STRICT
    point: Vector
    plane: Region
    kind: Literal["measure_to_plane"] = "measure_to_plane"


@dataclass(frozen=True)
class MeasureDiameter:
    """Of the cylinder or sphere that a region is part of."""

    __pydantic_config__ = STRICT
    where: Region
    kind: Literal["measure_diameter"] = "measure_diameter"


@dataclass(frozen=True)
class MeasureSection:
    """Diameter of a section with a plane."""

    __pydantic_config__ = STRICT
    normal: Vector
    distance: Coordinate
    near: Vector | None = None
    """Of several loops the one nearest to this; None takes the longest."""
    kind: Literal["measure_section"] = "measure_section"

    def __post_init__(self) -> None:
        if not any(self.normal):
            raise FormatError("measure_section.normal: a plane needs a direction")


@dataclass(frozen=True)
class MeasureAngle:
    """Between the outward normals of two flat regions."""

    __pydantic_config__ = STRICT
    first: Region
    second: Region
    kind: Literal["measure_angle"] = "measure_angle"


@dataclass(frozen=True)
class MeasureCorner:
    """The angle at a point between the directions to two others."""

    __pydantic_config__ = STRICT
    a: Vector
    corner: Vector
    b: Vector
    kind: Literal["measure_corner"] = "measure_corner"


@dataclass(frozen=True)
class MeasureArea:
    """Of a region, or of the whole surface."""

    __pydantic_config__ = STRICT
    where: Region | None = None
    kind: Literal["measure_area"] = "measure_area"


@dataclass(frozen=True)
class MeasureVolume:
    """Within the surface, which must be closed."""

    __pydantic_config__ = STRICT
    kind: Literal["measure_volume"] = "measure_volume"


@dataclass(frozen=True)
class Specify:
    """Name a measurement, and say what it is to be: a dimension of the drawing.

    The last one of a measurement holds. Without limits it is only named.
    """

    __pydantic_config__ = STRICT
    measure: Annotated[int, Field(ge=1)]
    """Number of the edit that measures."""
    name: Annotated[str, Field(max_length=80)] = ""
    nominal: Coordinate | None = None
    """In the unit of the measurement, angles in degrees."""
    lower: Coordinate | None = None
    """Least deviation from the nominal value that is allowed, as drawings write it: −0.05."""
    upper: Coordinate | None = None
    kind: Literal["specify"] = "specify"

    def __post_init__(self) -> None:
        given = [x is not None for x in (self.nominal, self.lower, self.upper)]
        if any(given[1:]) and not all(given):
            raise FormatError("specify: give the nominal value and both limits")
        if self.lower is not None and self.upper is not None and self.lower > self.upper:
            raise FormatError("specify: the lower limit is above the upper one")


Measure = (
    MeasureDistance
    | MeasureToPlane
    | MeasureDiameter
    | MeasureSection
    | MeasureAngle
    | MeasureCorner
    | MeasureArea
    | MeasureVolume
)


Sources = Callable[[], Source]
"""What a surface was made from; asked for where a measurement hangs on it."""


def taken(body: Body, measure: Measure, source: Sources = Source) -> Measured:
    """A measurement on the living surface. Raises InputError, DidNotConverge where it cannot be."""
    live = Compact.of(body)
    mesh = live.mesh

    def faces(region: Region) -> Bools:
        chosen = np.zeros(len(body.alive), dtype=np.bool_)
        chosen[region.find(body)] = True
        if not chosen.any():
            raise InputError("its region no longer exists")
        return np.asarray(chosen[live.face_ids])

    match measure:
        case MeasureDistance():
            return shapes.distance(_spot(mesh, measure.a), _spot(mesh, measure.b))
        case MeasureToPlane():
            plane = shapes.plane_of(mesh, faces(measure.plane))
            return shapes.to_plane(_spot(mesh, measure.point), plane)
        case MeasureDiameter():
            return shapes.region_diameter(mesh, faces(measure.where))
        case MeasureSection():
            return shapes.section_diameter(mesh, measure.normal, measure.distance, measure.near)
        case MeasureAngle():
            first, second = faces(measure.first), faces(measure.second)
            return shapes.planes_angle(shapes.plane_of(mesh, first), shapes.plane_of(mesh, second))
        case MeasureCorner():
            a, corner, b = (_spot(mesh, p) for p in (measure.a, measure.corner, measure.b))
            return shapes.corner_angle(a, corner, b)
        case MeasureArea():
            return shapes.area(mesh, None if measure.where is None else faces(measure.where))
        case MeasureVolume():
            return shapes.volume(mesh, source())


def _spot(mesh: Mesh, at: Vector) -> Spot:
    """The nearest point of the surface, and the sigma of the vertex nearest to it."""
    place: Floats = np.array(at)
    away = np.linalg.norm(mesh.vertices - place, axis=1)
    if not len(away):
        raise InputError("no surface to measure on")
    # The nearest face has a corner no further than the nearest vertex and its own longest side.
    t = mesh.triangles
    sides = np.linalg.norm(t - np.roll(t, 1, axis=1), axis=2).max(axis=1)
    near = (away[mesh.faces].min(axis=1) <= away.min() + sides).astype(np.bool_)
    found = shapes.deviation(place[None], submesh(mesh, near))
    gap = abs(float(found.distance[0]))
    if gap > REACH:
        raise InputError(f"the surface is {gap:.1f} mm away from where a point was picked")
    on = found.closest[0]
    vertex = int(np.linalg.norm(mesh.vertices - on, axis=1).argmin())
    sigma = np.nan if mesh.provenance is None else float(mesh.provenance.sigma[vertex])
    return Spot(on, sigma)
