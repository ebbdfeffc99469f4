"""``turnscan compare``: a measured mesh against a reference."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._progress import progress_bar
from turnscan.cli._words import with_flags


@click.command(name="compare")
@click.argument("measured", type=click.Path(path_type=Path))
@click.argument("reference", type=click.Path(path_type=Path))
@click.option(
    "--picture", type=click.Path(path_type=Path), help="Colour map of the deviation to write, PNG."
)
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    type=click.Path(path_type=Path),
    help=f"Surface coloured by its deviation to write: {' '.join(workflows.MAP_SUFFIXES)}; may be "
    "repeated.",
)
@click.option(
    "--report",
    type=click.Path(path_type=Path),
    help="Report to write: .html or .pdf with pictures, .json, or the sizes as .csv.",
)
@click.option(
    "--tolerance-table",
    type=click.Path(path_type=Path),
    help="Tolerances, CSV feature,quantity,tolerance: 3,diameter,H7 or *,*,ISO 2768-m.",
)
@flags_of(workflows.CompareOptions)
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON, unrounded.")
def verb(
    measured: Path,
    reference: Path,
    picture: Path | None,
    outputs: tuple[Path, ...],
    report: Path | None,
    tolerance_table: Path | None,
    options: workflows.CompareOptions,
    as_json: bool,
) -> None:
    """Deviation of MEASURED from REFERENCE, and how much of REFERENCE was measured.

    Both are meshes (STL, PLY, OBJ, 3MF, GLB, DXF), STEP files or scans (.turnscan), which are
    reconstructed with their own settings. Precision is the share of the measured vertices within
    the tolerance of the reference; completeness the share of the reference's area within the
    tolerance of the measured mesh. Faces marked as not measured do not count, nor do vertices off
    the end of an open reference. Exit code 1 where a tolerance of the table is not kept.
    """
    written = [p for p in (picture, *outputs, report) if p is not None]
    workflows.check_apart(written)
    kinds = {picture: (".png",), report: workflows.DIMENSION_SUFFIXES}
    for path in written:
        workflows.check_output(path, kinds.get(path, workflows.MAP_SUFFIXES), [measured, reference])
    with progress_bar() as progress:
        found = workflows.compare(
            measured, reference, options, tolerance_table=tolerance_table, progress=progress
        )
    remarks = found.save_map(*outputs, limit=options.limit)
    for finding in (*found.findings, *remarks):
        click.echo(with_flags(finding), err=True)
    if picture is not None:
        found.save_picture(picture, options.limit)
    if report is not None:
        found.save_report(report, options.limit)
    click.echo(json.dumps(found.figures(), indent=1) if as_json else str(found))
    for path in written:
        click.echo(f"{path}: written", err=True)
    if found.verdict == "fail":
        sys.exit(1)
