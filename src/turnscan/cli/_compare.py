"""``turnscan compare``: a measured mesh against a reference."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._found import found_flags, tell_findings, tell_found
from turnscan.cli._progress import progress_bar


@click.command(name="compare")
@click.argument("measured", type=click.Path(path_type=Path))
@click.argument("reference", type=click.Path(path_type=Path))
@click.option(
    "--picture", type=click.Path(path_type=Path), help="Colour map of the deviation to write, PNG."
)
@found_flags(
    f"Surface coloured by its deviation to write: {' '.join(workflows.MAP_SUFFIXES)}", "sizes"
)
@click.option(
    "--tolerance-table",
    type=click.Path(path_type=Path),
    help="Tolerances, CSV feature,quantity,tolerance: 3,diameter,H7 or *,*,ISO 2768-m.",
)
@flags_of(workflows.CompareOptions)
def verb(
    measured: Path,
    reference: Path,
    picture: Path | None,
    outputs: tuple[Path, ...],
    reports: tuple[Path, ...],
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
    written = [*([picture] if picture is not None else []), *outputs, *reports]
    workflows.check_apart(written)
    kinds = [(reports, workflows.DIMENSION_SUFFIXES), (outputs, workflows.MAP_SUFFIXES)]
    kinds += [] if picture is None else [((picture,), (".png",))]
    for paths, suffixes in kinds:
        for path in paths:
            workflows.check_output(path, suffixes, [measured, reference])
    with progress_bar() as progress:
        found = workflows.compare(
            measured, reference, options, tolerance_table=tolerance_table, progress=progress
        )
    remarks = found.save_map(*outputs, limit=options.limit)
    tell_findings((*found.findings, *remarks))
    if picture is not None:
        found.save_picture(picture, options.limit)
    for report in reports:
        found.save_report(report, options.limit)
    tell_found(found, as_json, written)
    if found.verdict == "fail":
        sys.exit(1)
