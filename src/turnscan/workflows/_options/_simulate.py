"""What a user may choose about a scan by a simulated rig."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from turnscan.workflows._options import _choices as choices
from turnscan.workflows._options._declare import Checked, option

if TYPE_CHECKING:
    from turnscan.scan import Keep


@dataclass(frozen=True)
class SimulateOptions(Checked):
    """How a part is scanned by a simulated rig; None leaves it to the scene's address."""

    rig: str | None = option(
        None, "text", "Simulated rig: paper, modern or ciclop.  [default: paper]"
    )
    theta_deg: float | None = option(
        None, "number", "Triangulation angle, degrees.  [default: the rig's]"
    )
    lasers: int | None = option(
        None, "count", "Number of lasers, 1 or 2.  [default: what the scene needs]"
    )
    steps: int | None = option(
        None, "count", "Number of table positions per turn.  [default: the rig's]"
    )
    tip_deg: float | None = option(None, "number", "Tilt of the part, degrees: another pose.")
    seed: int | None = option(None, "count", "Seed of speckle and noise.  [default: 0]")
    exposure: float | None = option(None, "number", "Exposure time, s.  [default: the rig's]")
    texture: float | None = option(
        None, "number", "Also capture laser-off texture images, with this exposure time, s."
    )
    texture_every: int = option(1, "count", "Capture a texture image every N steps.", least=1)
    keep: Keep = option(
        "sparse", "choice", "Pixels stored in a scan file: those around the stripe, or all.",
        choices=choices.KEEP,
    )  # fmt: skip
    no_speckle: bool = option(False, "switch", "Simulate a laser without speckle.")
    perfect: bool = option(
        False, "switch", "Simulate an ideal rig: thin sheet, no speckle, blur or noise, 16 bits."
    )

    def changes(self) -> dict[str, Any]:
        """What they change of the bench that the scene's address describes."""
        given: dict[str, Any] = {
            "rig": self.rig,
            "lasers": self.lasers,
            "steps": self.steps,
            "seed": self.seed,
            "theta": None if self.theta_deg is None else math.radians(self.theta_deg),
            "tip": None if self.tip_deg is None else math.radians(self.tip_deg),
            "waves": "diffraction" if self.no_speckle else None,
            "perfect": self.perfect or None,
        }
        return {name: value for name, value in given.items() if value is not None}
