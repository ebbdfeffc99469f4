"""``turnscan compare``: a measured mesh against a reference."""

from __future__ import annotations

import json
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
@flags_of(workflows.CompareOptions)
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON, unrounded.")
def verb(
    measured: Path,
    reference: Path,
    picture: Path | None,
    options: workflows.CompareOptions,
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
        found = workflows.compare(measured, reference, options, progress=progress)
    for finding in found.findings:
        click.echo(with_flags(finding), err=True)
    if picture is not None:
        found.save_picture(picture, options.limit)
    click.echo(json.dumps(found.figures(), indent=1) if as_json else str(found))
