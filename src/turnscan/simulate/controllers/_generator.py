"""A function generator that speaks SCPI: a mirror on channel 1, a laser's gate on channel 2."""

from __future__ import annotations

import re
from collections.abc import Iterable

from turnscan.simulate.controllers._firmware import Fault, Firmware

_OPEN = 2.0
"""V from which the laser's input counts as open."""
_LINE = 256
_VALUE = re.compile(r"SOUR([12]):(FUNC|FREQ|VOLT|VOLT:OFFS)(\?| (\S+))", re.I)
_OUTPUT = re.compile(r"OUTP([12])(\?| (ON|OFF|0|1))", re.I)


class GeneratorFirmware(Firmware):
    """Laser output ``2`` is lit while channel 2 gives enough volts; ``spot`` joins it while the
    mirror on channel 1 is at rest, which is what must never be.
    """

    outputs = ("2",)

    def __init__(self, faults: Iterable[Fault] = ()) -> None:
        super().__init__(faults)

    @property
    def turns(self) -> float:
        """See `Firmware`; it turns nothing."""
        return 0.0

    @property
    def swinging(self) -> bool:
        """Whether the mirror moves."""
        return self._on["1"] and float(self.settings["1:VOLT"]) > 0

    def _start(self) -> None:
        self._line = bytearray()
        self._on = {"1": False, "2": False}
        self._errors: list[str] = []
        self.settings: dict[str, str] = {}
        for channel in "12":
            self.settings |= {f"{channel}:FUNC": "SIN", f"{channel}:FREQ": "1000"}
            self.settings |= {f"{channel}:VOLT": "0.1", f"{channel}:VOLT:OFFS": "0"}

    def _work(self) -> None:
        while self._inbox:
            byte = self._inbox.popleft()
            if byte == 10:
                text = self._line.decode("latin-1").strip()
                self._line.clear()
                if text:
                    self._execute(text)
            elif len(self._line) < _LINE:
                self._line.append(byte)

    def _execute(self, text: str) -> None:
        if text.upper() == "*IDN?":
            self.say(b"TURNSCAN,EMULATED GENERATOR,0,1.0\n")
        elif text.upper() == "SYST:ERR?":
            self.say((self._errors.pop(0) if self._errors else '+0,"No error"').encode() + b"\n")
        elif text.upper() == "*CLS":
            self._errors.clear()
        elif found := _VALUE.fullmatch(text):
            key = f"{found[1]}:{found[2].upper()}"
            if found[4] is None:
                self.say(self.settings[key].encode() + b"\n")
            else:
                self.settings[key] = found[4]
                self._show()
        elif found := _OUTPUT.fullmatch(text):
            self._output(found[1], found[3])
        else:
            self._errors.append('-113,"Undefined header"')

    def _output(self, channel: str, word: str | None) -> None:
        if word is None:
            self.say(b"1\n" if self._on[channel] else b"0\n")
            return
        on = word.upper() in ("ON", "1")
        if channel == "2" and on and self._trip("light"):
            return
        self._on[channel] = on
        self._show()

    def _show(self) -> None:
        if not (self._on["2"] and float(self.settings["2:VOLT:OFFS"]) >= _OPEN):
            self._set_lit(frozenset())
        else:
            self._set_lit(frozenset({"2"} if self.swinging else {"2", "spot"}))
