"""What a user may choose about sections."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from turnscan.workflows._declare import Checked, option


@dataclass(frozen=True)
class SectionOptions(Checked):
    """Where a part is cut, and how the sections are drawn."""

    plane: tuple[str, ...] = option(
        (), "text",
        "Cutting plane: z=20, x=0, z=10:100:10 (from, to, step), or nx,ny,nz,distance, in mm; "
        "may be repeated.",
        many=True,
    )  # fmt: skip
    half_plane_deg: tuple[float, ...] = option(
        (), "number",
        "Cut along the half-plane from the rotation axis at this angle, degrees; may be repeated.",
        many=True, unit="°",
    )  # fmt: skip
    silhouette: tuple[str, ...] = option(
        (), "text",
        "Draw the outline of the part as seen from x, y, z, -x, -y, -z, or a direction nx,ny,nz; "
        "may be repeated.",
        many=True,
    )  # fmt: skip
    unrolled: bool = option(
        False, "switch",
        "Draw the outer surface unrolled about the rotation axis: its radius over angle and "
        "height, as lines of equal radius and a colour map.",
    )  # fmt: skip
    tolerance: float | None = option(
        None, "number",
        "Largest deviation of fitted lines and arcs from the points beyond their noise, mm.  "
        "[default: three times the noise, at least 1/10000 of the size]",
        least=0, above=True, unit="mm",
    )  # fmt: skip
    dxf_version: Literal["R12", "R2010"] = option(
        "R2010", "choice",
        "DXF version; R12 has no splines and takes polylines in their place.",
        choices=("R12", "R2010"),
    )  # fmt: skip
