"""Horus 0.2, the firmware of the Ciclop, and the Sardauscan firmware that speaks like it."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from fractions import Fraction

from turnscan.devices._board import Board
from turnscan.devices._guard_client import Interrupted
from turnscan.devices._replies import Kind
from turnscan.devices._steps import Steps, decimal, travel_time
from turnscan.errors import DeviceGarbled, DeviceRefused, DeviceTimeout, InputError

MICROSTEPS = 3200
"""Of one turn of a Ciclop: 200 steps, sixteenths."""
WHOLE_STEPS = 512
"""Of one turn of a Sardauscan whose firmware speaks Horus: it is moved by four steps at once."""


class HorusBoard(Board):
    """A Horus board. ``ok`` to a move comes after the motion has ended.

    Positions are absolute degrees; G50 sets zero anew before they grow past some turns. A board
    that shows the banner but does not answer ``?`` is a Sardauscan: whole degrees, of which it
    makes 512 steps a turn by cutting off; slow, no stop, no count that it could tell.
    """

    def _default_units(self) -> int:
        return MICROSTEPS

    def _connect(self) -> None:
        self._speed, self._acceleration = 180.0, 180.0
        self._asked_to_move = False
        locked = False
        try:
            status = self._ask("?\r\n", until=Kind.STATUS)
            self._whole = False
            locked = status.fields["state"] == "Alarm"
        except DeviceTimeout:
            self._whole = True
            if self.setup.steps not in (None, Steps(Fraction(360))):
                raise InputError(
                    f"{self.setup.port}: this controller turns whole degrees only",
                    hint="leave out steps_per_rev",
                ) from None
            self._steps = Steps(Fraction(WHOLE_STEPS))
            self._speed, self._acceleration = 8.0, 1000.0
        if self.setup.speed is not None:
            self._speed = min(self._speed, math.degrees(self.setup.speed))
        self._found(self._count(), locked=locked)
        if self._whole:  # its zero may be another since; where it stands does not change
            self._zero_of_whole()
            self._note(replace(self._left, base=self._unit))
        if not locked:
            self._settle()

    def _zero_of_whole(self) -> None:
        """Raises DeviceTimeout for a board that does answer ``?``, and was late."""
        try:
            self._ask("G50\r\n")
        except DeviceGarbled as late:
            raise DeviceTimeout(
                f"{self.setup.port}: no answer to '?' within {self._d.acknowledge:g} s, and then "
                f"another one than to G50",
                hint="connect again",
            ) from late

    def _unlock(self) -> None:
        if not self._whole:
            self._ask("$X\r\n")

    def _settle(self) -> None:
        self._ask(f"G1F{self._speed:.0f}\r\n")
        self._ask("M17\r\n")
        self._agree()

    def _zero(self) -> None:
        self._ask("G50\r\n")
        super()._zero()

    def _count(self) -> int | None:
        return None if self._whole else self._steps_at(self._place())

    def _place(self) -> float:
        status = self._ask("?\r\n", until=Kind.STATUS)
        if "MPos" not in status.fields:
            raise DeviceGarbled(f"{self.setup.port}: no position in {status.text}")
        return float(status.fields["MPos"].split(",")[0])

    def _steps_at(self, place: float) -> int:
        return round(place / 360 * float(self._steps.per_turn))

    def _go(self, unit: int, end: float) -> None:
        if (whole := self._rebased(unit)) is not None:
            self._turn_to(whole, end)
            self._ask("G50\r\n")
            self._note(replace(self._left, base=whole, unit=whole))
        if unit != self._unit:
            self._turn_to(unit, end)

    def _turn_to(self, unit: int, end: float) -> None:
        from_zero = unit - self._left.base
        degrees = decimal(self._steps.degrees_of(from_zero), 4)
        if self._whole:
            degrees = str(_whole_degree(from_zero))
        distance = float(self._steps.degrees_of(unit - self._unit))
        expected = travel_time(distance, self._speed, self._acceleration)
        self._lines.expect_nothing()
        try:
            self._link.write(f"G1X{degrees}\r\n".encode(), self._settled)
        except Interrupted:  # it was not sent, so that the table stands where it stood
            self._note(replace(self._left, target=None))
            raise
        self._asked_to_move = True
        move_end = self._move_end(expected, end)
        while (line := self._lines.poll(0.02, move_end, f"'G1X{degrees}'")) is None:
            if self._stop.is_set() and not self._whole:
                raise DeviceRefused(f"{self.setup.port}: stopped")
        self._asked_to_move = False
        self._must_be_ok(line)

    def _reachable(self, unit: int) -> int:
        if not self._whole:
            return unit
        return self._left.base + _steps_of(_whole_degree(unit - self._left.base))

    def _come_to_rest(self) -> None:
        if not self._whole:
            place = self._hold_still("?\r\n").fields["MPos"]
            self._agree(self._steps_at(float(place.split(",")[0])))
        elif not self._asked_to_move:
            self._note(replace(self._left, target=None))
        elif self._left.target is not None:
            # It cannot be stopped: wait for the end of the piece that it is in.
            distance = float(self._steps.degrees_of(self._left.target - self._unit))
            longest = travel_time(distance, self._speed, self._acceleration) + self._d.acknowledge
            self._must_be_ok(self._lines.next(time.monotonic() + longest, "a move"))
            self._note(replace(self._left, unit=self._left.target, target=None))

    def _piece(self) -> int | None:
        return WHOLE_STEPS // 24 if self._whole else None

    def _halt(self) -> None:
        if not self._whole:
            self._hold()


def _steps_of(degree: int) -> int:
    """Steps that a Sardauscan makes of a whole degree: integers, divided towards zero as in C."""
    return math.trunc(Fraction(degree * WHOLE_STEPS, 360))


def _whole_degree(steps: int) -> int:
    """The degree that brings it nearest to so many steps from its zero."""
    near = round(Fraction(steps * 360, WHOLE_STEPS))
    return min(range(near - 1, near + 2), key=lambda d: abs(_steps_of(d) - steps))
