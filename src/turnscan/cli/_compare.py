"""``turnscan compare``: a measured mesh against a reference."""

from __future__ import annotations

import json
from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._numbers import Finite
from turnscan.cli._progress import progress_bar
from turnscan.cli._words import with_flags


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
    help="Tolerance for precision, completeness and F-score, mm; may be repeated.",
)
@click.option("--samples", type=click.IntRange(100, 2_000_000), default=50_000, show_default=True,
              help="Number of samples on the reference, for completeness.")  # fmt: skip
@click.option(
    "--picture", type=click.Path(path_type=Path), help="Colour map of the deviation to write, PNG."
)
@click.option(
    "--limit",
    type=Finite(min=0, min_open=True),
    help="Deviation at the ends of the colour map, mm.",
)
@click.option(
    "--unit", type=click.Choice(list(workflows.UNITS)), default="mm", help="Unit of MEASURED."
)
@click.option("--reference-unit", type=click.Choice(list(workflows.UNITS)), default="mm",
              help="Unit of REFERENCE.")  # fmt: skip
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON, unrounded.")
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
    """Deviation of MEASURED from REFERENCE, and how much of REFERENCE was measured.

    Both are meshes (STL, PLY, OBJ, 3MF, GLB, DXF) or scans (.turnscan), which are reconstructed
    with their own settings, in the same frame. Precision is the share of the measured vertices
    within the tolerance of the reference; completeness the share of the reference's area within
    the tolerance of the measured mesh. Faces marked as not measured do not count, nor do vertices
    off the end of an open reference.
    """
    if picture is not None:
        workflows.check_output(picture, (".png",), [measured, reference])
    with progress_bar() as progress:
        found = workflows.compare(
            measured, reference, tolerances=tolerances, samples=samples, unit=unit,
            reference_unit=reference_unit, progress=progress,
        )  # fmt: skip
    for finding in found.findings:
        click.echo(with_flags(finding), err=True)
    if picture is not None:
        found.save_picture(picture, limit)
    click.echo(json.dumps(found.figures(), indent=1) if as_json else str(found))
