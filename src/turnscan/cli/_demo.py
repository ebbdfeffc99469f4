"""``turnscan demo``: scan a simulated part, and write it as DXF, STL, PLY and a report."""

from __future__ import annotations

from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._progress import progress_bar


@click.command("demo")
@click.option(
    "-o",
    "--output",
    default="demo-output",
    show_default=True,
    type=click.Path(path_type=Path, file_okay=False),
    help="Output folder; files of an earlier demo are replaced.",
)
@flags_of(workflows.DemoOptions)
def verb(output: Path, options: workflows.DemoOptions) -> None:
    """The main job from end to end, without hardware.

    A simulated rig photographs the part, the scan file is reconstructed like any other, and the
    result is compared with the true shape, which only a simulation knows.
    """
    with progress_bar() as bar:
        done = workflows.demo(output, options, bar)
    click.echo("\n".join(done.lines()))
