"""What a user may choose about turned parts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from turnscan.workflows._options._declare import Checked, option
from turnscan.workflows._options._section import dxf_version_option, fit_tolerance
from turnscan.workflows._options._units import SECTION_SUFFIXES, STEP_SUFFIXES

REVOLVE_SUFFIXES = (*SECTION_SUFFIXES, *STEP_SUFFIXES)
"""What a turned part is written as: the drawing of its half-section, or a solid."""


@dataclass(frozen=True)
class RevolveOptions(Checked):
    """How a turned part is measured and drawn."""

    height: tuple[float, ...] = option(
        (), "number",
        "Height at which roundness is reported, mm along the axis from the lowest measured point; "
        "may be repeated.  [default: ten, evenly]",
        many=True, unit="mm",
    )  # fmt: skip
    tolerance: float | None = fit_tolerance("the wall beyond its noise")
    dxf_version: Literal["R12", "R2010"] = dxf_version_option()
