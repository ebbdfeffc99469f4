"""``turnscan resume``: complete an interrupted scan."""

from __future__ import annotations

from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._devices_in_use import begun, show_taken
from turnscan.cli._flags import flags_of
from turnscan.cli._numbers import Finite


@click.command("resume")
@click.argument("name", metavar="NAME.turnscan", type=click.Path(path_type=Path))
@flags_of(workflows.DeviceOptions, into="devices")
@click.option("--at-deg", type=Finite(), metavar="ANGLE",
              help="Current table angle in the scan's frame, set by the operator, "
                   "degrees.")  # fmt: skip
@click.option(
    "--retake", is_flag=True, help="Also take frames again that are damaged or recorded as missing."
)
def verb(name: Path, devices: workflows.DeviceOptions, at_deg: float | None, retake: bool) -> None:
    """Take the frames that NAME.turnscan is missing, with the same plan and the same devices.

    Addresses may have changed; those not given are taken from the scan. Where the controller of the
    table has restarted, its angle is lost, and nothing is taken until --at-deg gives it. Exit code
    130 when interrupted; the scan can be resumed again.
    """
    with begun(name, "interrupted before any frame was taken", devices) as run:

        def planned(scan: workflows.PlannedScan) -> None:
            run.planned()
            if scan.retaken:
                click.echo(f"{scan.retaken} damaged or missing frames will be retaken")
            click.echo(f"{scan.left} of {scan.plan.steps} steps to take")

        done = workflows.resume(
            name, devices=devices, at_deg=at_deg, retake=retake,
            planned=planned, missing=run.missing, progress=run.progress,
        )  # fmt: skip
    if done.left:
        show_taken(done)
    else:
        click.echo(f"{done.path}: already complete, all {done.steps} steps are there")
