"""Horus 0.2, the firmware of the Ciclop, and the Sardauscan firmware that speaks like it."""

from __future__ import annotations

import math
import time
from fractions import Fraction

from turnscan.devices._board import Board
from turnscan.devices._sentences import Kind
from turnscan.devices._steps import Steps, decimal, travel_time
from turnscan.errors import DeviceGarbled, DeviceRefused, DeviceTimeout, InputError

MICROSTEPS = 3200
"""Of one turn of a Ciclop: 200 steps, sixteenths."""


class HorusBoard(Board):
    """A Horus board. ``ok`` to a move comes after the motion has ended.

    Positions are absolute degrees; G50 sets zero anew before they grow past a turn. A board that
    shows the banner but does not answer ``?`` is a Sardauscan: whole degrees, slow, no stop.
    """

    def _default_units(self) -> int:
        return MICROSTEPS

    def _connect(self) -> None:
        self._speed, self._acceleration, self._base = 180.0, 180.0, 0
        try:
            status = self._ask("?\r\n", until=Kind.STATUS)
            self._whole = False
        except DeviceTimeout:
            self._whole = True
            if self.setup.steps not in (None, Steps(Fraction(360))):
                raise InputError(
                    f"{self.setup.port}: this board turns whole degrees only",
                    hint="leave out steps_per_rev",
                ) from None
            self._steps = Steps(Fraction(360))
            self._speed, self._acceleration = 8.0, 1000.0
            self._remembers = False
        if self.setup.speed is not None:
            self._speed = min(self._speed, math.degrees(self.setup.speed))
        if self._whole:
            self._zero()
        elif status.fields["state"] == "Alarm":
            self._found_locked()
            return
        else:
            self._unit = self._unit_of(self._place())
        self._settle()

    def _unlock(self) -> None:
        if not self._whole:
            self._ask("$X\r\n")

    def _settle(self) -> None:
        self._ask(f"G1F{self._speed:.0f}\r\n")
        self._ask("M17\r\n")
        if not self._whole and self._unit_of(place := self._place()) != self._unit - self._base:
            expected = float(self._steps.degrees_of(self._unit - self._base))
            raise self._moved_by_itself(place, expected)

    def _zero(self) -> None:
        self._ask("G50\r\n")
        self._base = self._unit = 0

    def _place(self) -> float:
        status = self._ask("?\r\n", until=Kind.STATUS)
        if "MPos" not in status.fields:
            raise DeviceGarbled(f"{self.setup.port}: no position in {status.text}")
        return float(status.fields["MPos"].split(",")[0])

    def _unit_of(self, place: float) -> int:
        return round(place / 360 * float(self._steps.per_turn))

    def _go(self, unit: int, end: float) -> None:
        whole = self._turn_end(self._base, unit)
        if whole is not None:
            self._turn_to(whole, end)
            self._ask("G50\r\n")
            self._base = self._unit = whole
        if unit != self._unit:
            self._turn_to(unit, end)

    def _turn_to(self, unit: int, end: float) -> None:
        degrees = decimal(self._steps.degrees_of(unit - self._base), 0 if self._whole else 4)
        distance = float(self._steps.degrees_of(unit - self._unit))
        expected = travel_time(distance, self._speed, self._acceleration)
        self._lines.expect_nothing()
        self._link.write(f"G1X{degrees}\r\n".encode())
        move_end = self._move_end(expected, end)
        while (line := self._lines.poll(0.02, move_end, f"'G1X{degrees}'")) is None:
            if self._stop.is_set() and not self._whole:
                self._held(move_end)
        self._must_be_ok(line)

    def _held(self, end: float) -> None:
        """At rest after a hold the reset keeps the place, which ``?`` then tells."""
        before, place = None, self._place()
        while before != place and time.monotonic() < end:
            time.sleep(0.02)
            before, place = place, self._place()
        self._unit = self._base + self._unit_of(place)
        raise DeviceRefused(f"{self.setup.port}: stopped")

    def _piece(self) -> int | None:
        return 15 if self._whole else None

    def _halt(self) -> None:
        if self._whole:
            return
        if self._lock.locked():
            self._link.write(b"!")
        else:
            self.off()
