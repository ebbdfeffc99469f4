"""A design in words and numbers: tables to read, and everything as JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

from turnscan.rig import Design, disagreements, paper, table_1, table_1_designs, table_1_text
from turnscan.workflows._design._figures import GROUPS, figures, theta_deg

_ANGLES_ABREAST = 7
_PER_MM = {"um": 1e-3, "nm": 1e-6}
_TABLE_1 = {
    "Δx [mm]": "delta_x",
    "ΔR [mm]": "delta_r",
    "R_max [mm]": "r_max",
    "H_max [mm]": "h_max",
    "ΔR/R_max": "ratio",
}


def design_lines(designs: Sequence[Design]) -> Iterable[str]:
    """The figures of designs that differ in their angle only, as lines of a table."""
    d = designs[0]
    yield (
        f"L {d.distance:g} mm, f {d.focal:g} mm, {d.columns}×{d.rows} pixels of "
        f"{d.pixel_width / _PER_MM['um']:g}×{d.pixel_height / _PER_MM['um']:g} µm, "
        f"step {math.degrees(d.step):g}°, pan {math.degrees(d.pan):g}°, "
        f"laser offset {d.offset:g} mm"
    )
    yield (
        f"f/{d.f_number:g}, {d.wavelength / _PER_MM['nm']:g} nm, stripe σ {d.stripe_sigma:g} px, "
        f"peak {d.electrons:g} e⁻, read noise {d.read_noise:g} e⁻, "
        f"speckle contrast {d.speckle_contrast:g}"
    )
    for i in range(0, len(designs), _ANGLES_ABREAST):
        yield ""
        yield from _block(designs[i : i + _ANGLES_ABREAST])


def _block(designs: Sequence[Design]) -> Iterable[str]:
    values = [figures(d) for d in designs]
    width = max(len(f.label) for group in GROUPS.values() for f in group) + 2
    yield f"{'θ':<{width}}" + "".join(f"{math.degrees(d.theta):>9.4g}°" for d in designs)
    for title, group in GROUPS.items():
        yield title
        for f in group:
            cells = ("—" if math.isnan(v[f.key]) else format(v[f.key], f.form) for v in values)
            yield f"  {f.label:<{width - 2}}" + "".join(f"{c:>9} " for c in cells).rstrip()


def design_body(designs: Sequence[Design]) -> dict[str, Any]:
    """The figures of designs and the designs themselves, unrounded, for JSON."""
    return {"rows": [figures(d) for d in designs], "designs": [asdict(d) for d in designs]}


def paper_lines() -> Iterable[str]:
    """The paper's Table 1, the text around it, and where print and equations disagree."""
    body = paper_body()
    angles = [f"{row['theta_deg']:.0f}°" for row in body["rows"]]
    yield "Table 1, as the paper prints it (L 500 mm, f 12.5 mm, 640×480 pixels of 11×9 µm)"
    yield f"{'θ':<12}" + "".join(f"{a:>8}" for a in angles)
    for label, name in _TABLE_1.items():
        yield f"{label:<12}" + "".join(f"{cell:>8}" for cell in table_1_text(name))
    yield ""
    yield "The text around it"
    yield (
        f"  γ_max {body['gamma_max_deg']:.1f}°, β_max {body['beta_max_deg']:.1f}° (8); densest "
        f"grid {body['grid_profiles']}×{body['grid_points']} points"
    )
    for theta, at in body["densest_grid"].items():
        yield (
            f"  θ = {theta}°: points {at['circumferential_mm']:.1f} mm apart around, "
            f"{at['vertical_mm']:.2f} mm up"
        )
    yield ""
    yield "Where the print and the printed equations disagree"
    for d in disagreements():
        yield f"  {d.message}"


def paper_body() -> dict[str, Any]:
    """The same as numbers, for JSON."""
    designs, rows = table_1_designs(), table_1()
    d = designs[0]
    grid = {
        f"{math.degrees(row.theta):.0f}": {
            "circumferential_mm": float(paper.circumferential_distance(row.r_max, d.step)),
            "vertical_mm": float(paper.vertical_distance(row.h_max, d.rows)),
            "radius_over_resolution": 1 / row.ratio,
        }
        for row in (rows[0], rows[-1])
    }
    return {
        "rows": [
            {
                "theta_deg": theta_deg(r.theta),
                "delta_x_mm": r.delta_x,
                "delta_r_mm": r.delta_r,
                "r_max_mm": r.r_max,
                "h_max_mm": r.h_max,
                "delta_r_over_r_max": r.ratio,
            }
            for r in rows
        ],
        "printed": {name: table_1_text(name) for name in _TABLE_1.values()},
        "disagreements": [asdict(x) for x in disagreements()],
        "gamma_max_deg": math.degrees(d.gamma_max),
        "beta_max_deg": math.degrees(d.beta_max),
        "grid_profiles": round(2 * math.pi / d.step),
        "grid_points": d.rows,
        "densest_grid": grid,
        "general_model": [figures(x) for x in designs],
    }


def without_nan(value: Any) -> Any:
    """JSON knows no NaN: where there is no number, null."""
    if isinstance(value, dict):
        return {k: without_nan(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(v) for v in value]
    return None if isinstance(value, float) and math.isnan(value) else value
