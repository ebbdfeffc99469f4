"""The stripes of one laser in the frames of a scan."""

from __future__ import annotations

from dataclasses import dataclass

from turnscan.arrays import Floats
from turnscan.stripes._stripe import Stripe


@dataclass(frozen=True, eq=False)
class Stripes:
    """What was seen of one laser: a stripe for each step that has one, in scan order."""

    laser: str
    steps: tuple[int, ...]
    angles: Floats
    """(s,) rad, of the table."""
    stripes: tuple[Stripe, ...]
    angle_sigma: Floats | None = None
    """(s,) rad, standard uncertainties of the angles, NaN where not known; None where none is."""

    def without(self, gone: set[int]) -> Stripes:
        """The same without these steps."""
        keep = [k for k, step in enumerate(self.steps) if step not in gone]
        return Stripes(
            self.laser,
            tuple(self.steps[k] for k in keep),
            self.angles[keep],
            tuple(self.stripes[k] for k in keep),
            None if self.angle_sigma is None else self.angle_sigma[keep],
        )
