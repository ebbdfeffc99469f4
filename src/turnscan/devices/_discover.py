"""What is connected: serial ports, and which board answers behind one."""

from __future__ import annotations

import contextlib
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from turnscan.devices._dialects import foreign_as_oserror, open_port, send
from turnscan.devices._guard_client import Deadlines
from turnscan.devices._line_protocol import shown
from turnscan.devices._port_error import port_error, word_for
from turnscan.devices._registry import board
from turnscan.errors import DeviceError, SafetyError, TurnscanError

ATTEMPTS = (
    *((dialect, 115200) for dialect in ("grbl", "horus", "sardauscan", "fabscan")),
    ("horus", 19200), ("fabscan", 14400), ("grbl", 57600), ("grbl", 9600),
)  # fmt: skip
"""What is spoken, and how fast: first what boards of today do, then Bluetooth and old ones."""
PATIENCE = 4.0
"""s for a board that was heard to confirm that it is dark and to answer."""
_BOOT = 1.5
"""s that a board may take to wake when its port is opened."""
_AWAKE = 0.18
"""s for one that has been awake for so long to answer at another rate."""
_PAUSE = 0.06
"""s for the answer to one question."""

_TELLING = 4
"""Bytes that tell text from noise."""

_QUESTIONS = (b"\x18\r\n", b"\nM22\n", b"\rsardauscan\r")
"""A reset of GRBL and Horus, a laser off of FabScanPi, a greeting: none turns or lights anything
on any of the boards."""
_ANSWERS = {
    "grbl": re.compile(rb"Grbl \d"),
    "horus": re.compile(rb"Horus \d"),
    "fabscan": re.compile(rb"M22\n>"),
    "sardauscan": re.compile(rb"Sardauscan V|(?:^|\n)yes\r\n"),
}


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


def probe_port(
    path: str,
    attempts: tuple[tuple[str, int], ...] = ATTEMPTS,
    tell: Callable[[str], None] = lambda text: None,
) -> Answer:
    """Open a port and find out within 3 s which board answers, at one baud rate after the other.

    The only things sent are words for dark and questions: nothing turns and nothing is lit.
    ``tell`` hears what is being tried. Raises nothing for a board that does not answer or a port
    that is not there.
    """
    try:
        heard = _heard(path, attempts, tell)
    except TurnscanError as e:
        return Answer(path, "", str(e))
    if isinstance(heard, str):
        return Answer(path, "", heard)
    dialect, baud = heard
    tell(f"{path}: {dialect} answers at {baud} baud")
    address = f"{dialect}:{path}" + ("" if baud == ATTEMPTS[0][1] else f"?baud={baud}")
    try:
        found = board(address, deadlines=Deadlines(connect=PATIENCE))
    except TurnscanError as e:
        return Answer(path, "", f"{dialect} answers at {baud} baud, but: {e}")
    with contextlib.suppress(SafetyError):
        found.close()
    return Answer(path, address, "")


def _heard(
    path: str, attempts: tuple[tuple[str, int], ...], tell: Callable[[str], None]
) -> tuple[str, int] | str:
    """Dialect and rate of the board that answers, or why there is none. Raises DeviceError."""
    rates = list(dict.fromkeys(baud for _, baud in attempts))
    noise = b""
    with _opened(path, rates[0]) as port:
        awake = time.monotonic() + _BOOT
        for baud in rates:
            tell(f"{path}: asking at {baud} baud")
            port.baudrate = baud
            dialects = [dialect for dialect, rate in attempts if rate == baud]
            end = max(awake, time.monotonic() + _AWAKE) if baud == rates[0] else 0.0
            said = _asked(port, dialects, end or time.monotonic() + _AWAKE)
            for dialect in dialects:
                if _ANSWERS[dialect].search(said):
                    return dialect, baud
            if _readable(said):
                return f"it reports {shown(said)}, not a controller that turnscan knows"
            noise = noise or said
    if noise:
        return f"unreadable data at every rate: {', '.join(map(str, rates))} baud"
    return f"no response at {', '.join(map(str, rates))} baud: check cable and power"


@contextlib.contextmanager
def _opened(path: str, baud: int) -> Iterator[Any]:
    """The port, for us alone. Raises DeviceError."""
    there = False
    try:
        port = open_port(path, baud, False)
        there = True
        with foreign_as_oserror(), contextlib.closing(port):
            yield port
    except (OSError, ValueError) as e:
        if isinstance(e, DeviceError):
            raise
        word = "gone" if there else word_for(e)
        text = str(e) or type(e).__name__
        raise port_error(path, word, text) from None


def _asked(port: Any, dialects: list[str], end: float) -> bytes:
    """What comes in answer to all questions, asked again and again until the time is over."""
    said = bytearray()
    port.reset_input_buffer()
    while time.monotonic() < end:
        for question in _QUESTIONS:
            send(port, question)
            until = min(time.monotonic() + _PAUSE, end)
            while (left := until - time.monotonic()) > 0:
                port.timeout = left
                said += port.read(port.in_waiting or 1)
                if any(_ANSWERS[d].search(said) for d in dialects):
                    return bytes(said)
            if len(said) >= _TELLING and not _readable(said):
                return bytes(said)  # another rate
        if len(said) > 4096 or (_readable(said) and said.count(b"\n") > 12):
            break  # it talks, but none of our languages
    return bytes(said)


def _readable(said: bytes | bytearray) -> bool:
    """Whether it is text rather than what another rate makes of it."""
    text = sum(32 <= byte < 127 or byte in b"\r\n\t\x18" for byte in said)
    return len(said) >= _TELLING and text >= 0.9 * len(said)
