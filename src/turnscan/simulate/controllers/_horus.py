"""Horus 0.2, the firmware of the Ciclop: GRBL 0.9 that answers when the motion has ended."""

from __future__ import annotations

import re
from collections.abc import Iterable

from turnscan.simulate.controllers._firmware import Fault, Firmware

_LISTING = """$0=10 (step pulse, usec)
$1=25 (step idle delay, msec)
$2=0 (step port invert mask:00000000)
$3=6 (dir port invert mask:00000110)
$4=0 (step enable invert, bool)
$5=0 (limit pins invert, bool)
$6=0 (probe pin invert, bool)
$10=3 (status report mask:00000011)
$11=0.020 (junction deviation, deg)
$12=0.002 (arc tolerance, deg)
$13=0 (report inches, bool)
$14=1 (auto start, bool)
$20=0 (soft limits, bool)
$21=0 (hard limits, bool)
$22=0 (homing pull-off, mm)
$100=8.889 (x, step/deg)
$101=8.889 (y, step/deg)
$102=8.889 (z, step/deg)
$110=180.000 (x max rate, deg/sec)
$111=180.000 (y max rate, deg/sec)
$112=180.000 (z max rate, deg/sec)
$120={acceleration:.3f} (x accel, deg/sec^2)
$121=180.000 (y accel, deg/sec^2)
$122=180.000 (z accel, deg/sec^2)
$130=1080.000 (x max travel, deg)
$131=1080.000 (y max travel, deg)
$132=1080.000 (z max travel, deg)
"""
_CUT_OFF = 255.0
"""s after which the board puts its lasers out by itself, in silence."""
_STEPS_PER_DEGREE = 16 / 1.8
_BLANK = b"error: EEPROM read fail. Using defaults\r\n"


class HorusFirmware(Firmware):
    """Horus 0.2. Laser outputs are ``1`` to ``4``."""

    outputs = ("1", "2", "3", "4")
    banner = b"\r\nHorus 0.2 ['$' for help]\r\n"

    def __init__(self, faults: Iterable[Fault] = (), *, blank_eeprom: bool = False) -> None:
        self._acceleration = 180.0
        self._blank = blank_eeprom
        super().__init__(faults)

    @property
    def turns(self) -> float:
        """See `Firmware`; the unit is the microstep, zero is G50's."""
        return (self.place + self._zeroed) / (_STEPS_PER_DEGREE * 360)

    def _listing(self) -> bytes:
        text = _LISTING.format(acceleration=self._acceleration)
        return text.replace("\n", "\r\n").encode()

    def _start(self) -> None:
        self._line = bytearray()
        self._speed = 10.0
        self._zeroed = 0.0
        self._locked = self._hold = False
        self._laser_since = 0.0
        if self._blank:
            self.say(_BLANK + self._listing() + _BLANK * 8)

    def run(self, now: float) -> None:
        """See `Firmware`; lasers go out after 255 s."""
        super().run(now)
        if self.lit and self.now - self._laser_since > _CUT_OFF:
            self._set_lit(frozenset())

    def _held(self) -> bool:
        return self._hold

    def _work(self) -> None:
        waiting = len(self._inbox)
        for _ in range(waiting):  # real-time bytes overtake lines that wait for a motion
            byte = self._inbox.popleft()
            if byte == 0x18:
                self._reset()
                return
            if byte == ord("?"):
                self.say(self._status())
            elif byte == ord("!"):
                self._hold_now()
            elif byte == ord("~"):
                self._hold = False
            else:
                self._inbox.append(byte)
        while self._inbox and self._move is None:
            byte = self._inbox.popleft()
            if byte not in b"\r\n":
                self._line.append(byte)
                continue
            text = re.sub(r"\([^)]*\)?|[ \t/]", "", self._line.decode("latin-1")).upper()
            self._line.clear()
            if text:
                self._execute(text)

    def _reset(self) -> None:
        moving = self._move is not None and not self._hold
        self._abort_move()
        self._inbox.clear()
        self._line.clear()
        self._out.clear()
        self._hold = False
        self._set_lit(frozenset())
        self._locked = self._locked or moving
        if moving:
            self.say(b"ALARM: Abort during cycle\r\nok\r\n", 0.03)
        tail = b"['$H'|'$X' to unlock]\r\n" if self._locked else b""
        self.say(HorusFirmware.banner + tail, 0.55 if moving else 0.025)

    def _hold_now(self) -> None:
        if self._move is not None and not self._hold:
            self._hold = True
            self._move.start = self._move.target = float(round(self.place))

    def _status(self) -> bytes:
        state = "Alarm" if self._locked else "Hold" if self._hold else ""
        state = state or ("Idle" if self._move is None else "Run")
        place = f"{self.place / _STEPS_PER_DEGREE:.3f},0.000,0.000"
        return f"<{state},MPos:{place},WPos:{place}>\r\n".encode()

    def _moved(self) -> None:
        self.say(b"ok\r\n")

    def _execute(self, text: str) -> None:
        if text.startswith("$"):
            self._system(text)
        elif self._locked:
            self.say(b"error: Alarm lock\r\n")
        else:
            self._gcode(text)

    def _system(self, text: str) -> None:
        if text == "$$":
            self.say(self._listing() + b"ok\r\n", 0.005)
        elif text == "$X":
            self.say(b"[Caution: Unlocked]\r\nok\r\n" if self._locked else b"ok\r\n")
            self._locked = False
        elif found := re.fullmatch(r"\$120=(\d+\.?\d*)", text):
            self._acceleration = float(found[1])
            self.say(b"ok\r\n")
        else:
            self.say(b"error: Invalid statement\r\n")

    def _gcode(self, text: str) -> None:
        words = re.findall(r"([A-Z])([+-]?\d+\.?\d*|[+-]?\.\d+)", text)
        if "".join(a + b for a, b in words) != text:
            known = text[0].isalpha()
            what = b"Bad number format" if known else b"Expected command letter"
            self.say(b"error: " + what + b"\r\n")
            return
        values = {letter: float(number) for letter, number in words}
        head = f"{words[0][0]}{float(words[0][1]):g}"
        if head == "G1" and "X" in values:
            if self._trip("move"):
                return
            self._speed = values.get("F", self._speed)
            scale = _STEPS_PER_DEGREE
            self._begin_move(
                round(values["X"] * scale), min(self._speed, 180) * scale,
                self._acceleration * scale,
            )  # fmt: skip
            return
        if head in ("M70", "M71"):
            if head == "M71" and self._trip("light"):
                return
            self._laser(head == "M71", f"{values.get('T', 0):g}")
        elif head == "M50":
            self.say(b"0\r\n")
        elif head == "G1":
            self._speed = values.get("F", self._speed)
        elif head == "G50":
            self._zeroed, self._place = self._zeroed + self._place, 0.0
        elif head not in ("M0", "M2", "M17", "M18"):
            self.say(b"error: Unsupported command\r\n")
            return
        self.say(b"ok\r\n")

    def _laser(self, on: bool, output: str) -> None:
        if output in ("1", "2", "3", "4"):
            self._laser_since = self.now if on else self._laser_since
            self._set_lit(self.lit | {output} if on else self.lit - {output})

    def _alarm(self, number: int) -> None:
        self._abort_move()
        self._set_lit(frozenset())
        self._locked = True
        self.say(b"ALARM: Hard/soft limit\r\n")

    def _error(self, number: int) -> None:
        self.say(f"error: Invalid gcode ID:{number}\r\n".encode())
