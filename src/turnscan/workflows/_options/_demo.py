"""What a user may choose about a demo."""

from __future__ import annotations

from dataclasses import dataclass

from turnscan.workflows._options._declare import Checked, option


@dataclass(frozen=True)
class DemoOptions(Checked):
    """The part that is scanned, and the simulated rig."""

    scene: str = option("cup", "text", "Simulated part, or mesh file.")
    rig: str = option("paper", "text", "Simulated rig: paper, modern or ciclop.")
    steps: int | None = option(
        None, "count", "Number of table positions per turn.  [default: the rig's]"
    )
    seed: int = option(7, "count", "Seed of speckle and noise.")
