"""Horus 0.2, the firmware of the Ciclop: GRBL 0.9 that answers when the motion has ended."""

from __future__ import annotations

from collections.abc import Iterable

from turnscan.simulate.controllers._firmware import Fault, Firmware, Move
from turnscan.simulate.controllers._grbl_words import Refused, command, number

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


_HELP = (
    "$$ (view settings)\n$# (view # parameters)\n$G (view parser state)\n$I (view build info)\n"
    "$N (view startup blocks)\n$x=value (save setting)\n$Nx=line (save startup block)\n"
    "$C (check gcode mode)\n$X (kill alarm lock)\n~ (cycle start)\n! (feed hold)\n"
    "? (current status)\nctrl-x (reset)\n"
)
_PARAMETERS = (
    "".join(f"[G{name}:0.000,0.000,0.000]\n" for name in (54, 55, 56, 57, 58, 59, 28, 30, 92))
    + "[TLO:0.000]\n[PRB:0.000,0.000,0.000]\n"
)
_LINE = 69
"""Characters of a line; the next one is an error, and what follows counts as a new line."""
_ERRORS = {
    1: "Expected command letter", 2: "Bad number format", 3: "Invalid statement", 4: "Value < 0",
    5: "Setting disabled", 8: "Not idle", 9: "Alarm lock", 11: "Line overflow",
    20: "Unsupported command", 21: "Modal group violation", 22: "Undefined feed rate",
}  # fmt: skip
_ALARM = 0.5
"""s for which the board hears nothing after it has reported an alarm."""


def _lines(text: str) -> bytes:
    return text.replace("\n", "\r\n").encode()


