"""Sardauscan's own firmware: words, absolute positions of 1018 units a turn."""

from __future__ import annotations

import contextlib
import re
import time
from dataclasses import replace
from fractions import Fraction

from turnscan.devices._board import Board
from turnscan.devices._replies import lost_place
from turnscan.devices._steps import Steps, travel_time
from turnscan.errors import DeviceGarbled, DeviceRefused, DeviceRestarted, DeviceTimeout

UNITS = 1018
"""4072 half-steps a turn by fours."""


class SardauscanBoard(Board):
    """A Sardauscan board. It answers when the move is done, is deaf until then, and counts in
    16 bits, so that zero is set anew after some turns.
    """

    def _default_units(self) -> int:
        return UNITS

    def _connect(self) -> None:
        self._said("sardauscan", r"yes")
        found = self._said("T S", r"REVOLUTION STEPS  => (\d{1,5})")
        if self.setup.steps is None:
            self._steps = Steps(Fraction(int(found[1])))
        self._found(self._count())

    def _settle(self) -> None:
        self._agree()

    def _zero(self) -> None:
        self._clear()
        super()._zero()

    def _clear(self) -> None:
        self._said("T C", r"RESET CUTTENT POSITION  => 0")  # spelt so by the board

    def _count(self) -> int:
        return int(self._said("T", r"Position (-?\d{1,6})")[1])

    def _said(self, text: str, pattern: str, end: float | None = None) -> re.Match[str]:
        self._lines.expect_nothing()
        self._link.write(f"{text}\r\n".encode())
        end = time.monotonic() + self._d.acknowledge if end is None else end
        line = self._lines.next(end, repr(text)).decode("latin-1")
        found = re.fullmatch(pattern, line)
        if found is not None:
            return found
        if line.startswith("Sardauscan V"):
            raise DeviceRestarted(
                f"{self.setup.port}: the controller restarted ({line[:40]!r})",
                hint=lost_place(self.setup.port),
            )
        if line == "Hun?":
            raise DeviceRefused(f"{self.setup.port}: the controller did not understand {text!r}")
        raise DeviceGarbled(f"{self.setup.port}: answered {text!r} with {line[:60]!r}")

    def _go(self, unit: int, end: float) -> None:
        if (whole := self._rebased(unit)) is not None:
            self._turn_to(whole, end)
            self._clear()
            self._note(replace(self._left, base=whole, unit=whole))
        if unit != self._unit:
            self._turn_to(unit, end)

    def _turn_to(self, unit: int, end: float) -> None:
        there = unit - self._left.base
        expected = travel_time(4 * (unit - self._unit), 500.0, 200.0)
        found = self._said(
            f"T A {there}", r"ABSOLUTE ROTATION (-?\d+) => (-?\d+)", self._move_end(expected, end)
        )
        if int(found[1]) != there or int(found[2]) != there:
            raise DeviceGarbled(f"{self.setup.port}: sent to {there}, went to {found[2]}")

    def _come_to_rest(self) -> None:
        """It cannot be stopped: wait for the end of the piece that it is in."""
        left = (self._left.target or self._unit) - self._unit
        end = time.monotonic() + travel_time(4 * left, 500.0, 200.0) + self._d.acknowledge
        with contextlib.suppress(DeviceTimeout):
            while not self._lines.next(end, "a move").startswith(b"ABSOLUTE"):
                pass
        self._agree()

    def _piece(self) -> int | None:
        return max(1, round(self._steps.per_turn / 24))
