"""What all emulated boards share: a clock, a stepper, lasers with a log, faults on request."""

from __future__ import annotations

import heapq
import math
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Literal

FaultKind = Literal[
    "unplug", "pull", "silence", "deaf", "garbage", "half line", "doubled", "late", "alarm",
    "error", "reboot", "silent reset", "watchdog", "slow", "babble", "stuck",
]  # fmt: skip

_STANDSTILL = 1e-9
"""Units per board second that count as 0, and the same per second²."""


@dataclass(frozen=True)
class Fault:
    """Something that goes wrong at the n-th move (or laser command) since the start.

    unplug: the port vanishes, the board loses power, and it is back after ``how_long`` s. pull: the
    same, but the board keeps its power. silence: this command is done, not answered. deaf: nothing
    is heard for so long. silent reset: the board starts anew without its banner. watchdog: it hears
    nothing for so long, and then starts anew.
    garbage, half line, doubled, late: what becomes of the answer. alarm, error: with ``number``.
    reboot: the board starts anew. slow: this move takes ten times as long. babble: noise without
    end for so long. stuck: the lasers do not obey for so long.
    """

    step: int
    kind: FaultKind
    how_long: float = 0.2
    number: int = 1
    on: Literal["move", "light"] = "move"


@dataclass(frozen=True)
class Lit:
    """An entry of the laser log: which outputs burn from ``time`` (`time.monotonic`) on."""

    time: float
    outputs: frozenset[str]


@dataclass
class Move:
    """A trapezoid from rest to rest, in units and board seconds."""

    start: float
    target: float
    begin: float
    speed: float
    acceleration: float

    @property
    def duration(self) -> float:
        """Board seconds."""
        d, v, a = abs(self.target - self.start), self.speed, self.acceleration
        return 2 * math.sqrt(d / a) if d * a <= v * v else d / v + v / a

    def at(self, now: float) -> float:
        """The position at a board time."""
        t, whole = now - self.begin, self.duration
        if t >= whole:
            return self.target
        d, a, ramp = abs(self.target - self.start), self.acceleration, self._ramp
        if t < ramp:
            gone = a * t * t / 2
        elif t < whole - ramp:
            gone = a * ramp * ramp / 2 + a * ramp * (t - ramp)
        else:
            gone = d - a * (whole - t) ** 2 / 2
        return self.start + math.copysign(gone, self.target - self.start)

    @property
    def _ramp(self) -> float:
        return min(self.speed / self.acceleration, self.duration / 2)

    def velocity(self, now: float) -> float:
        """Units per board second, as a magnitude."""
        t, whole = now - self.begin, self.duration
        return max(0.0, self.acceleration * min(t, whole - t, self._ramp))

    def slowed(self, now: float) -> Slowing:
        """From now on: slow down and stop."""
        place, v = self.at(now), self.velocity(now)
        way = min(v * v / (2 * self.acceleration), abs(self.target - place))
        target = float(round(place + math.copysign(way, self.target - self.start)))
        return Slowing(place, target, now, v, v / self.acceleration)


@dataclass
class Slowing:
    """The end of a move that was asked to stop, from a speed to rest."""

    start: float
    target: float
    begin: float
    speed: float
    duration: float
    """Board seconds."""

    def at(self, now: float) -> float:
        """The position at a board time."""
        left = max(0.0, 1.0 - (now - self.begin) / self.duration) if self.duration else 0.0
        return self.target - (self.target - self.start) * left * left

    def velocity(self, now: float) -> float:
        """Units per board second, as a magnitude."""
        left = max(0.0, 1.0 - (now - self.begin) / self.duration) if self.duration else 0.0
        return self.speed * left


