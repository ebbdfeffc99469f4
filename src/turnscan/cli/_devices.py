"""``turnscan devices``: what is connected?"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from typing import Any

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of
from turnscan.cli._numbers import Finite
from turnscan.cli._signals import ended_by_signals
from turnscan.cli._words import with_flags
from turnscan.errors import InputError


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
@flags_of(workflows.DeviceOptions, into="devices")
def verb(
    ports: tuple[str, ...],
    probe: bool,
    acknowledge: bool,
    exposure: float | None,
    as_json: bool,
    devices: workflows.DeviceOptions,
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
    if devices.changed():
        with ended_by_signals():
            lasers = workflows.identify_lasers(devices, exposure)
        body: dict[str, Any] = {"lasers": [asdict(laser) for laser in lasers]}
        click.echo(json.dumps(body, indent=1) if as_json else workflows.lasers_in_words(lasers))
        failed = any(laser.column is None for laser in lasers)
    elif acknowledge:
        if not ports:
            raise InputError(
                "--acknowledge: no PORT", hint="name the controller's port, or its address"
            )
        for port in ports:
            click.echo(str(workflows.acknowledge(port, tell=_say)))
        failed = False
    else:
        found = workflows.find_devices(ports, probe=probe, tell=_say)
        click.echo(json.dumps(found.body(), indent=1) if as_json else _in_words(found))
        failed = bool(ports) and not all(a.address for a in found.answers)
    if failed:
        sys.exit(1)


def _say(text: str) -> None:
    click.echo(text, err=True)


def _in_words(found: workflows.FoundDevices) -> str:
    lines = [f"port {port.path}: {port.description}" for port in found.ports]
    for answer in found.answers:
        why = answer.why_not.removeprefix(f"{answer.path}: ")
        lines.append(f"{answer.path}: {answer.address or f'no controller ({why})'}")
    lines += [f"camera {camera}" for camera in found.cameras]
    lines += [str(with_flags(finding)) for finding in found.findings]
    if not found.ports and not found.answers:
        lines.append("no serial port")
    if not found.cameras:
        lines.append("no camera")
    if found.ports and not found.answers:
        lines.append("turnscan devices --probe identifies the controllers at the ports")
    return "\n".join(lines)
