"""Shapes of a part as values: what they are, how well they are known, what belongs to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints, frozen
from turnscan.shapes.primitives import _surface_kernels as surface

Kind = Literal["plane", "sphere", "cylinder", "cone", "torus"]
KINDS: tuple[Kind, ...] = ("plane", "sphere", "cylinder", "cone", "torus")
RelationKind = Literal[
    "parallel", "perpendicular", "coaxial", "equal radius", "symmetric", "circle of holes",
    "row of holes", "rectangle of holes",
]  # fmt: skip


@dataclass(frozen=True)
class Shape:
    """An analytic surface that a part of the mesh lies on."""

    kind: Kind
    point: Floats
    """(3,) mm: a point of a plane; of the axis of a cylinder or cone; the centre of a sphere or
    torus."""
    axis: Floats
    """(3,) unit vector: the outward normal of a plane, else the direction of the axis."""
    radius: float
    """mm: of a sphere or cylinder, of a cone at ``point``, of a torus' ring; 0 for a plane."""
    second: float
    """Half-angle of a cone (radians; positive where it widens along the axis), radius of a torus'
    tube (mm), else 0."""
    hollow: bool
    """Whether the material is outside: a bore, not a boss."""
    covariance: Floats
    """(7, 7) of tilt of the axis along e1 and e2 (radians), shift of the point along e1, e2 and the
    axis (mm), radius, second; 0 where a kind has no such parameter."""
    count: int
    """Measured vertices that it was fitted to."""
    area: float
    """mm² of measured surface on it."""
    rms: float
    """mm: root mean square distance of those vertices."""
    length: float
    """mm that its vertices reach along the axis; 0 for a plane and a sphere."""

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "point", frozen(self.point, (3,), "Shape.point"))
        put(self, "axis", frozen(self.axis, (3,), "Shape.axis"))
        put(self, "covariance", frozen(self.covariance, (7, 7), "Shape.covariance"))

    @property
    def numbers(self) -> Floats:
        """(10,) as the kernels take it."""
        return np.concatenate([self.point, self.axis, [self.radius, self.second, 0.0, 0.0]])

    def distances(self, points: npt.ArrayLike) -> Floats:
        """Signed distances (n,) mm of points (n, 3), positive outside of the material."""
        X = np.ascontiguousarray(points, dtype=np.float64)
        d: Floats = surface.distances(KINDS.index(self.kind), self.numbers, X)[0]
        return -d if self.hollow else d

    @property
    def axis_sigma(self) -> float:
        """Standard uncertainty of the axis' direction, radians (the worse of two tilts)."""
        return float(np.sqrt(max(self.covariance[0, 0], self.covariance[1, 1])))

    @property
    def radius_sigma(self) -> float:
        """Standard uncertainty of the radius, mm."""
        return float(np.sqrt(self.covariance[5, 5]))

    @property
    def second_sigma(self) -> float:
        """Standard uncertainty of `second`."""
        return float(np.sqrt(self.covariance[6, 6]))


@dataclass(frozen=True)
class Relation:
    """A relation of two shapes (parallel, coaxial …) that their uncertainties allow."""

    kind: RelationKind
    first: int
    second: int
    """Index of the shapes."""
    third: int | None
    """Of two symmetric planes: the shape whose axis lies between them; the third of a pattern."""
    off: float
    """How far off it they were measured: radians, or mm for radii and places."""
    sigma: float
    """Its standard uncertainty; 0 where other relations imply it."""
    rest: tuple[int, ...] = ()
    """Of a pattern of holes: the others, along it."""
    sizes: tuple[tuple[str, float, float], ...] = ()
    """Of a pattern: what it is called, its size and the standard uncertainty of that, mm."""

    @property
    def shapes(self) -> tuple[int, ...]:
        """Index of all that it relates."""
        third = () if self.third is None else (self.third,)
        return (self.first, self.second, *third, *self.rest)


@dataclass(frozen=True)
class ShapeSet:
    """The shapes of a part."""

    shapes: tuple[Shape, ...]
    """Largest first; relations adopted."""
    measured: tuple[Shape, ...]
    """The same, each on its own, before relations were adopted."""
    relations: tuple[Relation, ...]
    """The relations adopted."""
    covariance: Floats
    """(7 n, 7 n): of the parameters of all shapes together."""
    own_covariance: Floats
    """(7 n, 7 n): the same of ``measured``, before relations."""
    label: Ints
    """(v,) index of the shape that a vertex of the mesh lies on; −1 for freeform and for vertices
    that nobody measured."""
    residual: Floats
    """(v,) mm off its shape, positive outside of the material; NaN without one."""
    used: Bools
    """(v,) True for the vertices that shapes were fitted to."""
    tolerance: float
    """mm, median: how far a vertex may be off its shape."""
    coverage: float
    """Share of the measured area that lies on shapes."""

    def __post_init__(self) -> None:
        put, v = object.__setattr__, len(self.label)
        put(self, "label", frozen(self.label, (v,), "ShapeSet.label", np.int32))
        put(self, "residual", frozen(self.residual, (v,), "ShapeSet.residual", nan=True))
        put(self, "used", frozen(self.used, (v,), "ShapeSet.used", np.bool_))
        n = 7 * len(self.shapes)
        put(self, "covariance", frozen(self.covariance, (n, n), "ShapeSet.covariance"))
        own = frozen(self.own_covariance, (n, n), "ShapeSet.own_covariance")
        put(self, "own_covariance", own)

    def of(self, kind: Kind) -> Sequence[Shape]:
        """The shapes of one kind."""
        return [s for s in self.shapes if s.kind == kind]
