"""GRBL 0.9 and 1.1: one degree of the table is one "millimetre" of the X axis."""

from __future__ import annotations

import math
import time
from fractions import Fraction

from turnscan.devices._board import Board
from turnscan.devices._sentences import Kind, Sentence
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
        self._offset = 0.0
        if self._status().fields["state"] == "Alarm":
            self._found_locked()
            return
        per_turn = float(self._steps.per_turn)
        self._unit = round(self._position() / 360 * per_turn)
        self._settle()

    def _unlock(self) -> None:
        self._ask("$X\n")

    def _settle(self) -> None:
        self._ask("G21 G90 G94\n")
        place = self._position()
        if self._misses(place, expected := self._degrees(self._unit) + self._offset):
            raise self._moved_by_itself(place, expected)
        self._rebase()

    def _zero(self) -> None:
        self._offset = self._position()

    def _rebase(self) -> None:
        self._ask("G92 X0\n")
        self._base, self._base_position = self._unit, self._position()

    def _degrees(self, unit: int) -> float:
        return float(self._steps.degrees_of(unit))

    def _misses(self, place: float, expected: float) -> bool:
        """Whether two positions of the board are not the same microstep; it shows 0.001°."""
        return abs(place - expected) > 0.4 * 360 / float(self._steps.per_turn) + 0.002

    def _status(self) -> Sentence:
        return self._ask("?", until=Kind.STATUS)

    def _position(self) -> float:
        status = self._status()
        if status.is_door:
            raise status.as_error(self.setup.port)
        if status.fields["state"] != "Idle":
            raise DeviceGarbled(f"{self.setup.port}: {status.text} where it should be at rest")
        place = status.fields.get("MPos", status.fields.get("WPos"))
        if place is None:
            raise DeviceGarbled(f"{self.setup.port}: no position in {status.text}")
        return float(place.split(",")[0])

    def _go(self, unit: int, end: float) -> None:
        if abs(unit - self._base) > self._steps.per_turn and unit != self._base:
            self._rebase()
        x = self._steps.degrees_of(unit - self._base)
        distance = self._degrees(unit - self._unit)
        expected = travel_time(distance, self._rate / 60, self._acceleration)
        self._ask(f"G1 X{decimal(x, 5)} F{self._rate:.0f}\n")
        self._finish(self._move_end(expected, end))
        place = self._position()
        if self._misses(place, expected := self._base_position + float(x)):
            raise self._moved_by_itself(place, expected)

    def _finish(self, end: float) -> None:
        """Wait for the planner to run empty; or, when told to stop, hold, then forget the rest."""
        self._lines.expect_nothing()
        self._link.write(b"G4 P0\n")
        while True:
            data = self._lines.poll(0.02, end, "'G4 P0'")
            if data is not None:
                self._must_be_ok(data)
                return
            if self._stop.is_set():
                self._held(end)

    def _held(self, end: float) -> None:
        """Hold has been sent: wait until at rest, reset, keep the place, and say so."""
        self._link.write(b"!")
        while time.monotonic() < end:
            status = self._status()
            if status.text.startswith(("<Hold:0", "<Idle")) or (
                "Hold" in status.text and status.fields.get("FS", "").startswith("0")
            ):
                place = float(status.fields["MPos"].split(",")[0])
                turned = (place - self._base_position) / 360 * float(self._steps.per_turn)
                self._unit = self._base + round(turned)
                break
        raise DeviceRefused(f"{self.setup.port}: stopped")

    def _halt(self) -> None:
        if self._lock.locked():
            self._link.write(b"!")
        else:
            self.off()
