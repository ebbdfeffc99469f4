"""``turnscan measure``: planar faces and the angles between them, spheres, cylinders, volume."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._output import report_option
from turnscan.cli._progress import progress_bar
from turnscan.cli._words import with_flags


@click.command("measure")
@click.argument("file", type=click.Path(path_type=Path))
@flags_of(workflows.MeasureOptions)
@report_option(
    "every size of the shapes of the part, as .html or .pdf with a picture of each feature, .json "
    "or .csv"
)
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON, unrounded.")
def verb(
    file: Path, options: workflows.MeasureOptions, reports: tuple[Path, ...], as_json: bool
) -> None:
    """Measure the mesh in FILE (.ply .stl .obj .3mf .glb .dxf, mm), or the scan (.turnscan).

    A scan is reconstructed with its own settings. Only what was measured is fitted, no vertex of a
    filling, as far as the file tells them apart (an STL does not); points weigh 1/sigma² where the
    file knows their sigma (PLY, scan). Uncertainties follow from the points' sigma or scatter, more
    where neighbours or whole stripes are off together; of a scan also from what light and rig do to
    all points alike, which a mesh does not know.
    """
    workflows.check_apart(reports)
    for report in reports:
        workflows.check_output(report, workflows.DIMENSION_SUFFIXES, inputs=[file])
    if reports:
        options = replace(options, sizes=True)
    with progress_bar() as progress:
        found = workflows.measure(file, options, progress=progress)
    for finding in found.findings:
        click.echo(with_flags(finding), err=True)
    for report in reports:
        found.save_report(report)
    click.echo(json.dumps(found.figures, indent=1) if as_json else str(found))
    for report in reports:
        click.echo(f"{report}: written", err=as_json)
