"""Measurements as entries of the history: they are kept and replayed, and change nothing.

Each is taken on the surface as it is at its place in the history.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Annotated, Literal, TypeVar

import numpy as np
from pydantic import ConfigDict, Field

from turnscan import shapes
from turnscan.arrays import Bools, Floats
from turnscan.edit._body import Body, Compact
from turnscan.edit._misfit import misfit
from turnscan.edit._region import Region
from turnscan.errors import FormatError, InputError
from turnscan.mesh import Mesh, submesh
from turnscan.rig import Pose
from turnscan.shapes import Measured, Source, Spot

STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Vector = tuple[Coordinate, Coordinate, Coordinate]
REACH = 5.0
"""mm from the surface within which a point that was picked on another scan still is on this one."""
_BESIDE = 1.0
"""mm from the surface at which a point that was picked on another scan is doubtful."""


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


E = TypeVar("E")
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


def moved_edit(edit: E, pose: Pose) -> E:
    """A measurement of a part that stands elsewhere: from its frame to that one by ``pose``.

    Any other edit is as it was.
    """

    def at(place: Vector) -> Vector:
        x, y, z = pose.apply(np.array([place]))[0]
        return float(x), float(y), float(z)

    match edit:
        case MeasureDistance():
            return replace(edit, a=at(edit.a), b=at(edit.b))
        case MeasureToPlane():
            return replace(edit, point=at(edit.point), plane=edit.plane.moved(pose))
        case MeasureDiameter():
            return replace(edit, where=edit.where.moved(pose))
        case MeasureSection():
            x, y, z = pose.turn(np.array([edit.normal]))[0]
            on = float(np.dot((x, y, z), pose.translation))
            near = None if edit.near is None else at(edit.near)
            normal = float(x), float(y), float(z)
            return replace(edit, normal=normal, distance=edit.distance + on, near=near)
        case MeasureAngle():
            return replace(edit, first=edit.first.moved(pose), second=edit.second.moved(pose))
        case MeasureCorner():
            return replace(edit, a=at(edit.a), corner=at(edit.corner), b=at(edit.b))
        case MeasureArea() if edit.where is not None:
            return replace(edit, where=edit.where.moved(pose))
    return edit


_Taker = Callable[[Floats | None], Measured]
"""A measurement with the vertices (v, 3) mm moved; None: as they are."""
_Faces = Callable[[Region], Bools]
_BAND = 5.0
"""mm on both sides of a section whose faces are moved with it."""


def taken(
    body: Body, measure: Measure, source: Sources = Source, doubts: list[str] | None = None
) -> Measured:
    """A measurement on the living surface. Raises InputError, DidNotConverge where it cannot be.

    Where it was made on another surface, ``doubts`` gets what speaks against this one being of the
    same part: points or patches that lie beside it.
    """
    live = Compact.of(body)
    if isinstance(measure, MeasureVolume):
        return shapes.volume(live.mesh, source())
    return _taker(live.mesh, measure, _finder(body, live, doubts), doubts)(None)


def shared_sigma(body: Body, measure: Measure, source: Source) -> float | None:
    """Standard uncertainty of a measurement from what all its points have in common, in its unit.

    The measurement is taken again with its vertices moved by each cause by itself, as far as one
    standard deviation of it (`shapes.calibration_moves`): what the calibration of camera, lasers
    and table axis leaves open. None where no cause is known, and for volumes, which count them
    themselves. Raises as `taken`.
    """
    if isinstance(measure, MeasureVolume):
        return None
    live = Compact.of(body)
    faces = _finder(body, live)
    near = _bearing(live.mesh, measure, faces)
    part = submesh(live.mesh, near)
    take = _taker(part, measure, lambda region: np.asarray(faces(region)[near]))
    still = take(None).value
    changes = [take(move).value - still for move in shapes.calibration_moves(part, source)]
    return float(np.sqrt(np.square(changes).sum())) if changes else None


def _finder(body: Body, live: Compact, doubts: list[str] | None = None) -> _Faces:
    def faces(region: Region) -> Bools:
        if doubts is not None and region.mesh != body.key:
            said = misfit(region, live.mesh)
            doubts.extend([said] if said else [])
        chosen = np.zeros(len(body.alive), dtype=np.bool_)
        chosen[region.find(body)] = True
        if not chosen.any():
            raise InputError("its region no longer exists")
        return np.asarray(chosen[live.face_ids])

    return faces


def _bearing(mesh: Mesh, measure: Measure, faces: _Faces) -> Bools:
    """(f,) the faces that a measurement hangs on."""
    match measure:
        case MeasureDistance():
            return _near(mesh, measure.a) | _near(mesh, measure.b)
        case MeasureToPlane():
            return _near(mesh, measure.point) | faces(measure.plane)
        case MeasureDiameter():
            return faces(measure.where)
        case MeasureSection():
            normal = np.array(measure.normal) / np.linalg.norm(measure.normal)
            away = (mesh.vertices @ normal - measure.distance)[mesh.faces]
            band = (away.min(axis=1) <= _BAND) & (away.max(axis=1) >= -_BAND)
            return np.asarray(band, dtype=np.bool_)
        case MeasureAngle():
            return faces(measure.first) | faces(measure.second)
        case MeasureCorner():
            return _near(mesh, measure.a) | _near(mesh, measure.corner) | _near(mesh, measure.b)
        case MeasureArea() if measure.where is not None:
            return faces(measure.where)
    return np.ones(len(mesh.faces), dtype=np.bool_)


def _taker(mesh: Mesh, measure: Measure, faces: _Faces, doubts: list[str] | None = None) -> _Taker:
    def moved(move: Floats | None) -> Mesh:
        return mesh if move is None else replace(mesh, vertices=mesh.vertices + move)

    def spot(at: Vector) -> Callable[[Floats | None], Spot]:
        found, vertex, gap = _spot(mesh, at)
        if doubts is not None and gap > _BESIDE:
            doubts.append(f"the surface is {gap:.1f} mm away from where a point was picked")
        return lambda move: found if move is None else replace(found, at=found.at + move[vertex])

    match measure:
        case MeasureDistance():
            one, other = spot(measure.a), spot(measure.b)
            return lambda move: shapes.distance(one(move), other(move))
        case MeasureToPlane():
            point, flat = spot(measure.point), faces(measure.plane)
            return lambda move: shapes.to_plane(
                point(move), shapes.plane_of(moved(move), flat, value_alone=move is not None)
            )
        case MeasureDiameter():
            round_ = faces(measure.where)
            return lambda move: shapes.region_diameter(
                moved(move), round_, value_alone=move is not None
            )
        case MeasureSection():
            plane = measure.normal, measure.distance
            # A calibration's move leaves the noise as it is.
            together = shapes.section_base(mesh, *plane)
            return lambda move: shapes.section_diameter(moved(move), *plane, measure.near, together)
        case MeasureAngle():
            sides = faces(measure.first), faces(measure.second)
            return lambda move: shapes.planes_angle(
                *(shapes.plane_of(moved(move), s, value_alone=move is not None) for s in sides)
            )
        case MeasureCorner():
            a, corner, b = (spot(at) for at in (measure.a, measure.corner, measure.b))
            return lambda move: shapes.corner_angle(a(move), corner(move), b(move))
        case MeasureArea():
            part = None if measure.where is None else faces(measure.where)
            # A calibration's move turns no face by much, and leaves fillings as they are.
            base = shapes.area_base(mesh, part)
            return lambda move: shapes.area(moved(move), part, base)
        case MeasureVolume():
            return lambda move: shapes.volume(moved(move))


def _near(mesh: Mesh, at: Vector) -> Bools:
    """(f,) faces among which the nearest one to a place is."""
    away = np.linalg.norm(mesh.vertices - np.array(at), axis=1)
    if not len(away):
        raise InputError("no surface to measure on")
    # The nearest face has a corner no further than the nearest vertex and its own longest side.
    t = mesh.triangles
    sides = np.linalg.norm(t - np.roll(t, 1, axis=1), axis=2).max(axis=1)
    return np.asarray(away[mesh.faces].min(axis=1) <= away.min() + sides, dtype=np.bool_)


def _spot(mesh: Mesh, at: Vector) -> tuple[Spot, int, float]:
    """The nearest point of the surface, as well known as the vertex nearest to it, that vertex, and
    how far off the point is, mm.
    """
    found = shapes.deviation(np.array(at)[None], submesh(mesh, _near(mesh, at)))
    gap = abs(float(found.distance[0]))
    if gap > REACH:
        raise InputError(f"the surface is {gap:.1f} mm away from where a point was picked")
    on = found.closest[0]
    vertex = int(np.linalg.norm(mesh.vertices - on, axis=1).argmin())
    return Spot.on(mesh, vertex, on), vertex, gap
