"""``turnscan revolve``: axis, roundness and profile of a turned part."""

from __future__ import annotations

from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._found import found_flags, tell_findings, tell_found
from turnscan.cli._progress import progress_bar


@click.command("revolve")
@click.argument("part", type=click.Path(path_type=Path))
@flags_of(workflows.RevolveOptions)
@found_flags(
    f"File to write: {' '.join(workflows.REVOLVE_SUFFIXES)}, the half-section or the revolved solid"
)
def verb(
    part: Path,
    options: workflows.RevolveOptions,
    outputs: tuple[Path, ...],
    reports: tuple[Path, ...],
    as_json: bool,
) -> None:
    """Measure PART as a turned part: a mesh (mm) or a scan.

    Its best axis with the uncertainty, roundness (least-squares and minimum-zone circle), run-out
    and eccentricity by height, cylindricity and total run-out of its straight walls, windings such
    as threads, and the profile of the wall as lines, arcs and splines. Only measured points count;
    a handle or a keyway is left out.
    """
    written = [*outputs, *reports]
    workflows.check_apart(written)
    for path in outputs:
        workflows.check_output(path, workflows.REVOLVE_SUFFIXES, inputs=[part])
    for report in reports:
        workflows.check_output(report, workflows.DIMENSION_SUFFIXES, inputs=[part])
    workflows.check_step(outputs)
    with progress_bar() as progress:
        found = workflows.revolve(part, options, progress=progress)
    tell_findings((*found.findings, *found.save(*outputs)))
    for report in reports:
        found.save_report(report)
    tell_found(found, as_json, written)
