"""GRBL 1.1h below its lines: bytes, real-time commands, planner, outputs, resets, alarms.

Real-time bytes are picked out of the stream wherever they stand; the rest goes through a receive
buffer of 128 bytes to a main program that reads lines, plans moves and waits for them.
"""

from __future__ import annotations

from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Generator, Iterable
from dataclasses import dataclass, replace

from turnscan.simulate.controllers import _grbl_reports as reports
from turnscan.simulate.controllers._firmware import Fault, Firmware, Slowing
from turnscan.simulate.controllers._grbl_words import Modes, Refused

_PLANNER = 15
_LINE = 79
"""Characters of a line that are kept."""
_MESSAGE = 0.025
"""s to a first answer after a reset."""
_ALARM = 0.5
"""s for which the board hears nothing after it has reported an alarm."""
STARTUP_LINES = 2
_SPINDLE_DELAY, _COOLANT_DELAY = 4.0, 1.0
"""s for what is switched on again after a door."""

Waiting = Generator[Callable[[], bool], None, int | None]
"""A line at work: it yields what it waits for and returns its status, None for no answer."""


@dataclass(frozen=True)
class Queued:
    """A move in the planner: target in steps, °/min, and what the spindle shall do meanwhile."""

    target: int
    rate: float
    power: float
    pulsed: bool
    """Dark as soon as nothing moves: M4 with ``$32=1``."""


