"""FabScanPi: every byte is echoed, a prompt ends every answer, moves are relative."""

from __future__ import annotations

import math
import re
import time

from turnscan.devices._board import Board
from turnscan.devices._steps import travel_time
from turnscan.errors import DeviceGarbled, DeviceRestarted

MICROSTEPS = 3200
LONGEST_MOVE = 32767
"""The board reads numbers with 16 bits."""
ACCELERATION = 500.0
"""Microsteps/s² of G02."""


class FabScanBoard(Board):
    """A FabScanPi board. It answers every line alike, so only the echo shows that it understood.

    It knows no absolute position, keeps no alarm and is deaf while it turns. Of its commands G02
    alone is used: after G06 (which ``M05`` with a green of 6 starts, too) its moves are wrong.
    """

    def _default_units(self) -> int:
        return MICROSTEPS

    def _connect(self) -> None:
        self._remembers = False
        version = self._say("M200;")
        if len(version) != 1 or not re.fullmatch(rb"v\.\d{8}", version[0]):
            raise DeviceGarbled(f"{self.setup.port}: not a FabScanPi: {version!r}")
        self._rate = 1200.0
        if self.setup.speed is not None:
            turns = self.setup.speed / (2 * math.pi)
            self._rate = min(3000.0, turns * float(self._steps.per_turn))
        self._say("M17")

    def _settle(self) -> None:
        self._say("M17")

    def _say(self, text: str, end: float | None = None) -> list[bytes]:
        """Send a line; the lines between its echo and the prompt."""
        self._lines.expect_nothing()
        self._link.write(f"{text}\n".encode())
        end = time.monotonic() + self._d.acknowledge if end is None else end
        said: list[bytes] = []
        while (line := self._lines.next(end, repr(text))) != b">":
            said.append(line)
            if len(said) > 20 or not line.isascii():
                raise DeviceGarbled(f"{self.setup.port}: answered {text!r} with {line[:40]!r}")
        if not said or said[0] != text.encode():
            heard = said[0][:40] if said else b""
            raise DeviceGarbled(f"{self.setup.port}: echoed {heard!r} for {text!r}")
        return said[1:]

    def _go(self, unit: int, end: float) -> None:
        steps = unit - self._unit
        expected = travel_time(steps, self._rate, ACCELERATION)
        rest = self._say(f"G02 T{steps} F{self._rate:.0f}", self._move_end(expected, end))
        if rest:
            raise DeviceRestarted(f"{self.setup.port}: said {rest[0][:40]!r} while turning")

    def _piece(self) -> int | None:
        return min(LONGEST_MOVE, max(1, round(self._steps.per_turn / 24)))
