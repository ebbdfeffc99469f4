"""Messages of what is found in a surface: holes, defects, measurements, deviations, shapes."""

from __future__ import annotations

from typing import Literal

from turnscan.app._protocol._base import Count, Model, Opaque, Remark, Vector
from turnscan.app._protocol._verbs import ResultTable


class HoleEntry(Model):
    """A hole in the surface. Its border is the array ``loop_{hole}``, f32 (m, 3)."""

    hole: Count
    size: float
    perimeter: float
    area: float
    centre: Vector
    cause: str | None
    cause_text: str


class Defect(Model):
    """A remark with its place on the part and in the scan, where it has one."""

    remark: Remark
    place: Vector | None
    grid: Count | None
    step: Count | None
    line: Count | None


class Measure(Model):
    """A measurement that is kept with the scan."""

    measure: Opaque
    what: str
    value: float
    unit: Literal["mm", "mm²", "mm³", "°"]
    uncertainty: float | None
    """k = 2."""
    places: list[Vector]
    text: str
    name: str = ""
    """That of the dimension, where it has one."""
    nominal: float | None = None
    lower: float | None = None
    """Limits of the deviation from the nominal value."""
    upper: float | None = None
    verdict: Literal["pass", "fail", "undecided"] | None = None
    """By ISO 14253-1, with the uncertainty; None without limits, or where outdated; undecided where
    in doubt."""
    outdated: bool = False
    """The surface was changed since it was measured."""
    noise: float | None
    """Standard uncertainty from the points' noise; of a volume that from all causes."""
    shared: float | None
    """Standard uncertainty from the calibration, table axis included; None where not known."""
    complete: bool
    """Whether that was worked out; ``measure_again`` does it."""
    doubt: str = ""
    """What speaks against it being of the same part as where it was made."""


class FeatureShown(Model):
    """A feature of a reference, and how what was measured of it lies to it, mm."""

    number: Count
    nominal: str
    """In words."""
    points: Count
    mean: float
    rms: float


class SizeCheck(Model):
    """A size of features of a reference, or the profile of one; mm, or degrees."""

    features: list[Count]
    quantity: str
    nominal: float
    measured: float
    uncertainty: float | None
    """k = 2."""
    unit: str
    tolerance: str
    """As the table has it; empty where it says nothing."""
    limits: tuple[float, float] | None
    """Of the deviation from nominal."""
    verdict: Literal["pass", "fail", "undecided", ""]
    """By ISO 14253-1."""


class Holes(Model):
    """Some of the holes, the largest first."""

    kind: Literal["holes"] = "holes"
    id: Count
    scan: Opaque
    revision: Count
    many: Count
    """How many there are in all."""
    holes: list[HoleEntry]


class Defects(Model):
    """What is wrong with a scan, and where."""

    kind: Literal["defects"] = "defects"
    id: Count
    scan: Opaque
    revision: Count
    defects: list[Defect]


class Measures(Model):
    """The measurements kept with a scan; ``id`` where one was asked for."""

    kind: Literal["measures"] = "measures"
    id: Count | None
    scan: Opaque
    measures: list[Measure]


class DeviationShown(Model):
    """How far the surface lies from a reference. Array ``distance`` (v,) mm: f32, of each vertex,
    positive outside, NaN where it was not measured or the reference says nothing."""

    kind: Literal["deviation"] = "deviation"
    id: Count
    scan: Opaque
    revision: Count
    reference: str
    vertices: Count
    mean: float
    rms: float
    p95: float
    worst: float
    alignment: str
    """How the surface was brought onto the reference, in words."""
    findings: list[Remark]
    features: list[FeatureShown]
    checks: list[SizeCheck]
    verdict: Literal["pass", "fail", "undecided", ""]
    """Whether all tolerances are kept; empty without any."""


class ShapeEntry(Model):
    """A shape of the surface."""

    text: str
    """With its sizes and their uncertainties."""
    place: Vector
    """Its middle, mm."""
    size: float
    """mm: how far it reaches."""


class ShapesShown(Model):
    """The shapes of a surface. Array ``shape`` i32 (v,): of each vertex the index of its shape, −1
    for freeform and for what was not measured."""

    kind: Literal["shapes"] = "shapes"
    id: Count
    scan: Opaque
    revision: Count
    shapes: list[ShapeEntry]
    coverage: float
    """Share of the measured area that lies on shapes."""
    relations: list[str]
    dimensions: ResultTable
    findings: list[Remark]
