"""What a user may choose about sections."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from turnscan.workflows._options._declare import Checked, option


def fit_tolerance(misfit: str) -> Any:
    """How far fitted lines and arcs may be off, mm."""
    return option(
        None, "number",
        f"Largest deviation of fitted lines and arcs from {misfit}, mm.  "
        "[default: three times the noise, at least 1/10000 of the size]",
        least=0, above=True, unit="mm",
    )  # fmt: skip


def dxf_version_option() -> Any:
    """The version of a DXF with sections."""
    return option(
        "R2010", "choice",
        "DXF version; R12 has no splines and takes polylines in their place.",
        choices=("R12", "R2010"),
    )  # fmt: skip


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
    tolerance: float | None = fit_tolerance("the points beyond their noise")
    dxf_version: Literal["R12", "R2010"] = dxf_version_option()
