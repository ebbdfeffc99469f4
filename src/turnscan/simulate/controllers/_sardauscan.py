"""Sardauscan: its own firmware V0.1a, and the one that speaks like Horus."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from fractions import Fraction

from turnscan.simulate.controllers._firmware import Fault, Firmware

_PINS = {"0": 15, "1": 16, "2": 17, "3": 13}
_HELP = (
    b"$$ (view settings)\r\n$# (view # parameters)\r\n$G (view parser state)\r\n"
    b"$I (view build info)\r\n$N (view startup blocks)\r\n$x=value (save setting)\r\n"
    b"$Nx=line (save startup block)\r\n$C (check gcode mode)\r\n$X (kill alarm lock)\r\n"
    b"~ (cycle start)\r\n! (feed hold)\r\n? (current status)\r\nctrl-x (reset)\r\nok\r\n"
)


class SardauscanFirmware(Firmware):
    """V0.1a. Laser outputs are ``0`` to ``3``; 1018 units a turn; deaf while it turns."""

    outputs = ("0", "1", "2", "3")
    banner = b"Sardauscan V0.1a\r\n"
    receive = 63

    def __init__(self, faults: Iterable[Fault] = ()) -> None:
        super().__init__(faults)

    @property
    def turns(self) -> float:
        """See `Firmware`; the unit is four half-steps."""
        return self.turned / 1018

    def _start(self) -> None:
        self._line, self._reply = bytearray(), ""
        super()._start()

    def _work(self) -> None:
        while self._inbox and self._move is None:
            byte = self._inbox.popleft()
            if byte == 13:
                words = self._line.decode("latin-1").split()
                self._line.clear()
                if words:
                    self._execute(words)
            elif 32 <= byte < 127 and len(self._line) < 16:
                self._line.append(byte)

    def _moved(self) -> None:
        self.say(f"{self._reply}{self.place:.0f}\r\n".encode())

    def _execute(self, words: list[str]) -> None:
        head = words[0].upper()
        if words[0] == "sardauscan":
            self.say(b"yes\r\n")
        elif head == "T":
            self._table([w.upper() for w in words[1:]])
        elif head == "L":
            self._laser(words[1:])
        else:
            self.say(b"Hun?\r\n")

    def _table(self, words: list[str]) -> None:
        if not words:
            self.say(f"Position {self.place:.0f}\r\n".encode())
        elif words[0] == "S":
            self.say(b"REVOLUTION STEPS  => 1018\r\n")
        elif words[0] == "C":
            self._before, self._place = self.turned, 0.0
            self.say(b"RESET CUTTENT POSITION  => 0\r\n")
        elif words[0] in ("R", "A"):
            if self._trip("move"):
                return
            number = (_atoi(words[1] if len(words) > 1 else "") + 32768) % 65536 - 32768
            relative = words[0] == "R"
            name = f"RELATIVE ROTATION :{number}" if relative else f"ABSOLUTE ROTATION {number}"
            self._reply = f"{name} => "
            self._begin_move(self.place + number if relative else number, 125.0, 50.0)
        else:
            self.say(f"Unknown Table command :{words[0]}\r\n".encode())

    def _laser(self, words: list[str]) -> None:
        if not words:
            self.say(b"LASER_COUNT: 4\r\n")
            return
        output = str(_atoi(words[0]))
        pin = _PINS.get(output, -1)
        if len(words) > 1:
            on = _atoi(words[1]) == 1
            if output == "4" and on:  # writes beyond its table, and starts anew in mid-answer
                self.power_on()
                self._out.appendleft((self.now, b"SET"))
                return
            if on and self._trip("light"):
                return
            if pin >= 0:
                self._set_lit(self.lit | {output} if on else self.lit - {output})
            value = int(output in self.lit) if pin >= 0 else -1
            self.say(f"SET_LASER: {output}({pin}) = {value}\r\n".encode())
            return
        value = int(output in self.lit) if pin >= 0 else -1
        self.say(f"LASER_STATE: {output}({pin}) = {value}\r\n".encode())


class SardauscanHorusFirmware(Firmware):
    """The Horus-compatible firmware: prefixes only, whole degrees, silent to what it knows not."""

    banner = b"\r\nHorus 0.2 ['$' for help]\r\n"
    receive = 63

    @property
    def turns(self) -> float:
        """See `Firmware`; the unit is four steps of the motor, 512 a turn."""
        return self.turned / 512

    def _start(self) -> None:
        self._line = bytearray()
        super()._start()

    def _work(self) -> None:
        while self._inbox and self._move is None:
            byte = self._inbox.popleft()
            if byte == 0x18:
                self.say(self.banner)
            elif byte in b"\r\n":
                text = self._line.decode("latin-1")
                self._line.clear()
                self._execute(text)
            elif byte not in b"?!~":
                self._line.append(byte)

    def _moved(self) -> None:
        self.say(b"ok\r\n")

    def _execute(self, text: str) -> None:
        if text == "$":
            self.say(_HELP)
            return
        if text.startswith("G1X"):
            if self._trip("move"):
                return
            # Whole degrees, and integers that C divides towards zero.
            self._begin_move(math.trunc(Fraction(_atoi(text[3:]) * 512, 360)), 12.8, 1400.0)
            return
        if found := re.match(r"M7([01])T(.?)", text):
            on, output = found[1] == "1", found[2]
            if on and self._trip("light"):
                return
            if output in ("1", "2"):
                self._set_lit(self.lit | {output} if on else self.lit - {output})
        elif text.startswith("G50"):
            self._before, self._place = self.turned, 0.0
        elif not text.startswith(("M0", "M2", "M17", "M18", "M50", "G1", "$1")):
            return
        self.say(b"ok\r\n")


def _atoi(text: str) -> int:
    found = re.match(r"\s*[+-]?\d+", text)
    return int(found[0]) if found else 0
