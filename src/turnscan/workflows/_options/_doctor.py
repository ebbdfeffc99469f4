"""What a user may choose about an examination of the devices."""

from __future__ import annotations

from dataclasses import dataclass

from turnscan.workflows._options._declare import Checked, option


@dataclass(frozen=True)
class DoctorOptions(Checked):
    """How camera, lasers and table are looked over; None leaves it to the devices."""

    exposure: float | None = option(
        None, "number", "Exposure time, s.  [default: the simulated rig's, or 0.02]"
    )
    gain: float = option(1.0, "number", "Camera gain, factor.")
    still: bool = option(False, "switch", "Leave the table at rest; skip the checks that turn it.")
    verified_within: float = option(
        90.0, "number", "Age in days above which a verification is outdated.", least=0, above=True
    )
