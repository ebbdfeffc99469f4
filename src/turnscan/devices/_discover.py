"""What is connected: serial ports, and which board answers behind one."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass

from turnscan.devices._link import Deadlines
from turnscan.devices._registry import board
from turnscan.errors import DeviceDisconnected, DeviceNotFound, SafetyError, TurnscanError

ATTEMPTS = (
    *((dialect, 115200) for dialect in ("grbl", "horus", "sardauscan", "fabscan")),
    ("horus", 19200), ("fabscan", 14400), ("grbl", 57600), ("grbl", 9600),
)  # fmt: skip
"""What is spoken, and how fast: first what boards of today do, then Bluetooth and old ones."""
PATIENCE = 4.0
"""s for a board to boot and answer."""


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
    unknown = (None, "n/a")
    return [Port(p.device, "" if p.description in unknown else p.description) for p in found]


def probe_port(path: str, attempts: tuple[tuple[str, int], ...] = ATTEMPTS) -> Answer:
    """Open a port and find out which board answers, one dialect and baud rate after the other.

    The only things sent are each dialect's words for dark and its questions: nothing turns and
    nothing is lit. Raises nothing for a board that does not answer or a port that is not there.
    """
    why = ""
    usual = ATTEMPTS[0][1]
    for dialect, baud in attempts:
        address = f"{dialect}:{path}" + ("" if baud == usual else f"?baud={baud}")
        try:
            found = board(address, deadlines=Deadlines(connect=PATIENCE))
        except (DeviceNotFound, DeviceDisconnected) as e:
            return Answer(path, "", e.message)
        except TurnscanError as e:
            why = e.message
            continue
        with contextlib.suppress(SafetyError):
            found.close()
        return Answer(path, address, "")
    return Answer(path, "", why)