class Firmware(ABC):
    """A board without its port: bytes in by `feed`, time by `run`, bytes out by `take`.

    All times but those of the two logs are board seconds; nothing here looks at a clock but those,
    so a test may let years pass, and may give them a clock of its own.
    """

    clock: Callable[[], float] = time.monotonic
    """Of the logs, s."""

    outputs: tuple[str, ...] = ()
    """Of the lasers, in the order in which an address counts them."""
    banner = b""
    boot = 0.0
    """Board seconds from power to the first byte heard."""
    receive = 4096
    """Bytes that wait at most until the main program reads them; more are lost."""

    def __init__(self, faults: Iterable[Fault] = ()) -> None:
        self.faults = list(faults)
        self.now = 0.0
        self.log: list[Lit] = [Lit(self.clock(), frozenset())]
        self.received: list[tuple[float, bytes]] = []
        """What came in, by `clock`, for tests that ask what a driver sent."""
        self.on_change: Callable[[Firmware], None] | None = None
        self.unplugged = 0.0
        """s for which the port is to vanish."""
        self.powered = False
        """Whether the board keeps its power meanwhile."""
        self._out: deque[tuple[float, bytes]] = deque()
        self._timers: list[tuple[float, int, Callable[[], None]]] = []
        self._count = 0
        self._moves = self._lights = 0
        self._mangle: Fault | None = None
        self._slow = 1.0
        self._deaf_until = self._babble_until = self._stuck_until = self._awake = 0.0
        self._inbox: deque[int] = deque()
        self._move: Move | Slowing | None = None
        self._place = self._before = 0.0
        self.power_on()

    # The port's side.

    def power_on(self, silent: bool = False) -> None:
        """Power, or a reset by DTR: dark, at rest, position zero; the banner, unless ``silent``.

        The table stays where it is.
        """
        self._before = self.turned
        self._out.clear()
        self._timers.clear()
        self._inbox.clear()
        self._move, self._place = None, 0.0
        self._stuck_until = self._deaf_until = self._babble_until = 0.0
        self._awake = self.now + self.boot
        self._set_lit(frozenset())
        self._start()
        if silent:
            self._out.clear()

    def feed(self, data: bytes) -> None:
        """Bytes from the host, one at a time to whatever interrupts the board's main program."""
        self.received.append((self.clock(), data))
        for byte in data:
            if self.now < max(self._deaf_until, self._awake):
                continue
            if not self._interrupt(byte):
                if len(self._inbox) < self.receive:
                    self._inbox.append(byte)
                self._work()

    def _interrupt(self, byte: int) -> bool:
        """Whether a byte acts by itself, wherever it stands, and goes no further."""
        return False

    def run(self, now: float) -> None:
        """Let the board live until ``now``."""
        self._work()
        while (due := self._due()) is not None and due <= now:
            self.now = max(self.now, due)
            if self._timers and self._timers[0][0] <= due:
                heapq.heappop(self._timers)[2]()
            else:
                self._end_move()
            self._work()
        self.now = max(self.now, now)
        if self.now < self._babble_until:
            self.say(bytes((self._count * 37 + k * 91) % 251 + 1 for k in range(16)))
        self._work()

    def _due(self) -> float | None:
        """When the move or a wait ends."""
        times = [self._timers[0][0]] if self._timers else []
        if self._move is not None:
            times.append(self._move.begin + self._move.duration)
        return min(times, default=None)

    def after(self, delay: float, act: Callable[[], None]) -> None:
        """Do something in so many board seconds, unless a reset comes before."""
        self._count += 1
        heapq.heappush(self._timers, (self.now + delay, self._count, act))

    def wake(self) -> float | None:
        """When something will happen by itself, board time."""
        times = [self._out[0][0]] if self._out else []
        if (due := self._due()) is not None:
            times.append(due)
        if self.now < self._babble_until:
            times.append(self.now + 0.01)
        return min(times, default=None)

    def take(self) -> bytes:
        """What is due to be sent."""
        data = bytearray()
        while self._out and self._out[0][0] <= self.now:
            data += self._out.popleft()[1]
        return bytes(data)

    # What befalls a board from outside.

    def unplug(self, seconds: float, *, powered: bool) -> None:
        """The cable is out for so long; ``powered``: the board does not live on the cable."""
        self.unplugged, self.powered = max(seconds, 1e-3), powered
        if not powered:
            self._set_lit(frozenset())

    def deafen(self, seconds: float) -> None:
        """Nothing is heard for so long; what burns goes on burning."""
        self._deaf_until = self.now + seconds
        self._inbox.clear()

    def hang(self, seconds: float, *, silent: bool = False) -> None:
        """Deaf for so long, and then the watchdog restarts the board."""
        self.deafen(seconds)
        self.after(seconds, lambda: self.power_on(silent))

    # The lasers.

    @property
    def lit(self) -> frozenset[str]:
        """The outputs that burn."""
        return self.log[-1].outputs

    def _set_lit(self, outputs: frozenset[str]) -> None:
        if self.now < self._stuck_until and outputs != self.lit:
            return
        if outputs != self.lit:
            self.log.append(Lit(self.clock(), outputs))
            self._changed()

    @property
    @abstractmethod
    def turns(self) -> float:
        """Where the table stands, in turns."""

    @property
    def place(self) -> float:
        """Where the table stands, in the board's own unit."""
        return self._place if self._move is None else self._move.at(self.now)

    @property
    def turned(self) -> float:
        """How far the table has turned since it was made, in the board's own unit."""
        return self._before + self.place

    @property
    def steps(self) -> int:
        """STEP pulses so far, those backwards taken off."""
        return round(self.turned)

    @property
    def rate(self) -> float:
        """Units per board second at which the table turns now."""
        return 0.0 if self._move is None else self._move.velocity(self.now)

    def _changed(self) -> None:
        if self.on_change is not None:
            self.on_change(self)

    # The firmware's side.

    def _start(self) -> None:
        """Forget modes, and say so."""
        self.say(self.banner, self.boot)

    @abstractmethod
    def _work(self) -> None:
        """Do with the inbox what can be done now."""

    def say(self, data: bytes, delay: float = 0.0) -> None:
        """Send, after a while; the fault of this command may spoil it."""
        fault, self._mangle = self._mangle, None
        if fault is not None:
            data, delay = _spoilt(fault, data, delay)
        if data:
            before = self._out[-1][0] if self._out else 0.0
            self._out.append((max(self.now + delay, before), data))

    def _begin_move(self, target: float, speed: float, acceleration: float) -> None:
        """Settings may ask for a speed or an acceleration of 0: then it takes for ever."""
        speed, acceleration = max(speed, _STANDSTILL), max(acceleration, _STANDSTILL)
        self._move = Move(
            self.place, target, self.now, speed / self._slow, acceleration / self._slow**2
        )
        self._slow = 1.0

    def _end_move(self) -> None:
        if self._move is not None:
            self._place, self._move = self._move.target, None
            self._changed()
            self._moved()

    def _moved(self) -> None:  # noqa: B027 (a hook that may stay empty)
        """The motion has ended."""

    def _abort_move(self) -> bool:
        """Stop dead where it is; True where it was moving."""
        moving = self._move is not None
        self._place, self._move = float(round(self.place)), None
        if moving:
            self._changed()
        return moving

    def _trip(self, on: Literal["move", "light"]) -> bool:
        """Count a command and let its fault happen; True where it takes the command's place."""
        if on == "move":
            self._moves += 1
        else:
            self._lights += 1
        step = self._moves if on == "move" else self._lights
        fault = next((f for f in self.faults if f.on == on and f.step == step), None)
        if fault is None:
            return False
        self.faults.remove(fault)
        kind = fault.kind
        if kind in ("unplug", "pull"):
            self.unplug(fault.how_long, powered=kind == "pull")
            return kind == "unplug"
        if kind == "deaf":
            self.deafen(fault.how_long)
        elif kind == "watchdog":
            self.hang(fault.how_long)
        elif kind == "stuck":
            self._stuck_until = self.now + fault.how_long
            return False
        elif kind in ("reboot", "silent reset"):
            self.power_on(silent=kind == "silent reset")
        elif kind == "alarm":
            self._alarm(fault.number)
        elif kind == "error":
            self._error(fault.number)
        elif kind == "babble":
            self._babble_until = self.now + fault.how_long
        elif kind == "slow":
            self._slow = 10.0
            return False
        else:
            self._mangle = fault
            return False
        return True

    def _alarm(self, number: int) -> None:  # noqa: B027 (a hook that may stay empty)
        """Enter the alarm, where the firmware knows any; others fall silent."""

    def _error(self, number: int) -> None:  # noqa: B027 (a hook that may stay empty)
        """Refuse a command, where the firmware knows how; others fall silent."""


def _spoilt(fault: Fault, data: bytes, delay: float) -> tuple[bytes, float]:
    if fault.kind == "silence":
        return b"", delay
    if fault.kind == "garbage":
        return bytes((b * 7 + 131 + fault.step) % 256 for b in data[:-1]) + b"\x9c\r\n", delay
    if fault.kind == "half line":
        return data[: max(1, (len(data) - 2) // 2)], delay
    if fault.kind == "doubled":
        return data + data, delay
    return data, delay + fault.how_long
