"""``turnscan resume``: take what an interrupted scan is missing."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from pathlib import Path

import click

from turnscan.acquire import Acquisition, acquisition_from_json, check_angle, check_room, reindexed
from turnscan.cli._hardware import (
    addresses_of,
    device_options,
    ended_by_signals,
    was_interrupted,
)
from turnscan.cli._numbers import Finite
from turnscan.cli._scanning import steps_left, take
from turnscan.errors import InputError
from turnscan.scan import Scan
from turnscan.station import Addresses, opened


@click.command("resume")
@click.argument("name", metavar="NAME.turnscan", type=click.Path(path_type=Path))
@device_options
@click.option("--at-deg", type=Finite(), metavar="ANGLE",
              help="The table stands at this angle of the scan now, says a person.")  # fmt: skip
@click.option("--retake", is_flag=True, help="Also frames that are damaged or recorded as missing.")
def verb(name: Path, devices: dict[str, str | None], at_deg: float | None, retake: bool) -> None:
    """Take the frames that NAME.turnscan is missing, with the same plan and the same devices.

    Addresses may have changed since; what is not given is as it was. Where the controller of the
    table has restarted its angle is lost, and nothing is taken until --at-deg says it. Exit code
    130 when interrupted, resumable as before.
    """
    with ended_by_signals():
        try:
            with Scan.resume(name) as scan:
                _resume(scan, devices, at_deg, retake)
        except (KeyboardInterrupt, SystemError) as e:
            if not was_interrupted(e):
                raise
            click.echo("turnscan: interrupted before anything was taken", err=True)
            sys.exit(130)


def _resume(scan: Scan, devices: dict[str, str | None], at_deg: float | None, retake: bool) -> None:
    how = _acquisition(scan)
    if retake:
        _forget(scan)
    left = steps_left(how.plan, scan)
    if not left:
        click.echo(f"{scan.path}: complete already, all {how.plan.steps} steps are there")
        return
    if len(scan):
        check_room(scan.path, int(scan.path.stat().st_size * left / how.plan.steps))
    known = Addresses(how.camera, how.turntable, how.lasers)
    with opened(addresses_of(devices, known)) as bench:
        hardware = bench.hardware
        if at_deg is None:
            check_angle(how.plan, scan, hardware.turntable)
        else:
            table = reindexed(hardware.turntable, math.radians(at_deg))
            hardware = replace(hardware, turntable=table)
        click.echo(f"{left} of {how.plan.steps} steps to take")
        take(how.plan, hardware, scan, None)


def _acquisition(scan: Scan) -> Acquisition:
    if not scan.acquisition:
        raise InputError(
            f"{scan.path}: was not made by turnscan scan, so nobody knows how to go on",
            hint="resume works for scans, not for imported pictures",
        )
    return acquisition_from_json(scan.acquisition, f"{scan.path}: acquisition")


def _forget(scan: Scan) -> None:
    """Take away what is damaged or recorded as missing, so that it is taken again."""
    gone = scan.damaged()
    for laser in scan.plan.lasers:
        gone += [(laser, step, 0) for step in scan.missing(laser) if scan.has(laser, step)]
    for laser, step, exposure in gone:
        scan.forget(laser, step, exposure)
    if gone:
        click.echo(f"{len(gone)} damaged or missing frames will be taken again")
