"""What a user may choose about turned parts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from turnscan.workflows._declare import Checked, option
from turnscan.workflows._units import SECTION_SUFFIXES, STEP_SUFFIXES

REVOLVE_SUFFIXES = (*SECTION_SUFFIXES, *STEP_SUFFIXES)
"""What a turned part is written as: the drawing of its half-section, or a solid."""


@dataclass(frozen=True)
class RevolveOptions(Checked):
    """How a turned part is measured and drawn."""

    height: tuple[float, ...] = option(
        (), "number",
        "Height at which roundness is told, mm along the axis from the lowest measured point; may "
        "be repeated.  [default: ten, evenly]",
        many=True, unit="mm",
    )  # fmt: skip
    tolerance: float | None = option(
        None, "number",
        "Largest deviation of fitted lines and arcs from the wall beyond its noise, mm.  "
        "[default: three times the noise, at least 1/10000 of the size]",
        least=0, above=True, unit="mm",
    )  # fmt: skip
    dxf_version: Literal["R12", "R2010"] = option(
        "R2010", "choice",
        "DXF version; R12 has no splines and takes polylines in their place.",
        choices=("R12", "R2010"),
    )  # fmt: skip
