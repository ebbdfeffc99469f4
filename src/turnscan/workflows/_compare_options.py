"""What a user may choose about a comparison."""

from __future__ import annotations

from dataclasses import dataclass

from turnscan.workflows._declare import Checked, option
from turnscan.workflows._units import UNITS


@dataclass(frozen=True)
class CompareOptions(Checked):
    """How a measured surface is compared with its reference."""

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
    limit: float | None = option(
        None, "number",
        "Deviation at the ends of the colour map, mm.  [default: from the deviations]",
        least=0, above=True, unit="mm",
    )  # fmt: skip
