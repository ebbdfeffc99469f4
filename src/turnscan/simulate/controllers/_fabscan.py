"""FabScanPi v.20200624: echo, prompt, relative moves, deaf while it turns."""

from __future__ import annotations

import re
from collections.abc import Iterable

from turnscan.simulate.controllers._firmware import Fault, Firmware

_HELP = (
    b"FabScan G-CODDE Interpreter Version: v.20200624\r\nCommands:\r\n"
    b"G00 [T(steps)]; - linear move\r\nG01 [T(steps)] [L(steps)] [F(feedrate)]; - move\r\n"
    b"M17; - enable motors\r\nM18; - disable motors\r\nM19; - turn left laser on\r\n"
    b"M20; - turn left laser off\r\nM21; - turn right laser on\r\nM22; - turn right laser off\r\n"
    b"M100; - this help message\r\nM114; - report position and feedrate\r\n"
)
_LASERS = {19: ("left", True), 20: ("left", False), 21: ("right", True), 22: ("right", False)}
_ACCELERATION = 500.0 * 1.27
"""Steps/s²; AccelStepper's first step is shorter than its setting says."""
_BUFFER = 64


class FabScanFirmware(Firmware):
    """FabScanPi. Laser outputs are ``right`` and ``left``; nothing puts them out by itself.

    ``T`` counts the four phases of a Gray code on the pins STEP and DIR, of which the motor's
    driver sees one pulse in four. Each move begins at phase 0 wherever the last one ended, so
    only whole fours of T turn the table as far as they say.
    """

    outputs = ("right", "left")

    def __init__(self, faults: Iterable[Fault] = (), *, per_turn: float = 3200.0) -> None:
        """``per_turn``: phases (T) of one turn of the table."""
        self._per_turn = per_turn
        self._pulses = 0
        super().__init__(faults)

    @property
    def steps(self) -> int:
        """STEP pulses that turned the motor forwards, less those backwards, since it was built."""
        if self._move is None:
            return self._pulses
        return self._pulses + self._pulsed(round(self.place - self._move.start))[0]

    @property
    def turns(self) -> float:
        """See `Firmware`; the table is where its pulses have turned it, reset or not."""
        return 4 * self.steps / self._per_turn

    def _start(self) -> None:
        self._line = bytearray()
        self._blocked = 0.0
        self._step_pin, self._dir_pin = False, True
        self._enabled = False

    def power_on(self, silent: bool = True) -> None:
        """See `Firmware`; a motor that was turning stops where it is, and it is always silent."""
        self._end_pulses()
        super().power_on(silent)

    def _pulsed(self, phases: int) -> tuple[int, bool, bool]:
        """Net pulses of a move by so many phases from phase 0, and the pins at its end.

        The motor turns where STEP rises, the way that DIR says then; DIR is written after STEP.
        """
        pulses, step, way = 0, self._step_pin, self._dir_pin
        forwards = 1 if phases > 0 else -1
        for k in range(1, abs(phases) + 1):
            phase = forwards * k % 4
            rises = phase in (1, 2) and not step
            pulses += (1 if way else -1) * rises
            step, way = phase in (1, 2), phase in (0, 1)
        return (pulses if self._enabled else 0), step, way

    def _abort_move(self) -> bool:
        self._end_pulses()
        return super()._abort_move()

    def _end_move(self) -> None:
        self._end_pulses()
        super()._end_move()

    def _end_pulses(self) -> None:
        if self._move is not None:
            phases = round(self.place - self._move.start)
            pulses, self._step_pin, self._dir_pin = self._pulsed(phases)
            self._pulses += pulses

    def _work(self) -> None:
        while self._inbox and self._move is None and self.now >= self._blocked:
            byte = self._inbox.popleft()
            self.say(bytes([byte]))
            if byte in b"\r\n":
                text = self._line.decode("latin-1")
                self._line.clear()
                self._execute(text.rstrip(";"))
            elif len(self._line) < _BUFFER:
                self._line.append(byte)

    def wake(self) -> float | None:
        """See `Firmware`; the ring of LEDs blocks for a while."""
        times = [super().wake(), self._blocked if self.now < self._blocked else None]
        return min((t for t in times if t is not None), default=None)

    def _moved(self) -> None:
        self.say(b">\r\n")

    def _execute(self, text: str) -> None:
        numbers = {}
        for letter, number in re.findall(r"(?:^|\s)([A-Z])([+-]?\d+)", text):
            numbers[letter] = (int(number) + 32768) % 65536 - 32768  # atoi into 16 bits
        g, m = numbers.get("G"), numbers.get("M")
        if g in (0, 1, 2) and numbers.get("T"):
            if self._trip("move"):
                return
            rate = float(max(1, min(3000, numbers.get("F", 1000))))
            ramp = _ACCELERATION if g == 2 else 1e9
            self._begin_move(self.place + numbers["T"], rate, ramp)
            return
        if m in (13, 14, 17, 18):
            self._enabled = m in (13, 17)
        elif m in _LASERS:
            output, on = _LASERS[m]
            if on and self._trip("light"):
                return
            self._set_lit(self.lit | {output} if on else self.lit - {output})
        elif m == 200:
            self.say(b"v.20200624\r\n")
        elif m == 201:
            self.say(b"1\r\n")
        elif m == 100:
            self.say(_HELP)
        elif m in (4, 5):
            if m == 4:
                self._set_lit(frozenset())
            self._blocked = self.now + 0.1
            self.say(b">\r\n", 0.1)
            return
        self.say(b">\r\n")
