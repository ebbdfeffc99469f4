"""``turnscan design``: what a rig will resolve, before it is built."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import click

from turnscan.cli._design_figures import GROUPS, figures, theta_deg
from turnscan.cli._numbers import Finite
from turnscan.cli._output import check_output, write_atomically
from turnscan.errors import InputError
from turnscan.rig import (
    PRESET_NAMES,
    Design,
    design_preset,
    disagreements,
    paper,
    rig_to_json,
    table_1,
    table_1_designs,
    table_1_text,
)

_MOST_ANGLES = 100
_ANGLES_ABREAST = 7
_PER_MM = {"um": 1e-3, "nm": 1e-6}
_TABLE_1 = {
    "Δx [mm]": "delta_x",
    "ΔR [mm]": "delta_r",
    "R_max [mm]": "r_max",
    "H_max [mm]": "h_max",
    "ΔR/R_max": "ratio",
}


@click.command("design")
@click.option(
    "--paper",
    "as_paper",
    is_flag=True,
    help="The paper's Table 1, and where its print and its equations disagree.",
)
@click.option(
    "--preset",
    type=click.Choice(PRESET_NAMES),
    help="The rig to start from; the other options change it.  [default: modern]",
)
@click.option(
    "--theta-deg",
    multiple=True,
    metavar="ANGLES",
    help="Angle of triangulation: 22.5, a list 10,20,30 or a range FROM:TO:STEP; repeatable.",
)
@click.option("--distance", type=Finite(), metavar="MM", help="Camera to rotation axis, L.")
@click.option("--focal", type=Finite(), metavar="MM", help="Principal distance of the lens, f.")
@click.option("--pixel-um", metavar="W[,H]", help="Pixel pitch, micrometres.")
@click.option("--sensor", metavar="COLSxROWS", help="Pixels across and along the laser line.")
@click.option("--pan-deg", type=Finite(), help="Camera turned off the axis, towards the laser.")
@click.option("--laser-offset", type=Finite(), metavar="MM", help="Laser line misses the axis by.")
@click.option("--f-number", type=Finite(), help="Aperture of the lens, N.")
@click.option("--step-deg", type=Finite(), help="Table angle between two profiles.")
@click.option("--wavelength-nm", type=Finite(), help="Wavelength of the laser.")
@click.option("--stripe-sigma-px", type=Finite(), help="RMS width of the stripe in the picture.")
@click.option("--electrons", type=Finite(), help="Peak signal of the stripe, electrons.")
@click.option("--read-noise", type=Finite(), help="Noise of a dark pixel, electrons.")
@click.option("--speckle-contrast", type=Finite(), help="1 polarised; 0.71 depolarised; 0 none.")
@click.option("--json", "as_json", is_flag=True, help="Everything, unrounded, as JSON.")
@click.option(
    "--picture",
    type=click.Path(path_type=Path),
    metavar="OUT.png",
    help="Working volume, resolution and error as a picture (of the first angle).",
)
@click.option(
    "--rig",
    "rig_path",
    type=click.Path(path_type=Path),
    metavar="RIG.json",
    help="Also write this geometry as a rig, as if it were calibrated; one angle only.",
)
def verb(
    as_paper: bool, as_json: bool, picture: Path | None, rig_path: Path | None, **given: Any
) -> None:
    """Resolution, working volume and physical limits of a rig before it is built.

    Lengths in mm. Without options: a 5 megapixel rig at 30°.
    """
    changes = {k: v for k, v in given.items() if v not in (None, ())}
    if as_paper and changes:
        option = "--" + next(iter(changes)).replace("_", "-")
        raise InputError(
            f"--paper prints the paper's own rig, {option} cannot change it",
            hint="use --preset paper to start from that rig",
        )
    if picture is not None:
        check_output(picture, (".png",))
    if rig_path is not None:
        check_output(rig_path, (".json",))
    designs = table_1_designs() if as_paper else _designs(**changes)
    if picture is not None:
        from turnscan.cli._design_picture import draw

        write_atomically(picture, draw(designs))
    if rig_path is not None:
        if len(designs) > 1:
            raise InputError(
                f"--rig: a rig has one angle, here are {len(designs)}", hint="give one --theta-deg"
            )
        write_atomically(rig_path, rig_to_json(designs[0].rig()).encode())
    if as_json:
        body = _paper_body() if as_paper else _body(designs)
        click.echo(json.dumps(_without_nan(body), indent=2, ensure_ascii=False, allow_nan=False))
    else:
        click.echo("\n".join(_paper_lines() if as_paper else _lines(designs)))
        if picture is not None:
            click.echo(f"picture of θ = {math.degrees(designs[0].theta):g}°: {picture}")


# ---- what was asked ------------------------------------------------------------------------------


def _designs(preset: str = "modern", **given: Any) -> tuple[Design, ...]:
    fields: dict[str, Any] = {
        name: given[name]
        for name in (
            "distance",
            "focal",
            "f_number",
            "electrons",
            "read_noise",
            "speckle_contrast",
        )
        if name in given
    }
    if "pan_deg" in given:
        fields["pan"] = math.radians(given["pan_deg"])
    if "step_deg" in given:
        fields["step"] = math.radians(given["step_deg"])
    if "laser_offset" in given:
        fields["offset"] = given["laser_offset"]
    if "stripe_sigma_px" in given:
        fields["stripe_sigma"] = given["stripe_sigma_px"]
    if "wavelength_nm" in given:
        fields["wavelength"] = given["wavelength_nm"] * _PER_MM["nm"]
    if "pixel_um" in given:
        fields["pixel_width"], fields["pixel_height"] = _pixel(given["pixel_um"])
    if "sensor" in given:
        fields["columns"], fields["rows"] = _sensor(given["sensor"])
    base = design_preset(preset)
    thetas = [math.radians(t) for text in given.get("theta_deg", ()) for t in _angles(text)]
    if len(thetas) > _MOST_ANGLES:
        raise InputError(f"--theta-deg: {len(thetas)} angles, at most {_MOST_ANGLES}")
    return tuple(replace(base, theta=t, **fields) for t in thetas or [base.theta])


def _angles(text: str) -> list[float]:
    parts = text.split(":")
    numbers = [_number(p, "--theta-deg", text) for p in (parts if len(parts) == 3 else [])]
    if not numbers:
        return [_number(p, "--theta-deg", text) for p in text.split(",")]
    first, last, step = numbers
    if not (step > 0 and last >= first) or (last - first) / step >= _MOST_ANGLES:
        raise InputError(
            f"--theta-deg: the range {text!r} does not run upwards in 1 to {_MOST_ANGLES} angles",
            hint="write FROM:TO:STEP, like 10:60:5",
        )
    # A range reaches its end although 0.1 is not a binary number.
    count = math.floor((last - first) / step + 1e-9) + 1
    return [first + i * step for i in range(count)]


def _pixel(text: str) -> tuple[float, float]:
    sizes = [_number(p, "--pixel-um", text) * _PER_MM["um"] for p in text.split(",")]
    if len(sizes) > 2:
        raise InputError(f"--pixel-um: {text!r} is not WIDTH or WIDTH,HEIGHT")
    return sizes[0], sizes[-1]


def _sensor(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"([0-9]{1,9})[x×]([0-9]{1,9})", text.strip())
    if match is None:
        raise InputError(f"--sensor: {text!r} is not COLUMNSxROWS", hint="like 2448x2048")
    return int(match[1]), int(match[2])


def _number(text: str, option: str, whole: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{option}: {text!r} in {whole!r} is not a number")
    return value


# ---- what is printed -----------------------------------------------------------------------------


def _lines(designs: Sequence[Design]) -> Iterable[str]:
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


def _body(designs: Sequence[Design]) -> dict[str, Any]:
    return {"rows": [figures(d) for d in designs], "designs": [asdict(d) for d in designs]}


def _paper_lines() -> Iterable[str]:
    body = _paper_body()
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


def _paper_body() -> dict[str, Any]:
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


def _without_nan(value: Any) -> Any:
    """JSON knows no NaN: where there is no number, null."""
    if isinstance(value, dict):
        return {k: _without_nan(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(v) for v in value]
    return None if isinstance(value, float) and math.isnan(value) else value
