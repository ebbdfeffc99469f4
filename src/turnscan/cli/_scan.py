"""``turnscan scan``: a plan, devices, a scan file."""

from __future__ import annotations

from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._devices_in_use import begun, show_taken
from turnscan.cli._flags import flags_of


@click.command("scan")
@click.argument("name", metavar="NAME.turnscan", type=click.Path(path_type=Path))
@flags_of(workflows.DeviceOptions, into="devices")
@flags_of(workflows.ScanOptions)
@click.option("--rig", type=click.Path(path_type=Path), help="rig.json to store in the scan.")
def verb(
    name: Path,
    devices: workflows.DeviceOptions,
    options: workflows.ScanOptions,
    rig: Path | None,
) -> None:
    """Scan into NAME.turnscan with the connected devices, or with a simulated rig.

    An interrupted scan loses at most the picture being captured; `turnscan resume` completes it.
    While it runs, `turnscan check` and `turnscan reconstruct` work on the frames stored so far.
    Exit code 130 when interrupted.
    """
    with begun(name, "interrupted before the first frame was stored") as run:

        def planned(scan: workflows.PlannedScan) -> None:
            run.planned()
            if scan.simulated:
                click.echo(f"SIMULATED: {scan.simulated} is scanned, no real part")
            how = filter(None, (scan.exposure_reason, scan.threshold_reason))
            size = f"about {scan.size_bytes / 1e6:.1f} MB"
            what = f"{scan.plan.steps} steps × {', '.join(scan.plan.sets)}"
            click.echo("; ".join([what, *how, size]))

        done = workflows.scan(
            name, options, devices=devices, rig=rig,
            planned=planned, missing=run.missing, progress=run.progress,
        )  # fmt: skip
    show_taken(done)
