"""Devices: what is connected, which laser is which, and boards that wait in an alarm."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from turnscan.devices import (
    Answer,
    Port,
    acknowledge_alarm,
    camera_schemes,
    find_cameras,
    list_ports,
    probe_port,
)
from turnscan.errors import DeviceNotFound
from turnscan.findings import Finding, findings_json
from turnscan.scanner import Opened, Seen, which_laser
from turnscan.workflows._options._device import DeviceOptions
from turnscan.workflows._scanning._scan import opened_devices


def _silent(text: str) -> None:
    """Say nothing."""


@dataclass(frozen=True)
class FoundDevices:
    """What is connected to this computer."""

    ports: tuple[Port, ...]
    answers: tuple[Answer, ...]
    """Of the ports that were asked."""
    cameras: tuple[str, ...]
    """Addresses."""
    findings: tuple[Finding, ...]

    def body(self) -> dict[str, Any]:
        """The same as a JSON object."""
        return {
            "ports": [asdict(p) for p in self.ports],
            "boards": [asdict(a) for a in self.answers],
            "cameras": list(self.cameras),
            "camera_schemes": camera_schemes(),
            "findings": json.loads(findings_json(self.findings)),
        }


def find_devices(
    ports: Sequence[str] = (), *, probe: bool = False, tell: Callable[[str], None] = _silent
) -> FoundDevices:
    """List serial ports and cameras; nothing moves and nothing is lit.

    Parameters
    ----------
    ports
        Ports to open, to ask which board is behind them.
    probe
        Ask all ports that there are, where none is named.
    tell
        Told what is asked while it takes long.
    """
    listed = list_ports()
    asked = list(ports) or ([p.path for p in listed] if probe else [])
    answers = [probe_port(path, tell=tell) for path in asked]
    cameras, findings = find_cameras()
    return FoundDevices(tuple(listed), tuple(answers), tuple(cameras), tuple(findings))


@dataclass(frozen=True)
class Acknowledged:
    """A board that was taken out of its alarm."""

    address: str
    alarm: bool
    """Whether there was one."""
    kept: bool
    """Whether the angle of its table is still known."""

    def __str__(self) -> str:
        was = "the alarm was cleared" if self.alarm else "there was no alarm"
        lost = "lost; resume with the angle of a mark, or start a new scan"
        angle = "known; resume as usual" if self.kept else lost
        return f"{self.address}: {was}; the angle of its table is {angle}"


def acknowledge(port: str, *, tell: Callable[[str], None] = _silent) -> Acknowledged:
    """End the alarm of the board at a port, or at an address, whose machine a person inspected.

    Raises DeviceNotFound where no board answers, InputError for one without alarms, and DeviceError
    and SafetyError as the board does.
    """
    address = port
    if ":" not in port or os.path.exists(port):
        found = probe_port(port, tell=tell)
        if not found.address:
            raise DeviceNotFound(
                f"{port}: no controller ({found.why_not.removeprefix(port + ': ')})"
            )
        address = found.address
    alarm, kept = acknowledge_alarm(address)
    return Acknowledged(address, alarm, kept)


def lasers_in_words(lasers: Sequence[Seen]) -> str:
    """Which laser is which, and what to write in an address so that their names say so."""
    lines = []
    for laser in lasers:
        where = "no stripe" if laser.column is None else f"stripe at {laser.column:.0f} px"
        lines.append(f"laser {laser.name}: {where}: {laser.place}")
    places = [laser.place for laser in lasers]
    if {"left", "right"} <= set(places) and "dark" not in places:
        lines.append(f"in the controller's address: lasers={','.join(places)}")
    return "\n".join(lines)


def identify_lasers(
    devices: DeviceOptions | Opened | None = None, exposure: float | None = None
) -> list[Seen]:
    """Light each laser for one picture, and tell from its stripe where it stands.

    ``exposure`` (s) None takes what suits the devices. Raises DeviceError and SafetyError as they
    do; the lasers are dark then.
    """
    with opened_devices(devices) as bench:
        return which_laser(bench, exposure)
