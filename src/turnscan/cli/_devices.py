"""``turnscan devices``: what is connected?"""

from __future__ import annotations

import json
import os
import sys
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from turnscan.cli._hardware import addresses_of, device_options, ended_by_signals
from turnscan.cli._numbers import Finite
from turnscan.devices import acknowledge_alarm, camera_schemes, find_cameras, list_ports, probe_port
from turnscan.errors import DeviceNotFound, InputError
from turnscan.findings import findings_json

if TYPE_CHECKING:
    from turnscan.scanner import Seen


@click.command("devices")
@click.argument("ports", nargs=-1, metavar="[PORT]…")
@click.option("--probe", is_flag=True, help="Open the ports and identify the controllers.")
@click.option(
    "--acknowledge", is_flag=True, help="End the controller's alarm, after inspecting the machine."
)
@click.option(
    "--exposure",
    type=Finite(),
    metavar="SECONDS",
    help="Exposure time, with --camera.  [default: 0.02]",
)
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON.")
@device_options
def verb(
    ports: tuple[str, ...],
    probe: bool,
    acknowledge: bool,
    exposure: float | None,
    as_json: bool,
    devices: dict[str, str | None],
) -> None:
    """List serial ports and cameras. Nothing moves and no laser is lit.

    Without --probe no port is opened. With it, or with PORTs named, each port is queried in the
    four protocols and at the baud rates that turnscan knows; only "off" commands and queries are
    sent. Exit code 1 when a named PORT does not answer.

    With --acknowledge the alarm of the controller at PORT (a port or an address) is cleared, and
    whether it still knows the table angle is printed. Inspect the machine first.

    With --camera and --turntable (and --lasers), or with --device, lasers are identified instead:
    each is lit for one picture, and the camera shows which is which.
    """
    if any(devices.values()):
        from turnscan.scanner import opened, which_laser

        with ended_by_signals(), opened(addresses_of(devices)) as bench:
            _tell_lasers(which_laser(bench, exposure), as_json)
        return
    if acknowledge:
        _acknowledge(ports)
        return
    listed = list_ports()
    asked = list(ports) or ([p.path for p in listed] if probe else [])
    answers = [probe_port(path, tell=_say) for path in asked]
    cameras, findings = find_cameras()
    if as_json:
        report = {
            "ports": [asdict(p) for p in listed],
            "boards": [asdict(a) for a in answers],
            "cameras": cameras,
            "camera_schemes": camera_schemes(),
            "findings": json.loads(findings_json(findings)),
        }
        click.echo(json.dumps(report, indent=1))
    else:
        for port in listed:
            click.echo(f"port {port.path}: {port.description}")
        for answer in answers:
            why = answer.why_not.removeprefix(f"{answer.path}: ")
            click.echo(f"{answer.path}: {answer.address or f'no board ({why})'}")
        for camera in cameras:
            click.echo(f"camera {camera}")
        for finding in findings:
            click.echo(str(finding))
        if not listed and not asked:
            click.echo("no serial port")
        if not cameras:
            click.echo("no camera")
        if listed and not asked:
            click.echo("turnscan devices --probe asks which boards are behind the ports")
    if ports and not all(a.address for a in answers):
        sys.exit(1)


def _say(text: str) -> None:
    click.echo(text, err=True)


def _acknowledge(ports: tuple[str, ...]) -> None:
    """End the alarms of these boards. Raises InputError, DeviceError, SafetyError."""
    if not ports:
        raise InputError("--acknowledge: no PORT", hint="name the board's port, or its address")
    for port in ports:
        address = port
        if ":" not in port or os.path.exists(port):
            found = probe_port(port, tell=_say)
            if not found.address:
                raise DeviceNotFound(
                    f"{port}: no board ({found.why_not.removeprefix(port + ': ')})"
                )
            address = found.address
        alarm, kept = acknowledge_alarm(address)
        was = "the alarm was cleared" if alarm else "there was no alarm"
        lost = "lost; resume with --at-deg, or start a new scan"
        angle = "known; resume as usual" if kept else lost
        click.echo(f"{address}: {was}; the angle of its table is {angle}")


def _tell_lasers(lasers: list[Seen], as_json: bool) -> None:
    """Which is which, and what to write so that their names say so."""
    if as_json:
        click.echo(json.dumps({"lasers": [asdict(laser) for laser in lasers]}, indent=1))
    else:
        for laser in lasers:
            where = "no stripe" if laser.column is None else f"stripe at {laser.column:.0f} px"
            click.echo(f"laser {laser.name}: {where}: {laser.place}")
        places = [laser.place for laser in lasers]
        if {"left", "right"} <= set(places) and "dark" not in places:
            click.echo(f"in the board's address: lasers={','.join(places)}")
    if any(laser.column is None for laser in lasers):
        sys.exit(1)
