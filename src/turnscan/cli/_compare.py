"""``turnscan compare``: a measured mesh against a reference."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from turnscan.cli._input import UNITS, read_mesh_file
from turnscan.cli._numbers import Finite
from turnscan.errors import InputError

if TYPE_CHECKING:
    from turnscan.shapes import Deviation

Row = tuple[float, float, float]
"""tolerance mm, precision, completeness"""


@click.command(name="compare")
@click.argument("measured", type=click.Path(path_type=Path))
@click.argument("reference", type=click.Path(path_type=Path))
@click.option(
    "--tolerance",
    "tolerances",
    type=Finite(min=0, min_open=True),
    multiple=True,
    default=(0.05, 0.1, 0.2),
    show_default=True,
    help="mm at which precision, completeness and F-score are given; may be repeated",
)
@click.option("--samples", type=click.IntRange(100, 2_000_000), default=50_000, show_default=True)
@click.option("--picture", type=click.Path(path_type=Path), help="deviation as a colour map, PNG")
@click.option("--limit", type=Finite(min=0, min_open=True), help="mm at the map's ends")
@click.option("--unit", type=click.Choice(list(UNITS)), default="mm", help="unit of MEASURED")
@click.option("--reference-unit", type=click.Choice(list(UNITS)), default="mm")
@click.option("--json", "as_json", is_flag=True, help="the figures as JSON, unrounded")
def verb(
    measured: Path,
    reference: Path,
    tolerances: tuple[float, ...],
    samples: int,
    picture: Path | None,
    limit: float | None,
    unit: str,
    reference_unit: str,
    as_json: bool,
) -> None:
    """How far MEASURED lies from REFERENCE, and how much of REFERENCE was measured.

    Both are meshes (STL, PLY, OBJ, 3MF, GLB, DXF) in the same frame. Precision is the share of the
    measured vertices within the tolerance of the reference; completeness the share of the
    reference's area within the tolerance of the measured mesh. Faces marked as not measured do
    not count, nor do vertices off the end of an open reference.
    """
    from turnscan.cli._output import check_output, write_atomically
    from turnscan.shapes import deviation, sample_surface
    from turnscan.surface import submesh

    if picture is not None:
        check_output(picture, (".png",), [measured, reference])
    got, truth = read_mesh_file(measured, unit), read_mesh_file(reference, reference_unit)
    if not len(got.faces):
        raise InputError(f"{measured}: no faces", hint="compare a mesh, not a cloud of points")
    if got.measured is not None:
        got = submesh(got, got.measured)
    every = deviation(got.vertices, truth)
    out = every.covered()
    back = deviation(sample_surface(truth, samples), got)
    rows = [(t, out.within(t), back.within(t)) for t in tolerances]
    if picture is not None:
        from turnscan.cli._deviation_map import deviation_figure
        from turnscan.cli._html import png

        write_atomically(picture, png(deviation_figure(got, every, limit)))
    click.echo(_json(out, rows) if as_json else _text(out, rows))


def _f_score(precision: float, completeness: float) -> float:
    both = precision + completeness
    return 2 * precision * completeness / both if both > 0 else 0.0


def _json(out: Deviation, rows: list[Row]) -> str:
    figures = {
        "vertices": len(out.distance),
        "mean_mm": out.mean,
        "rms_mm": out.rms,
        "p95_mm": out.quantile(0.95),
        "max_mm": out.quantile(1.0),
        "tolerances": [
            {"tolerance_mm": t, "precision": p, "completeness": c, "f_score": _f_score(p, c)}
            for t, p, c in rows
        ],
    }
    return json.dumps(figures, indent=1)


def _text(out: Deviation, rows: list[Row]) -> str:
    lines = [
        f"{len(out.distance)} measured vertices against the reference: mean {out.mean:+.4f} mm, "
        f"rms {out.rms:.4f} mm, 95 % within {out.quantile(0.95):.4f} mm, "
        f"worst {out.quantile(1.0):.4f} mm"
    ]
    lines += [
        f"within {t:g} mm: precision {p:.2%}, completeness {c:.2%}, F-score {_f_score(p, c):.4f}"
        for t, p, c in rows
    ]
    return "\n".join(lines)
