"""What a user may choose about a measurement."""

from __future__ import annotations

from dataclasses import dataclass

from turnscan.workflows._options._declare import Checked, option


@dataclass(frozen=True)
class MeasureOptions(Checked):
    """What to measure besides size and volume."""

    sizes: bool = option(
        False, "switch",
        "Find the shapes of the part and list every size: distances of parallel sides, diameters, "
        "angles, positions of holes, step heights, wall thickness, flatness, roundness, "
        "parallelism, perpendicularity, run-out.  [default: where nothing else is asked for]",
    )  # fmt: skip
    planes: bool = option(
        False, "switch", "Find planar faces of the part and the angles between them."
    )
    tolerance: float | None = option(
        None, "number",
        "Largest distance of a point from its plane, mm.  [default: three times the noise of the "
        "surface]",
        least=0, above=True, unit="mm",
    )  # fmt: skip
    smallest: float = option(
        0.02, "number", "Smallest planar face, as a fraction of the total area.", least=0, most=1
    )
    sphere: bool = option(False, "switch", "Fit a sphere to all measured points.")
    cylinder: bool = option(False, "switch", "Fit a cylinder to all measured points.")

    @property
    def every_size(self) -> bool:
        """Whether every size is listed."""
        return self.sizes or not (self.planes or self.sphere or self.cylinder)
