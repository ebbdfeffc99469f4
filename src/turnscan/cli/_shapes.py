"""``turnscan shapes``: the planes, cylinders, spheres, cones and tori of a part."""

from __future__ import annotations

from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._found import found_flags, tell_findings, tell_found
from turnscan.cli._progress import progress_bar


@click.command("shapes")
@click.argument("part", type=click.Path(path_type=Path))
@flags_of(workflows.ShapesOptions)
@found_flags(
    f"File to write: {' '.join(workflows.SHAPES_SUFFIXES)}, the mesh coloured by shape, or a solid"
)
def verb(
    part: Path,
    options: workflows.ShapesOptions,
    outputs: tuple[Path, ...],
    reports: tuple[Path, ...],
    as_json: bool,
) -> None:
    """Find the planes, cylinders, spheres, cones and tori of PART, a mesh (mm) or a scan.

    A .turnscan is reconstructed with the settings stored in it, and the calibration's uncertainty
    counts. Only measured points are fitted; what no shape describes within its noise stays
    freeform. Relations such as parallel or coaxial are adopted where the shapes agree with them
    inside their uncertainty, and each is printed with its measured deviation.
    """
    written = [*outputs, *reports]
    workflows.check_apart(written)
    for path in outputs:
        workflows.check_output(path, workflows.SHAPES_SUFFIXES, inputs=[part])
    for report in reports:
        workflows.check_output(report, workflows.DIMENSION_SUFFIXES, inputs=[part])
    with progress_bar() as progress:
        share = 0.3 if workflows.check_step(outputs) else 1.0
        found = workflows.find_shapes(part, options, progress=progress.subrange(0, share))
        remarks = found.save(*outputs, progress=progress.subrange(share, 1))
    tell_findings((*found.findings, *remarks))
    for report in reports:
        found.save_report(report)
    tell_found(found, as_json, written)
