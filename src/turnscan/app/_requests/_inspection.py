"""Requests to look at a surface: holes, defects, measurements, deviations, shapes."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from turnscan.app._protocol import Name, Opaque, Vector
from turnscan.app._requests._base import Limit, Request


class ListHoles(Request):
    """Answered by ``holes``: from the ``first`` on, the largest being number 0."""

    kind: Literal["list_holes"] = "list_holes"
    scan: Opaque
    first: Annotated[int, Field(ge=0, le=2**31)] = 0


class ListDefects(Request):
    """Answered by ``defects``."""

    kind: Literal["list_defects"] = "list_defects"
    scan: Opaque


class TakeMeasure(Request):
    """Measure, and keep it with the scan: answered by ``measures``.

    ``distance``: two places; ``angle``: three places, the second is the corner; ``to_plane``: a
    place, and a region (array faces); ``diameter``: a region, or one place whose height is that of
    the section; ``area`` and ``volume``: of the whole surface, ``area`` of a region too.
    """

    kind: Literal["measure"] = "measure"
    scan: Opaque
    what: Literal["distance", "to_plane", "diameter", "angle", "area", "volume"]
    places: Annotated[tuple[Vector, ...], Field(max_length=3)] = ()


class ForgetMeasure(Request):
    """Answered by ``measures``."""

    kind: Literal["forget_measure"] = "forget_measure"
    scan: Opaque
    measure: Opaque


class SpecifyMeasure(Request):
    """Name a measurement, and say what it is to be: answered by ``measures``.

    Limits are deviations from the nominal value, in its unit; without them it is only named.
    """

    kind: Literal["specify"] = "specify"
    scan: Opaque
    measure: Opaque
    name: Annotated[str, Field(max_length=80)] = ""
    nominal: Limit | None = None
    lower: Limit | None = None
    upper: Limit | None = None


class MeasureAgain(Request):
    """Take measurements again of which the surface was changed since: answered by ``measures``."""

    kind: Literal["measure_again"] = "measure_again"
    scan: Opaque


class ShowDeviation(Request):
    """Compare with a mesh, a CAD part or a scan: answered by ``deviation``."""

    kind: Literal["show_deviation"] = "show_deviation"
    scan: Opaque
    reference: Opaque
    """A file of the list, or a scan."""
    unit: Literal["mm", "cm", "m", "inch"] = "mm"
    """Of the reference."""
    align: Literal["none", "shape", "datums"] = "none"
    datums: Annotated[tuple[Annotated[int, Field(ge=1)], ...], Field(max_length=6)] = ()
    """Numbers of features of the reference, in the order of precedence."""
    features: bool = False
    """Whether its features and their sizes are listed."""
    tolerance_table: Opaque | None = None
    """A file of the list."""


class ShowColours(Request):
    """Colours of the surface from its texture images: answered by ``colours``."""

    kind: Literal["show_colours"] = "show_colours"
    scan: Opaque


class FindShapes(Request):
    """Find the shapes that the surface is made of: answered by ``shapes``."""

    kind: Literal["find_shapes"] = "find_shapes"
    scan: Opaque


class SaveReport(Request):
    """Write the report of all sizes and kept measurements into the folder: a job."""

    kind: Literal["save_report"] = "save_report"
    scan: Opaque
    name: Name
    suffix: Literal[".pdf", ".html", ".csv", ".json"]