class HorusFirmware(Firmware):
    """Horus 0.2, after its published source. Laser outputs are ``1`` to ``4``.

    Its byte-sized numbers wrap around, as on the board: ``M327 T257`` is M71 T1.
    """

    outputs = ("1", "2", "3", "4")
    banner = b"\r\nHorus 0.2 ['$' for help]\r\n"
    receive = 128

    def __init__(self, faults: Iterable[Fault] = (), *, blank_eeprom: bool = False) -> None:
        self._acceleration = 180.0
        self._blank = blank_eeprom
        self.startup = ["", ""]
        super().__init__(faults)

    @property
    def turns(self) -> float:
        """See `Firmware`; the unit is the microstep."""
        return self.turned / (_STEPS_PER_DEGREE * 360)

    def _listing(self) -> bytes:
        return _lines(_LISTING.format(acceleration=self._acceleration))

    def _start(self) -> None:
        self._clear()
        self._locked = False
        self._laser_since = 0.0
        if self._blank:
            self.say(_BLANK + self._listing() + _BLANK * 8)
        self.say(self.banner, self.boot)
        self._run_startup()

    def _clear(self) -> None:
        """What a reset forgets."""
        self._text, self._comment = bytearray(), False
        self._speed, self._modal, self._burn, self._tool = 0.0, 0, False, 0
        self._hold = self._check = self._aborting = False
        self._rest: float | None = None
        self._after_move: tuple[int, int] | None = None

    def _run_startup(self) -> None:
        for line in self.startup:
            if line:
                self.say(line.encode("latin-1"))
                self._tell(self._gcode(line))

    def run(self, now: float) -> None:
        """See `Firmware`; lasers go out after 255 s."""
        super().run(now)
        if self.lit and self.now - self._laser_since > _CUT_OFF:
            self._set_lit(frozenset())

    # Bytes.

    def _interrupt(self, byte: int) -> bool:
        if byte == 0x18:
            self._reset()
        elif byte == ord("?"):
            if not self._aborting:
                self.say(self._status())
        elif byte == ord("!"):
            self._pause()
        elif byte == ord("~"):
            self._resume()
        else:
            return self._aborting
        return True

    def _work(self) -> None:
        while self._inbox and self._after_move is None and not self._aborting:
            self._hear(self._inbox.popleft())

    def _hear(self, byte: int) -> None:
        if byte in b"\r\n":
            text, self._comment = self._text.decode("latin-1"), False
            self._text.clear()
            if text:  # an empty line is not answered
                self._tell(self._execute(text))
        elif self._comment:
            self._comment = byte != ord(")")
        elif byte <= 0x20 or byte == ord("/"):
            pass
        elif byte == ord("("):
            self._comment = True
        elif len(self._text) >= _LINE:
            self._text.clear()
            self._tell(11)
        else:
            self._text += bytes([byte]).upper()

    def _tell(self, code: int | None) -> None:
        if code:
            self.say(f"error: {_ERRORS.get(code, f'Invalid gcode ID:{code}')}\r\n".encode())
        elif code == 0:
            self.say(b"ok\r\n")

    def _reset(self) -> None:
        if self._aborting:
            return
        moving = self._abort_move() and self._rest is None
        waited = self._after_move is not None
        self._inbox.clear()
        self._set_lit(frozenset())
        self._aborting = True
        if not moving:
            self._restart(waited)
            return
        self._locked = True
        self.say(b"ALARM: Abort during cycle\r\n", 0.03)
        self.after(0.03 + _ALARM, lambda: self._restart(waited))

    def _restart(self, waited: bool) -> None:
        self._inbox.clear()
        self._clear()
        if waited:
            self.say(b"ok\r\n", 0.02)
        self.say(HorusFirmware.banner, 0.025)
        if self._locked:
            self.say(b"['$H'|'$X' to unlock]\r\n")
        else:
            self._run_startup()

    def _pause(self) -> None:
        if self._locked or self._check or not isinstance(self._move, Move):
            return
        self._rest = self._move.target
        self._move = self._move.slowed(self.now)

    def _resume(self) -> None:
        if self._rest is not None and self._move is None:
            target, self._rest = self._rest, None
            self._drive(target)

    def _drive(self, target: float) -> None:
        scale = _STEPS_PER_DEGREE
        self._begin_move(target, min(self._speed or 180, 180) * scale, self._acceleration * scale)

    def _status(self) -> bytes:
        state = "Alarm" if self._locked else "Check" if self._check else ""
        if not state and self._rest is not None:
            state = "Queue" if self._move is None else "Hold"
        state = state or ("Idle" if self._move is None else "Run")
        place = f"{self.place / _STEPS_PER_DEGREE:.3f},0.000,0.000"
        return f"<{state},MPos:{place},WPos:{place}>\r\n".encode()

    def _moved(self) -> None:
        if self._rest is None and self._after_move is not None:
            tool, flow = self._after_move
            self._after_move = None
            self._tell(self._finish(tool, flow))

    # Lines.

    def _execute(self, text: str) -> int | None:
        if text.startswith("$"):
            return self._system(text)
        return 9 if self._locked else self._gcode(text)

    def _system(self, text: str) -> int | None:
        if text == "$":
            self.say(_lines(_HELP))
        elif text == "$$":
            self.say(self._listing(), 0.005)
        elif text == "$G":
            feed = f"{self._speed * 60:.0f}."
            self.say(f"[G{self._modal} G54 T{self._tool} F{feed}]\r\n".encode())
        elif text == "$C":
            return self._toggle_check()
        elif text == "$X":
            if self._locked:
                self.say(b"[Caution: Unlocked]\r\n")
            self._locked = False
        elif text == "$#":
            self.say(_lines(_PARAMETERS))
        elif text == "$H":
            return 5
        elif text == "$I":
            self.say(b"[0.2:]\r\n")
        elif text == "$N":
            self.say(_lines("".join(f"$N{i}={line}\n" for i, line in enumerate(self.startup))))
        else:
            return self._store(text)
        return 0

    def _toggle_check(self) -> int | None:
        if self._check:
            self.say(b"[Disabled]\r\nok\r\n")
            self._reset()
            return None
        if self._locked:
            return 8
        self._check = True
        self.say(b"[Enabled]\r\n")
        return 0

    def _store(self, text: str) -> int | None:
        line = text.startswith("$N")
        if line and self._locked:
            return 8
        try:
            key, at = number(text, 1 + line)
            if text[at : at + 1] != "=":
                return 3
            if line:
                code = self._gcode(text[at + 1 :])
                if code == 0 and key < len(self.startup):
                    self.startup[int(key)] = text[at + 1 :]
                return code
            value, end = number(text, at + 1)
        except Refused as refusal:
            return refusal.code
        if end != len(text) or f"${int(key) & 255}=" not in _LISTING:
            return 3
        if value < 0:
            return 4
        if int(key) & 255 == 120:
            self._acceleration = value
        return 0

    def _gcode(self, text: str) -> int | None:
        """Do a line; None where its answer comes when the motion has ended."""
        try:
            commands, values = _words(text)
        except Refused as refusal:
            return refusal.code
        moves = "X" in values
        feed = values.get("F", self._speed)
        if ((1 in commands["G"]) or (moves and self._modal == 1)) and moves and not feed:
            return 22
        if moves and self._trip("move"):
            return None
        if 71 in commands["M"] and self._trip("light"):
            return None
        self._speed, self._tool = feed, int(values.get("T", 0)) & 255
        self._modal = 1 if 1 in commands["G"] else self._modal
        if 50 in commands["G"]:
            self._before, self._place = self.turned, 0.0
        for m in commands["M"]:
            self._burn = {70: False, 71: True}.get(m, self._burn)
        flow = 2 if 2 in commands["M"] else 50 if 50 in commands["M"] else 0
        if moves and not self._check:
            self._after_move = (self._tool, flow)
            self._drive(round(values["X"] * _STEPS_PER_DEGREE))
            return None
        return self._finish(self._tool, flow)

    def _finish(self, tool: int, flow: int) -> int | None:
        """What a line does once the table is at rest: lasers, then the light sensor."""
        if not self._check:
            self._laser(self._burn, str(tool))
        if flow == 2:
            self.say(b"ok\r\n")
            self._reset()
            return None
        if flow == 50:
            self.say(b"0\r\n")
        return 0

    def _laser(self, on: bool, output: str) -> None:
        if output in self.outputs:
            self._laser_since = self.now if on else self._laser_since
            self._set_lit(self.lit | {output} if on else self.lit - {output})

    def _alarm(self, number: int) -> None:
        self._abort_move()
        self._after_move = None
        self._set_lit(frozenset())
        self._locked = True
        self.say(b"ALARM: Hard/soft limit\r\n")

    def _error(self, number: int) -> None:
        self.say(f"error: Invalid gcode ID:{number}\r\n".encode())


def _words(text: str) -> tuple[dict[str, list[int]], dict[str, float]]:
    """A line's commands and values, read with bytes that wrap around. Raises Refused."""
    commands: dict[str, list[int]] = {"G": [], "M": []}
    values: dict[str, float] = {}
    known = {"G": (0, 1, 50), "M": (0, 2, 17, 18, 50, 70, 71)}
    at = 0
    while at < len(text):
        letter = text[at]
        if not "A" <= letter <= "Z":
            raise Refused(1)
        value, at = number(text, at + 1)
        whole, part = command(value)
        if letter in commands:
            if letter == "M" and part & 255:
                raise Refused(23)
            if whole not in known[letter] or (letter, whole) == ("G", 0):
                raise Refused(20)
            if part & 255:
                raise Refused(23)
            commands[letter].append(whole)
        elif letter not in "FTX":
            raise Refused(20)
        elif letter in values:
            raise Refused(25)
        elif letter != "X" and value < 0:
            raise Refused(4)
        else:
            values[letter] = float(whole) if letter == "T" else value
    return commands, values
