"""GRBL 0.9 and 1.1: one degree of the table is one "millimetre" of the X axis."""

from __future__ import annotations

import math
from fractions import Fraction

from turnscan.devices._board import Board
from turnscan.devices._replies import Kind, Sentence
from turnscan.devices._steps import Steps, decimal, travel_time
from turnscan.errors import DeviceGarbled, DeviceRefused


class GrblBoard(Board):
    """A GRBL controller.

    ``ok`` means queued, so a move ends with ``G4 P0``, whose answer comes after the motion, and is
    believed only when ``?`` says Idle at the right place. Only G1 moves: with ``$32=1`` a spindle
    output lights in G1 alone. Zero is set anew with G92 before the position grows past a turn,
    because the firmware counts in single precision. No setting of the board is ever written.
    """

    def _default_units(self) -> int:
        return 360

    def _connect(self) -> None:
        values: dict[str, str] = {}
        self._ask("$$\n", each=lambda s: values.update(s.fields))
        try:
            number = {key: Fraction(values[key]) for key in ("$20", "$100", "$110", "$120")}
        except KeyError as e:
            raise DeviceGarbled(f"{self.setup.port}: GRBL lists no setting {e}") from None
        if number["$20"]:
            raise DeviceRefused(
                f"{self.setup.port}: GRBL has soft limits, which a turntable has not",
                hint="send $20=0",
            )
        for key in ("$100", "$110", "$120"):
            if number[key] <= 0:
                raise DeviceRefused(
                    f"{self.setup.port}: GRBL has {key}={values[key]}, with which nothing turns",
                    hint="set steps/°, °/min and °/s² of the table: $100, $110, $120",
                )
        per_degree = number["$100"]
        if self.setup.steps is None:
            self._steps = Steps(Fraction(round(per_degree * 360)))
        elif abs(self._steps.per_turn / 360 - per_degree) > Fraction(1, 1000):
            raise DeviceRefused(
                f"{self.setup.port}: GRBL makes $100={values['$100']} steps a degree, "
                f"steps_per_rev={float(self._steps.per_turn):g} asks for another",
                hint=f"send $100={decimal(self._steps.per_turn / 360, 3)}",
            )
        self._rate = float(number["$110"])
        if self.setup.speed is not None:
            self._rate = min(self._rate, math.degrees(self.setup.speed) * 60)
        self._acceleration = float(number["$120"])
        self._per_degree = float(per_degree)
        inches = values.get("$13") == "1"  # of reports alone; lines are in G21
        self._report_unit, self._last_digit = (25.4, 0.00254) if inches else (1.0, 0.001)
        status = self._status()
        locked = status.fields["state"] == "Alarm"
        self._found(self._steps_at(status), locked=locked)
        if not locked:
            self._settle()

    def _unlock(self) -> None:
        self._ask("$X\n")

    def _settle(self) -> None:
        self._ask("G21 G90 G94\n")
        self._agree()
        self._rebase()

    def _rebase(self) -> None:
        self._ask("G92 X0\n")
        self._zeroed = self._unit

    def _tolerance(self) -> int:
        return int(self._last_digit * self._per_degree)

    def _steps_at(self, status: Sentence) -> int:
        """Steps of the machine, which no G92 changes."""
        place = status.fields.get("MPos", status.fields.get("WPos"))
        if place is None:
            raise DeviceGarbled(f"{self.setup.port}: no position in {status.text}")
        return round(float(place.split(",")[0]) * self._report_unit * self._per_degree)

    def _degrees(self, unit: int) -> float:
        return float(self._steps.degrees_of(unit))

    def _status(self) -> Sentence:
        return self._ask("?", until=Kind.STATUS)

    def _count(self) -> int:
        status = self._status()
        if status.is_door:
            raise status.as_error(self.setup.port)
        if status.fields["state"] != "Idle":
            raise DeviceGarbled(f"{self.setup.port}: {status.text} where it should be at rest")
        return self._steps_at(status)

    def _go(self, unit: int, end: float) -> None:
        if abs(unit - self._zeroed) > self._steps.per_turn and unit != self._zeroed:
            self._rebase()
        x = self._steps.degrees_of(unit - self._zeroed)
        distance = self._degrees(unit - self._unit)
        expected = travel_time(distance, self._rate / 60, self._acceleration)
        self._ask(f"G1 X{decimal(x, 5)} F{self._rate:.0f}\n", darks=self._settled)
        self._finish(self._move_end(expected, end))
        count = self._count()
        if abs(count + self._left.base - unit) > self._tolerance():
            raise self._elsewhere(count, unit)

    def _finish(self, end: float) -> None:
        """Wait for the planner to run empty; raises DeviceRefused once `stop` was called."""
        self._lines.expect_nothing()
        self._link.write(b"G4 P0\n", self._settled)
        while (data := self._lines.poll(0.02, end, "'G4 P0'")) is None:
            if self._stop.is_set():
                raise DeviceRefused(f"{self.setup.port}: stopped")
        self._must_be_ok(data)

    def _come_to_rest(self) -> None:
        status = self._hold_still("?")
        self._agree(self._steps_at(status))

    def _halt(self) -> None:
        self._hold()
