"""GRBL 1.1h as it behaves on an Arduino Uno: planner, real-time bytes, alarms, reports."""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterable

from turnscan.simulate.controllers._firmware import Fault, Firmware

_DEFAULTS = (
    "0=10 1=25 2=0 3=0 4=0 5=0 6=0 10=1 11=0.010 12=0.002 13=0 20=0 21=0 22=0 23=0 24=25.000 "
    "25=500.000 26=250 27=1.000 30=1000 31=0 32=0 100=250.000 101=250.000 102=250.000 110=500.000 "
    "111=500.000 112=500.000 120=10.000 121=10.000 122=10.000 130=200.000 131=200.000 132=200.000"
)
_WORD = re.compile(r"([A-Z])([+-]?\d*\.?\d*)")
_UNLOCK = b"[MSG:'$H'|'$X' to unlock]\r\n"
_PLANNER = 15
_LINE = 80
_KNOWN_G = {"0", "1", "4", "17", "20", "21", "54", "90", "91", "92", "94"}
_KNOWN_M = {"3", "4", "5", "7", "8", "9", "0", "2", "30"}


class GrblFirmware(Firmware):
    """GRBL 1.1h. Laser outputs are ``m3`` (spindle), ``m7`` and ``m8`` (coolant)."""

    outputs = ("m3", "m8", "m7")
    banner = b"\r\nGrbl 1.1h ['$' for help]\r\n"

    def __init__(
        self,
        settings: dict[str, float] | None = None,
        faults: Iterable[Fault] = (),
        *,
        blank_eeprom: bool = False,
    ) -> None:
        self.settings = dict(pair.split("=") for pair in _DEFAULTS.split())
        for key, value in (settings or {}).items():
            self._set(key, str(value))
        self._blank = blank_eeprom
        super().__init__(faults)

    def _set(self, key: str, value: str) -> None:
        shown = self.settings[key]
        self.settings[key] = f"{float(value):.3f}" if "." in shown else f"{float(value):.0f}"

    def _listing(self) -> bytes:
        return "".join(f"${k}={v}\r\n" for k, v in self.settings.items()).encode()

    @property
    def turns(self) -> float:
        """See `Firmware`; the unit is the microstep."""
        return self.place / (float(self.settings["100"]) * 360)

    def _start(self) -> None:
        self._clear()
        self._locked, self._asleep = False, False
        if self._blank:
            self.say(b"error:7\r\n" + self._listing())
            self.banner = GrblFirmware.banner + b">:error:7\r\n>:error:7\r\n"

    def _clear(self) -> None:
        """What a reset forgets."""
        self._line = bytearray()
        self._overflow = False
        self._lines: deque[str] = deque()
        self._queue: deque[tuple[int, float]] = deque()
        self._planned = round(self._place)
        self._offset = 0
        self._modal, self._relative, self._feed = "0", False, 0.0
        self._spindle, self._coolant = "5", frozenset[str]()
        self._power = 0.0
        self._hold = self._door = False
        self._until_wco = self._until_ov = 0

    # Bytes.

    def _work(self) -> None:
        while self._inbox:
            self._byte(self._inbox.popleft())
        while self._lines and not self._door and self._execute(self._lines[0]):
            if self._lines:
                self._lines.popleft()
        if self._move is None and self._queue and not self._hold:
            target, rate = self._queue.popleft()
            scale = float(self.settings["100"])
            self._begin_move(target, rate / 60 * scale, float(self.settings["120"]) * scale)

    def _byte(self, byte: int) -> None:
        if byte == 0x18:
            self._reset()
        elif byte == ord("?"):
            self.say(self._status())
        elif byte == ord("!"):
            self._hold_now()
        elif byte == ord("~"):
            self._resume()
        elif byte in b"\r\n":
            text, long = self._line.decode("latin-1"), self._overflow
            self._line, self._overflow = bytearray(), False
            self._lines.append("\0" if long else text)
        elif byte < 0x80:
            if len(self._line) >= _LINE:
                self._overflow = True
            else:
                self._line.append(byte)

    def _reset(self) -> None:
        moving = self._abort_move() and not self._hold
        locked = self._locked or moving or self._asleep
        self._inbox.clear()
        self._out.clear()
        self._clear()
        self._asleep = False
        self._show()
        if moving:
            self.say(b"ALARM:3\r\n", 0.025)
        self._locked = locked
        tail = _UNLOCK if locked else b""
        self.say(GrblFirmware.banner + tail, 0.55 if moving else 0.025)

    def _hold_now(self) -> None:
        if self._move is not None and not self._hold:
            self._queue.appendleft((round(self._move.target), self._feed or 100.0))
            self._place, self._move = float(round(self.place)), None
            self._changed()
        if not self._locked:
            self._hold = True
            self._show()

    def open_door(self) -> None:
        """The door switch opens: hold, lasers out, and nothing goes on before a reset."""
        self._hold_now()
        self._door = True
        self._spindle, self._coolant = "5", frozenset()
        self._show()
        self.say(b"[MSG:Check Door]\r\n")

    def _resume(self) -> None:
        self._hold = False
        self._show()

    def _held(self) -> bool:
        return self._hold

    @property
    def _busy(self) -> bool:
        return self._move is not None or bool(self._queue)

    def _state(self) -> str:
        if self._asleep:
            return "Sleep"
        if self._locked:
            return "Alarm"
        if self._door:
            return "Door:0"
        if self._hold:
            return "Hold:0"
        return "Run" if self._busy else "Idle"

    def _status(self) -> bytes:
        scale = float(self.settings["100"])
        state, zero = self._state(), "0.000,0.000"
        feed = round(self._feed) if state == "Run" else 0
        text = f"<{state}|MPos:{self.place / scale:.3f},{zero}"
        text += f"|FS:{feed},{round(self._power) if self._spindle != '5' else 0}"
        if self._until_wco <= 0:
            text += f"|WCO:{self._offset / scale:.3f},{zero}"
            self._until_wco = 30 if state == "Run" else 10
            self._until_ov = max(self._until_ov, 1)
        elif self._until_ov <= 1:
            text += "|Ov:100,100,100"
            self._until_ov = 20 if state == "Run" else 10
        else:
            self._until_ov -= 1
        self._until_wco -= 1
        return f"{text}>\r\n".encode()

    # Lines.

    def _execute(self, raw: str) -> bool:
        """Do a line; False while it must wait for the planner."""
        if raw == "\0":
            self.say(b"error:11\r\n")
            return True
        text = re.sub(r"\([^)]*\)?|[ \t/]", "", raw).upper()
        if not text:
            self.say(b"ok\r\n")
        elif text.startswith("$"):
            self._system(text)
        elif self._locked or self._asleep:
            self.say(b"error:9\r\n")
        else:
            return self._gcode(text)
        return True

    def _system(self, text: str) -> None:
        idle = self._state() in ("Idle", "Alarm")
        setting = re.fullmatch(r"\$(\d+)=(-?\d+\.?\d*)", text)
        if text == "$I" and idle:
            self.say(b"[VER:1.1h.20190830:]\r\n[OPT:V,15,128]\r\nok\r\n")
        elif text == "$X":
            self.say(b"[MSG:Caution: Unlocked]\r\nok\r\n" if self._locked else b"ok\r\n")
            self._locked = False
        elif not idle:
            self.say(b"error:8\r\n")
        elif text == "$$":
            self.say(self._listing() + b"ok\r\n")
        elif text == "$H":
            self.say(b"error:5\r\n")
        elif text == "$SLP":
            self._spindle, self._coolant, self._asleep = "5", frozenset(), True
            self._show()
            self.say(b"ok\r\n[MSG:Sleeping]\r\n")
        elif setting is None or setting[1] not in self.settings:
            self.say(b"error:3\r\n")
        else:
            self._set(setting[1], setting[2])
            self.say(b"ok\r\n")

    def _gcode(self, text: str) -> bool:
        words: list[tuple[str, str]] = []
        while text:
            found = _WORD.match(text)
            if found is None or not found[2].strip("+-."):
                self.say(b"error:1\r\n" if found is None else b"error:2\r\n")
                return True
            words.append((found[1], found[2]))
            text = text[found.end() :]
        whole = [(letter, f"{float(number):g}") for letter, number in words]
        g = [number for letter, number in whole if letter == "G"]
        m = [number for letter, number in whole if letter == "M"]
        if not set(g) <= _KNOWN_G or not set(m) <= _KNOWN_M:
            self.say(b"error:20\r\n")
            return True
        if (m or "4" in g) and self._busy:
            return False
        if len(self._queue) >= _PLANNER:
            return False
        values = {letter: float(number) for letter, number in words if letter not in "GM"}
        self._do(g, m, values)
        return True

    def _do(self, g: list[str], m: list[str], values: dict[str, float]) -> None:
        moves = "X" in values and "92" not in g
        if moves and self._trip("move"):
            return
        if (set(m) & {"3", "4", "7", "8"}) and self._trip("light"):
            return
        self._feed = values.get("F", self._feed)
        self._power = values.get("S", self._power)
        self._modal = next((x for x in g if x in ("0", "1")), self._modal)
        self._relative = {"90": False, "91": True}.get(
            next((x for x in g if x in ("90", "91")), ""), self._relative
        )
        if moves and self._modal == "1" and not self._feed:
            self.say(b"error:22\r\n")
            return
        self._switch(m)
        scale = float(self.settings["100"])
        if "92" in g and "X" in values:
            self._offset = self._planned - round(values["X"] * scale)
        elif moves:
            base = self._planned if self._relative else self._offset
            self._planned = base + round(values["X"] * scale)
            top = float(self.settings["110"])
            rate = min(top, self._feed) if self._modal == "1" else top
            self._queue.append((self._planned, rate))
        self._show()
        self.say(b"ok\r\n")

    def _switch(self, m: list[str]) -> None:
        for number in m:
            if number in ("3", "4", "5"):
                self._spindle = number
            elif number == "9":
                self._coolant = frozenset()
            elif number in ("7", "8"):
                self._coolant |= {f"m{number}"}

    def _show(self) -> None:
        laser_mode = self.settings["32"] == "1"
        spindle = self._spindle in ("3", "4") and self._power > 0
        if laser_mode and (self._modal == "0" or self._hold or self._spindle == "4"):
            spindle = False
        self._set_lit(self._coolant | ({"m3"} if spindle else set()))

    def _alarm(self, number: int) -> None:
        self._abort_move()
        self._clear()
        self._locked = True
        self._show()
        self.say(f"ALARM:{number}\r\n".encode())

    def _error(self, number: int) -> None:
        self.say(f"error:{number}\r\n".encode())
