"""What a user may choose about a comparison."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from turnscan.workflows._options._declare import Checked, option
from turnscan.workflows._options._units import UNITS

Way = Literal["none", "shape", "datums"]
MAP_SUFFIXES = (".ply", ".glb")
"""What a surface coloured by deviation is written as."""


@dataclass(frozen=True)
class CompareOptions(Checked):
    """How a measured surface is compared with its reference."""

    align: Way = option(
        "none", "choice",
        "How the measured surface is brought onto the reference: not at all, by its shape, or by "
        "datum features of the reference.",
        choices=("none", "shape", "datums"),
    )  # fmt: skip
    datums: tuple[int, ...] = option(
        (), "count",
        "Number of a datum feature of the reference, in the order of precedence; may be repeated.",
        least=1, many=True,
    )  # fmt: skip
    features: bool = option(
        False, "switch",
        "Tell the planes, cylinders, spheres, cones and tori of the reference one by one, and "
        "their sizes against the nominal ones.",
    )  # fmt: skip
    tolerances: tuple[float, ...] = option(
        (0.05, 0.1, 0.2), "number",
        "Tolerance for precision, completeness and F-score, mm; may be repeated.",
        least=0, above=True, many=True, unit="mm",
    )  # fmt: skip
    samples: int = option(
        50_000, "count", "Number of samples on the reference, for completeness.",
        least=100, most=2_000_000,
    )  # fmt: skip
    unit: str = option(
        "mm", "choice", "Unit of the measured mesh file.", choices=tuple(UNITS)
    )  # fmt: skip
    reference_unit: str = option(
        "mm", "choice", "Unit of the reference's mesh file.", choices=tuple(UNITS)
    )
    settings: str = option(
        "own", "text",
        "Where a scan is compared, the settings it is reconstructed with: its own, default, or a "
        "named set in it.",
    )  # fmt: skip
    reference_settings: str = option(
        "own", "text", "The same of the reference, where that is a scan."
    )  # fmt: skip
    limit: float | None = option(
        None, "number",
        "Deviation at the ends of the colour map, mm.  [default: from the deviations]",
        least=0, above=True, unit="mm",
    )  # fmt: skip