class GrblMachine(Firmware):
    """The board without its language; see `GrblFirmware`."""

    outputs = ("m3", "m8", "m7")
    banner = b"\r\nGrbl 1.1h ['$' for help]\r\n"
    receive = 128

    def __init__(
        self,
        settings: dict[str, float] | None = None,
        faults: Iterable[Fault] = (),
        *,
        blank_eeprom: bool = False,
        mist: bool = False,
    ) -> None:
        self.settings = dict(reports.DEFAULTS)
        for key, value in (settings or {}).items():
            self.settings[key] = reports.shown(self.settings[key], value)
        self.startup = [""] * STARTUP_LINES
        self.stored = dict.fromkeys(reports.STORED, 0.0)
        """Coordinates in EEPROM, mm of the X axis."""
        self._blank, self._mist = blank_eeprom, mist
        super().__init__(faults)

    @property
    def scale(self) -> float:
        """Steps of a degree."""
        return float(self.settings["100"]) or 1e-3

    @property
    def turns(self) -> float:
        """See `Firmware`; the unit is the microstep."""
        return self.turned / (self.scale * 360)

    def _flag(self, key: str) -> bool:
        return float(self.settings[key]) != 0

    # Power and reset.

    def _start(self) -> None:
        self.locked = self._flag("22")
        self._critical = self.asleep = self.check = False
        self._clear()
        if self._blank:
            self.say(b"error:7\r\n" + reports.settings(self.settings))
        self.say(self._greeting(), self.boot)

    def _clear(self) -> None:
        """What a reset forgets."""
        self._text, self._over, self._comment = bytearray(), False, ""
        self._task: Waiting | None = None
        self._until: Callable[[], bool] = lambda: True
        self._aborting = False
        self._queue: deque[Queued] = deque()
        self.modes = Modes()
        self._planned = round(self._place)
        self.shift = 0.0
        """G92, mm."""
        self.speed, self._flow = 0.0, frozenset[str]()
        self._pulsed = False
        self.hold, self._stopped = False, False
        self.door = ""
        """``open``, ``closed`` or ``restoring`` from a door's opening to the end of the pause."""
        self.jogging = False
        self.overrides = {"feed": 100, "rapid": 100, "spindle": 100}
        self._reports = reports.Reports()
        self._timers.clear()

    def _snapshot(self) -> reports.Snapshot:
        return reports.Snapshot(
            slowing=isinstance(self._move, Slowing),
            asleep=self.asleep,
            locked=self.locked,
            check=self.check,
            door=self.door,
            hold=self.hold,
            jogging=self.jogging,
            busy=self.busy,
            settings=self.settings,
            modes=self.modes,
            offset=self.stored[str(self.modes.system)] + self.shift,
            place=self.place / self.scale,
            rate=self.rate / self.scale,
            planner=_PLANNER - len(self._queue),
            inbox=self.receive - len(self._inbox),
            speed=self.speed,
            overrides=self.overrides,
            lit=self.lit,
        )

    def _greeting(self) -> bytes:
        """The banner, and the lines that are run at every start. Run they are, too."""
        if self.locked:
            return GrblMachine.banner + reports.UNLOCK
        if self._blank:  # written by now
            self._blank = False
            return GrblMachine.banner + b">:error:7\r\n" * STARTUP_LINES
        self._begin(self._start_up())
        return GrblMachine.banner

    def _reset(self) -> None:
        """Everything stops at once; the banner comes when what was at work has ended."""
        if self._aborting:
            return
        self._inbox.clear()
        moving = self._abort_move()
        self.speed, self._flow = 0.0, frozenset()
        self._show()
        self._aborting = True
        if not moving:
            self._restart()
            return
        self.locked = True
        self.say(b"ALARM:3\r\n", _MESSAGE)
        self.after(_MESSAGE + _ALARM, self._restart)

    def _restart(self) -> None:
        waited = self._task is not None
        self.locked |= self.asleep
        self.asleep = self._critical = self.check = False
        self._inbox.clear()
        self._clear()
        if waited:
            self.say(b"ok\r\n", _MESSAGE)
        self._show()
        self.say(self._greeting(), _MESSAGE)

    # Bytes.

    def _interrupt(self, byte: int) -> bool:
        """True where a byte acts by itself and never reaches the main program."""
        if byte == 0x18:
            self._reset()
        elif byte == ord("?"):
            if not (self._aborting or self._critical):
                self.say(self._reports.status(self._snapshot()))
        elif byte == ord("!"):
            self._pause()
        elif byte == ord("~"):
            self._resume()
        elif byte > 0x7F:
            self._override(byte)
        else:
            return self._aborting
        return True

    def _work(self) -> None:
        while not self._aborting:
            self._cycle()
            if self._task is not None:
                if not self._until():
                    break
                self._step(self._task)
            elif self._suspended or self._critical or not self._inbox:
                break
            else:
                self._hear(self._inbox.popleft())

    def _step(self, task: Waiting) -> None:
        try:
            until = next(task)
        except StopIteration as end:
            if self._task is task:
                self._task = None
                self._tell(end.value)
        except Refused as refusal:
            self._task = None
            self._tell(refusal.code)
        else:
            if self._task is task:
                self._until = until

    def _begin(self, task: Waiting) -> None:
        self._task, self._until = task, lambda: True

    def _tell(self, code: int | None) -> None:
        if code is not None:
            self.say(reports.status(code))

    def _hear(self, byte: int) -> None:
        """A byte of a line. Blanks, control characters and ``/`` are dropped, also in words."""
        if byte in b"\r\n":
            text, over = self._text.decode("latin-1"), self._over
            self._text, self._over, self._comment = bytearray(), False, ""
            self._begin(self._line("" if over else text, over))
        elif self._over or self._comment:
            if byte == ord(")") and self._comment == "(":
                self._comment = ""
        elif byte <= 0x20 or byte == ord("/"):
            pass
        elif byte in b"(;":
            self._comment = chr(byte)
        elif len(self._text) >= _LINE:
            self._over = True
        else:
            self._text += bytes([byte]).upper()

    @abstractmethod
    def _line(self, text: str, over: bool) -> Waiting:
        """Do a line; ``over``: it was too long."""

    @abstractmethod
    def _start_up(self) -> Waiting:
        """Run the lines that are run at every start."""

    # Real-time commands.

    @property
    def _suspended(self) -> bool:
        return self.hold or bool(self.door) or self.asleep

    @property
    def busy(self) -> bool:
        """Whether the table turns or will."""
        return self._move is not None or bool(self._queue)

    def _slow_down(self) -> None:
        """Begin to stop; what is left of the move waits in the planner."""
        if self._move is None or isinstance(self._move, Slowing):
            return
        if self.jogging:
            self._queue.clear()
        else:
            begun = self._current
            self._queue.appendleft(replace(begun, target=round(self._move.target)))
        self._move = self._move.slowed(self.now)

    def _pause(self) -> None:
        if self.locked or self.check or self.asleep or self._aborting:
            return
        self._slow_down()
        if not self.jogging and not self.door:
            self.hold = True
        if self._move is None:
            self._at_rest()

    def open_door(self, ajar: bool = True) -> None:
        """The door opens: stop, then outputs out; it stays open until `close_door`."""
        if self.locked or self.check or self._aborting:
            return
        self.say(reports.message("Check Door"))
        self._slow_down()
        self.hold = False
        self.door = "" if self.asleep else "open" if ajar else "closed"
        if self._move is None:
            self._at_rest()

    def close_door(self) -> None:
        """The door is shut; nothing goes on before ``~`` or a reset."""
        self.door = self.door and "closed"

    def _at_rest(self) -> None:
        """A stop that was asked for has ended."""
        if self.door:
            self.speed, self._flow, self._stopped = 0.0, frozenset(), False
        elif self.hold and self._flag("32") and self.modes.spindle != 5:
            self._stop_spindle()
        if self.jogging:
            self.jogging = False
            self._planned = round(self._place)
        self._show()

    def _stop_spindle(self) -> None:
        self.speed, self._stopped = 0.0, True
        self._reports.overrides_due()

    def _restore_spindle(self) -> None:
        self._stopped = False
        if not self._flag("32"):  # in laser mode the next move does it
            self._spin(self.modes.spindle, self.modes.speed)

    def _resume(self) -> None:
        if self._aborting or isinstance(self._move, Slowing):
            return
        if self.hold:
            if self._stopped:
                self.say(reports.message("Restoring spindle"))
                self._restore_spindle()
            self.hold = False
        elif self.door == "closed":
            self.door = "restoring"
            wait = _SPINDLE_DELAY * (self.modes.spindle != 5)
            if wait:
                self._restore_spindle()
            if self.modes.coolant:
                wait += _COOLANT_DELAY
                self._flow = self.modes.coolant
            self.after(wait, self._go_on)
        self._show()
        self._work()

    def _go_on(self) -> None:
        if self.door == "restoring":
            self.door = ""

    def _override(self, byte: int) -> None:
        """Bytes above 0x7F; those without a meaning are swallowed."""
        if self._aborting:
            return
        if byte == 0x84:
            self.open_door(ajar=False)
        elif byte == 0x85:
            if self.jogging:
                self._slow_down()
        elif byte == 0x9E and self.hold and not isinstance(self._move, Slowing):
            if self._stopped:
                self.say(reports.message("Restoring spindle"))
                self._restore_spindle()
            elif self.modes.spindle != 5:
                self._stop_spindle()
        elif byte == 0xA0 or (byte == 0xA1 and self._mist):
            if not (self.locked or self.check or self.door or self.asleep):
                output = frozenset({"m8" if byte == 0xA0 else "m7"})
                self._cool(self.modes.coolant ^ output)
                self.modes = replace(self.modes, coolant=self._flow)
        elif byte in reports.OVERRIDES:
            name, change = reports.OVERRIDES[byte]
            self.overrides[name] = change(self.overrides[name])
            self._reports.overrides_due()
        self._show()

    # The planner and the outputs.

    def _cycle(self) -> None:
        """Start the next move where nothing keeps it."""
        if self._move is not None:
            return
        if not self._queue or self._suspended:
            self.jogging = self.jogging and bool(self._queue)
            return
        self._current = block = self._queue.popleft()
        share = self.overrides["feed" if block.rate > 0 else "rapid"] / 100
        top = float(self.settings["110"])
        rate = min(top, block.rate * share) if block.rate > 0 else top * share
        self.speed, self._pulsed = block.power, block.pulsed
        self._begin_move(
            block.target, rate / 60 * self.scale, float(self.settings["120"]) * self.scale
        )
        self._show()

    def _moved(self) -> None:
        if self._pulsed:
            self.speed = 0.0
        if self._suspended or (self.jogging and not self._queue):
            self._at_rest()
        self._show()

    def _idle(self) -> bool:
        """The planner is empty and nothing keeps the main program."""
        return not self.busy and not self._suspended

    def _room(self) -> bool:
        return len(self._queue) < _PLANNER and not self._suspended

    def _spin(self, direction: int, speed: float) -> None:
        """Set the spindle's output at once."""
        least, most = float(self.settings["31"]), float(self.settings["30"])
        if direction == 5 or (direction == 4 and self._flag("32")):
            speed = 0.0
        elif least >= most:  # no range: on or off, whatever S says
            speed = most or 1.0
        elif speed:
            speed = min(most, max(least, speed * self.overrides["spindle"] / 100))
        self.speed = speed
        self._reports.overrides_due()

    def _cool(self, coolant: frozenset[str]) -> None:
        self._flow = coolant
        self._reports.overrides_due()

    def _show(self) -> None:
        self._set_lit(self._flow | ({"m3"} if self.speed > 0 else set()))

    # Faults.

    def _alarm(self, number: int) -> None:
        self._abort_move()
        self._queue.clear()
        self.locked = True
        self._task = None
        if number in (1, 2):  # hard and soft limits: deaf to all but a reset
            self.speed, self._flow = 0.0, frozenset()
            self._critical = True
        self._show()
        self.say(f"ALARM:{number}\r\n".encode())
        if self._critical:
            self.say(reports.message("Reset to continue"), _ALARM)

    def _error(self, number: int) -> None:
        self.say(reports.status(number))
