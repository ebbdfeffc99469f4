"""``turnscan resume``: complete an interrupted scan."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import click

from turnscan.cli._hardware import (
    addresses_of,
    again,
    device_options,
    ended_by_signals,
    was_interrupted,
)
from turnscan.cli._numbers import Finite
from turnscan.cli._scanning import take
from turnscan.scan import Scan
from turnscan.scanner import (
    Addresses,
    acquisition_of,
    check_space,
    forget_bad,
    hardware_to_resume,
    opened,
    steps_left,
)


@click.command("resume")
@click.argument("name", metavar="NAME.turnscan", type=click.Path(path_type=Path))
@device_options
@click.option("--at-deg", type=Finite(), metavar="ANGLE",
              help="Current table angle in the scan's frame, set by the operator, "
                   "degrees.")  # fmt: skip
@click.option(
    "--retake", is_flag=True, help="Also take frames again that are damaged or recorded as missing."
)
def verb(name: Path, devices: dict[str, str | None], at_deg: float | None, retake: bool) -> None:
    """Take the frames that NAME.turnscan is missing, with the same plan and the same devices.

    Addresses may have changed; those not given are taken from the scan. Where the controller of the
    table has restarted, its angle is lost, and nothing is taken until --at-deg gives it. Exit code
    130 when interrupted; the scan can be resumed again.
    """
    with ended_by_signals():
        try:
            with Scan.resume(name) as scan:
                _resume(scan, devices, at_deg, retake)
        except (KeyboardInterrupt, SystemError) as e:
            if not was_interrupted(e):
                raise
            click.echo("turnscan: interrupted before any frame was taken", err=True)
            sys.exit(130)


def _resume(scan: Scan, devices: dict[str, str | None], at_deg: float | None, retake: bool) -> None:
    how = acquisition_of(scan)
    if retake:
        gone = forget_bad(scan)
        if gone:
            click.echo(f"{gone} damaged or missing frames will be retaken")
    left = steps_left(how.plan, scan)
    if not left:
        click.echo(f"{scan.path}: already complete, all {how.plan.steps} steps are there")
        return
    check_space(scan, how.plan, left)
    known = Addresses(how.camera, how.turntable, how.lasers)
    with opened(addresses_of(devices, known)) as bench:
        at = None if at_deg is None else math.radians(at_deg)
        hardware = hardware_to_resume(how.plan, scan, bench.hardware, at)
        click.echo(f"{left} of {how.plan.steps} steps to take")
        take(how.plan, hardware, scan, None, again(devices))
