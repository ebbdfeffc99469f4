"""What is connected: serial ports, and which board answers behind one."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass

from turnscan.devices._registry import open_turntable
from turnscan.errors import DeviceDisconnected, DeviceNotFound, SafetyError, TurnscanError

DIALECTS = ("grbl", "horus", "sardauscan", "fabscan")


@dataclass(frozen=True)
class Port:
    """A serial port as the system lists it; it has not been opened."""

    path: str
    description: str


@dataclass(frozen=True)
class Answer:
    """What was found behind a port that was opened."""

    path: str
    address: str
    """Of the board; empty where none of ours answered."""
    why_not: str
    """What the last attempt met, where there is no address."""


def list_ports() -> list[Port]:
    """The serial ports there are. None is opened."""
    from serial.tools import list_ports as system

    found = sorted(system.comports(), key=lambda p: str(p.device))
    return [Port(str(p.device), str(p.description or "")) for p in found]


def probe_port(path: str, dialects: tuple[str, ...] = DIALECTS) -> Answer:
    """Open a port and find out which board answers, one dialect after the other.

    The only things sent are each dialect's words for dark and its questions: nothing turns and
    nothing is lit. Raises nothing for a board that does not answer or a port that is not there.
    """
    why = ""
    for dialect in dialects:
        address = f"{dialect}:{path}"
        try:
            board = open_turntable(address)
        except (DeviceNotFound, DeviceDisconnected) as e:
            return Answer(path, "", e.message)
        except TurnscanError as e:
            why = e.message
            continue
        with contextlib.suppress(SafetyError):
            getattr(board, "close", lambda: None)()
        return Answer(path, address, "")
    return Answer(path, "", why)
