"""What a user may choose about range scans, and about several poses of a part."""

from __future__ import annotations

from dataclasses import dataclass

from turnscan.workflows._options._declare import Checked, option
from turnscan.workflows._options._units import UNITS


@dataclass(frozen=True)
class RangeScanOptions(Checked):
    """How range scans of another scanner are read."""

    unit: str = option(
        "m", "choice", "Unit of range scans (.conf and .ply); results are always mm.",
        choices=tuple(UNITS),
    )  # fmt: skip


@dataclass(frozen=True)
class JoinOptions(RangeScanOptions):
    """How poses find each other."""

    markers: float | None = option(
        None, "number",
        "Diameter of three or more marker spheres fixed to the part, mm; they are removed from "
        "the result.",
        least=0, above=True, unit="mm",
    )  # fmt: skip
