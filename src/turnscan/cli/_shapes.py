"""``turnscan shapes``: the planes, cylinders, spheres, cones and tori of a part."""

from __future__ import annotations

import json
from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._progress import progress_bar
from turnscan.cli._words import with_flags


@click.command("shapes")
@click.argument("part", type=click.Path(path_type=Path))
@flags_of(workflows.ShapesOptions)
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    type=click.Path(path_type=Path),
    help=f"File to write: {' '.join(workflows.SHAPES_SUFFIXES)}, the mesh coloured by shape, or "
    "a solid; may be repeated.",
)
@click.option(
    "--report",
    type=click.Path(path_type=Path),
    help="Report to write: .html or .pdf with pictures, .json, or the dimensions as .csv.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON, unrounded.")
def verb(
    part: Path,
    options: workflows.ShapesOptions,
    outputs: tuple[Path, ...],
    report: Path | None,
    as_json: bool,
) -> None:
    """Find the planes, cylinders, spheres, cones and tori of PART, a mesh (mm) or a scan.

    A .turnscan is reconstructed with the settings stored in it, and the calibration's uncertainty
    counts. Only measured points are fitted; what no shape describes within its noise stays
    freeform. Relations such as parallel or coaxial are adopted where the shapes agree with them
    inside their uncertainty, and each is printed with its measured deviation.
    """
    workflows.check_apart([*outputs, *([report] if report is not None else [])])
    for path in outputs:
        workflows.check_output(path, workflows.SHAPES_SUFFIXES, inputs=[part])
    if report is not None:
        workflows.check_output(report, workflows.DIMENSION_SUFFIXES, inputs=[part])
    workflows.check_step(outputs)
    with progress_bar() as progress:
        found = workflows.find_shapes(part, options, progress=progress)
    for finding in (*found.findings, *found.save(*outputs)):
        click.echo(with_flags(finding), err=True)
    if report is not None:
        found.save_report(report)
    click.echo(json.dumps(found.figures(), indent=1) if as_json else str(found))
    for path in (*outputs, *([report] if report is not None else [])):
        click.echo(f"{path}: written", err=as_json)
