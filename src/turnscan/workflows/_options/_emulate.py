"""What a user may choose about an emulated controller."""

from __future__ import annotations

from dataclasses import dataclass

from turnscan.workflows._options._declare import Checked, option


@dataclass(frozen=True)
class EmulateOptions(Checked):
    """How a controller board and a camera are emulated."""

    no_camera: bool = option(False, "switch", "Emulate the controller only.")
    hurry: float = option(1.0, "number", "Speed of the table as a multiple of a real one's.")
    seconds: float = option(
        3600.0, "number", "End automatically after this time, s.",
        least=0, above=True, most=86400.0,
    )  # fmt: skip
