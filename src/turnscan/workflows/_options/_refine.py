"""What a user may choose about the refinement of a rig."""

from __future__ import annotations

from dataclasses import dataclass

from turnscan.workflows._options._declare import Checked, option


@dataclass(frozen=True)
class RefineOptions(Checked):
    """What may move, and what is known of the part."""

    sphere: float | None = option(
        None, "number",
        "Diameter of the sphere that is the part, mm: it gives the scale.",
        least=0, above=True,
    )  # fmt: skip
    sphere_sigma: float = option(
        0.01, "number",
        "Standard uncertainty of the given diameter, or of the longest side of a drawn part, mm.",
        least=0, above=True,
    )  # fmt: skip
    body: str | None = option(
        None, "text",
        "Another form that is the part, tilted: cylinder, cone, or a sphere of unknown size; with "
        "a diameter (cylinder:40.02) or half angle (cone:15) that is known.",
    )  # fmt: skip
    camera: bool = option(
        False, "switch",
        "Let the camera move, too, within its uncertainty; it always does where it was calibrated "
        "together with the rest.",
    )  # fmt: skip
    table_only: bool = option(
        False, "switch", "Hold laser sheets and axis; estimate the table's errors alone."
    )
