"""The figures of a design: key in JSON, label, and how to compute each."""

from __future__ import annotations

from collections.abc import Callable
from math import degrees
from typing import Any, NamedTuple

from turnscan.rig import Design, paper


class Figure(NamedTuple):
    """One line of the table."""

    key: str
    """Name in JSON, with its unit."""
    label: str
    """Name in the table, with its unit."""
    value: Callable[[Design], Any]
    """A number, or an array of no dimensions; NaN where there is none."""
    form: str = ".3g"
    """Format of the number in the table."""


GROUPS: dict[str, tuple[Figure, ...]] = {
    "Resolution": (
        Figure("delta_x_mm", "Δx at the axis, mm", lambda d: d.delta_x),
        Figure("delta_x_eq6_mm", "Δx by eq. (6) as printed, mm", lambda d: d.delta_x_eq6),
        Figure("delta_r_mm", "ΔR at the axis, mm", lambda d: d.delta_r()),
        Figure("delta_r_eq5_mm", "ΔR by eq. (5) as printed, mm", lambda d: d.delta_r_eq5),
        Figure("delta_r_rim_mm", "ΔR at R_max, mm", lambda d: d.delta_r_rim),
        Figure("delta_r_over_r_max", "ΔR at the axis / R_max", lambda d: d.delta_r() / d.r_max),
        Figure(
            "delta_r_rim_over_r_max",
            "ΔR at R_max / R_max",
            lambda d: d.delta_r_rim / d.r_max,
        ),
    ),
    "Working volume": (
        Figure("r_max_mm", "R_max, mm", lambda d: d.r_max, ".1f"),
        Figure("r_min_mm", "R at the picture's other edge, mm", lambda d: d.r_min, ".1f"),
        Figure("blind_columns", "columns that never meet the sheet", lambda d: d.blind_columns, ""),
        Figure("h_max_mm", "H_max, seen at R_max, mm", lambda d: d.h_max, ".1f"),
        Figure(
            "h_max_printed_mm", "H_max by the printed formula", lambda d: d.h_max_printed, ".1f"
        ),
        Figure("height_axis_mm", "height at the axis, mm", lambda d: d.visible_height(0), ".1f"),
        Figure("depth_of_field_mm", "in focus within ± mm", lambda d: d.depth_of_field, ".1f"),
        Figure("gamma_max_deg", "γ_max, half angle, °", lambda d: degrees(d.gamma_max), ".2f"),
        Figure("beta_max_deg", "β_max, full angle, °", lambda d: degrees(d.beta_max), ".2f"),
        Figure("magnification_paper", "m = f/L", lambda d: d.magnification_paper, ".4f"),
        Figure("magnification", "m = f/(L−f)", lambda d: d.magnification, ".4f"),
    ),
    "Distance between points": (
        Figure(
            "circumferential_mm",
            "circumferential at R_max, mm",
            lambda d: paper.circumferential_distance(d.r_max, d.step),
        ),
        Figure("vertical_mm", "vertical at R_max, mm", lambda d: d.delta_z(d.r_max)),
        Figure("vertical_axis_mm", "vertical at the axis, mm", lambda d: d.delta_z(0)),
        Figure("sagitta_mm", "bulge between profiles, R_max, mm", lambda d: d.sagitta(d.r_max)),
        Figure("corner_cut_mm", "90° corner cut, worst, R_max", lambda d: d.corner_cut(d.r_max)),
        Figure("corner_cut_rms_mm", "90° corner cut, rms", lambda d: d.corner_cut_rms(d.r_max)),
        Figure("step_error_mm", "5 % step error at R_max, mm", lambda d: d.step_error(d.r_max)),
        Figure(
            "recommended_step_deg",
            "step for parts of R_max/2: at most °",
            lambda d: degrees(d.recommended_step(d.r_max / 2)),
        ),
    ),
    "Error of one point (rms, one row, at the axis)": (
        Figure("camera_noise_px", "camera noise (Cramér-Rao), px", lambda d: d.camera_noise),
        Figure("camera_noise_mm", "camera noise, mm of R", lambda d: d.camera_noise * d.delta_r()),
        Figure("pixel_contrast", "speckle contrast in a pixel", lambda d: d.pixel_contrast),
        Figure("dorsch_mm", "Dorsch limit of depth, mm", lambda d: d.dorsch_limit),
        Figure("speckle_noise_px", "speckle of the line, px", lambda d: d.speckle_noise()),
        Figure("speckle_noise_mm", "speckle, mm of R", lambda d: d.speckle_noise() * d.delta_r()),
        Figure(
            "speckle_noise_3_rows_mm",
            "speckle, three rows averaged, mm",
            lambda d: d.speckle_noise(3) * d.delta_r(),
        ),
        Figure("noise_mm", "camera and speckle, mm of R", lambda d: d.noise()),
        Figure("decorrelation_mm", "motion to new speckle, mm", lambda d: d.decorrelation_step),
    ),
}


def figures(design: Design) -> dict[str, float | int]:
    """Every figure of a design by its JSON key, unrounded."""
    values = ((f.key, f.value(design)) for group in GROUPS.values() for f in group)
    return {"theta_deg": theta_deg(design.theta)} | {
        k: v if isinstance(v, int) else float(v) for k, v in values
    }


def theta_deg(theta: float) -> float:
    """Degrees of an angle that was given in degrees: 60, not 59.99999999999999."""
    return round(degrees(theta), 12)
