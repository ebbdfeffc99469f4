"""``turnscan refine``: improve a rig without a board."""

from __future__ import annotations

from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._progress import progress_bar

_path = click.Path(path_type=Path)


@click.command("refine")
@click.argument("scans", type=_path, nargs=-1, required=True)
@click.option(
    "--rig", type=_path, help="rig.json, or what a ruler says (.toml).  [default: the scan's]"
)
@flags_of(workflows.RefineOptions)
@click.option(
    "--artefact",
    type=_path,
    help="The part: a sphere or ball bar that was measured (TOML or JSON, as verify takes it), or "
    "any part as it is drawn (STL, STEP).",
)
@click.option("-o", "--output", required=True, type=_path, help="rig.json to write.")
@click.option("--report", type=_path, help="HTML report to write.")
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON.")
def verb(
    scans: tuple[Path, ...],
    rig: Path | None,
    options: workflows.RefineOptions,
    artefact: Path | None,
    output: Path,
    report: Path | None,
    as_json: bool,
) -> None:
    """Improve a rig by SCANS, of any part seen by two lasers or in two poses, or of a known body.

    What two lasers see of one part is one surface: laser sheets and axis move within their
    uncertainty, and errors of the table (eccentric drive, play) are estimated where the scan
    demands them. With one laser, scan the part twice, laid down again in between, and give both
    scans: how it lay is found. A body of known form, wherever it stands, must come out as it is,
    and its known lengths give the scale. What the scans say nothing of stays as it was, and is
    named.
    """
    with progress_bar() as progress:
        done = workflows.refine(
            scans, output, options, rig=rig, artefact=artefact, report=report, progress=progress
        )
    click.echo(done.figures() if as_json else str(done))
