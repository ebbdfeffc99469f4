"""What a user may choose about the search for shapes."""

from __future__ import annotations

from dataclasses import dataclass

from turnscan.workflows._options._declare import Checked, option
from turnscan.workflows._options._units import IGES_SUFFIXES, STEP_SUFFIXES

SHAPES_SUFFIXES = (".ply", ".glb", *STEP_SUFFIXES, *IGES_SUFFIXES)
"""What shapes are written as: the mesh coloured by shape, or a solid."""


@dataclass(frozen=True)
class ShapesOptions(Checked):
    """How shapes are looked for."""

    tolerance: float | None = option(
        None, "number",
        "Largest distance of a point from its shape, mm.  [default: three times its noise, at "
        "least 1/10000 of the size]",
        least=0, above=True, unit="mm",
    )  # fmt: skip
    smallest: float = option(
        0.003, "number", "Smallest shape, as a fraction of the measured area.",
        least=0, most=1,
    )  # fmt: skip
    edges: bool = option(
        False, "switch",
        "Put the true edges into the mesh that is written: where neighbouring shapes meet.",
    )  # fmt: skip
    as_measured: bool = option(
        False,
        "switch",
        "Leave each shape as fitted: adopt no relations such as parallel or coaxial.",
    )
