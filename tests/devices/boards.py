"""Boards for the tests: on a pseudo-terminal, and in the same thread for tests of many moves."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from turnscan.devices._board import Board, Setup
from turnscan.devices._dialects import DIALECTS as TABLE
from turnscan.devices._guard_client import Deadlines
from turnscan.devices._registry import board
from turnscan.errors import TurnscanError
from turnscan.simulate.controllers import (
    FabScanFirmware,
    Firmware,
    GrblFirmware,
    HorusFirmware,
    SardauscanFirmware,
    Socket,
)

DIALECTS = ("grbl", "horus", "fabscan", "sardauscan")
QUICK = Deadlines(acknowledge=0.1, move_extra=0.1, connect=2.0, keep_trying=2.0)
PATIENT = Deadlines(acknowledge=5.0, move_extra=5.0, connect=10.0, keep_trying=2.0)
"""Where the board answers, on a machine that may stall."""
SCALE = 100.0
UNITS = {"grbl": 3200, "horus": 3200, "fabscan": 800, "sardauscan": 1018}
OUTPUTS = {
    "grbl": ("m3:1000", "m8"), "horus": ("1", "2"), "fabscan": ("right", "left"),
    "sardauscan": ("0", "1"),
}  # fmt: skip


def firmware(dialect: str) -> Firmware:
    if dialect == "grbl":
        return GrblFirmware({"100": 8.889, "110": 6000, "120": 800})
    return {"horus": HorusFirmware, "fabscan": FabScanFirmware, "sardauscan": SardauscanFirmware}[
        dialect
    ]()


@contextmanager
def plugged(dialect: str, scale: float = SCALE, **options: Any) -> Iterator[tuple[Any, Socket]]:
    """A board of this dialect and its socket."""
    with Socket(firmware(dialect), scale=scale) as socket:
        device = board(f"{dialect}:{socket.path}?lasers=a,b", **{"deadlines": PATIENT, **options})
        try:
            yield device, socket
        finally:
            with suppress(TurnscanError):
                device.close()


class NearLink:
    """A `Link` straight to a firmware with a clock of its own: no port, no guard, no waiting.

    It counts how many commands are on their way at once.
    """

    def __init__(self, dialect: str, board: Firmware) -> None:
        self.dialect, self.board = dialect, board
        self.written: list[bytes] = []
        self.flying = self.most_flying = self.darks = 0
        self.silent: Callable[[float], None] = lambda seconds: None
        """Told of each wait in vain, which takes no time here."""

    def write(self, data: bytes, darks: int | None = None) -> None:
        self.written.append(data)
        if data.endswith((b"\n", b"\r")):
            self.flying += 1
            self.most_flying = max(self.most_flying, self.flying)
        self.board.feed(data)

    def read(self, timeout: float) -> bytes:
        self.board.run(self.board.now + 0.02)
        data = self.board.take()
        waited = 0.0
        while not data and waited < min(timeout, 1.0) * 100:
            self.board.run(self.board.now + 0.5)
            waited += 0.5
            data = self.board.take()
        if not data:
            self.silent(timeout)
        self.flying -= len(re.findall(rb"(?:^|\n)ok\r|error|ALARM|>\r| =>? |yes|Position", data))
        return data

    def light(self, mask: int, lease: float) -> None:
        for step in TABLE[self.dialect].light(OUTPUTS[self.dialect], mask):
            self.write(step.send)
            self.read(1.0)

    def renew(self, lease: float) -> None:
        pass

    def dark(self) -> bytes:
        said = b""
        for step in TABLE[self.dialect].dark(OUTPUTS[self.dialect]):
            self.board.feed(step.send)
            self.board.run(self.board.now + 1.0)
            said += self.board.take()
        self.flying = 0
        return said

    def close(self) -> None:
        self.dark()


def near(
    dialect: str, board: Firmware | None = None, silent: Callable[[float], None] | None = None
) -> tuple[Board, NearLink]:
    """A driver on a `NearLink`, which calls ``silent`` with each wait in vain."""
    from turnscan.devices._fabscan import FabScanBoard
    from turnscan.devices._grbl import GrblBoard
    from turnscan.devices._horus import HorusBoard
    from turnscan.devices._sardauscan import SardauscanBoard

    kind: type[Board] = {
        "grbl": GrblBoard, "horus": HorusBoard, "fabscan": FabScanBoard,
        "sardauscan": SardauscanBoard,
    }[dialect]  # fmt: skip
    link = NearLink(dialect, board or firmware(dialect))
    link.silent = silent or link.silent
    link.dark()
    setup = Setup("near", ("a", "b"), None, math.radians(1.0), None, {})
    return kind(setup, link, Deadlines()), link


__all__ = [
    "DIALECTS",
    "OUTPUTS",
    "PATIENT",
    "QUICK",
    "SCALE",
    "UNITS",
    "firmware",
    "near",
    "plugged",
]
