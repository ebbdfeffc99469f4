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
    "unplug", "silence", "deaf", "garbage", "half line", "doubled", "late", "alarm", "error",
    "reboot", "slow", "babble", "stuck",
]  # fmt: skip


@dataclass(frozen=True)
class Fault:
    """Something that goes wrong at the n-th move (or laser command) since the start.

    unplug: the port vanishes, the board loses power, and it is back after ``how_long`` s.
    silence: this command is done, not answered. deaf: nothing is heard or answered for so long.
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
        d, a = abs(self.target - self.start), self.acceleration
        ramp = min(self.speed / a, whole / 2)
        if t < ramp:
            gone = a * t * t / 2
        elif t < whole - ramp:
            gone = a * ramp * ramp / 2 + a * ramp * (t - ramp)
        else:
            gone = d - a * (whole - t) ** 2 / 2
        return self.start + math.copysign(gone, self.target - self.start)


class Firmware(ABC):
    """A board without its port: bytes in by `feed`, time by `run`, bytes out by `take`.

    All times but those of the laser log are board seconds; nothing here looks at a clock but the
    log, so a test may let years pass.
    """

    outputs: tuple[str, ...] = ()
    """Of the lasers, in the order in which an address counts them."""
    banner = b""
    boot = 0.0
    """Board seconds from power to the first byte heard."""

    def __init__(self, faults: Iterable[Fault] = ()) -> None:
        self.faults = list(faults)
        self.now = 0.0
        self.log: list[Lit] = [Lit(time.monotonic(), frozenset())]
        self.received: list[tuple[float, bytes]] = []
        """What came in, with `time.monotonic`, for tests that ask what a driver sent."""
        self.on_change: Callable[[Firmware], None] | None = None
        self.unplugged = 0.0
        self._out: list[tuple[float, int, bytes]] = []
        self._count = 0
        self._moves = self._lights = 0
        self._mangle: Fault | None = None
        self._slow = 1.0
        self._deaf_until = self._babble_until = self._stuck_until = self._awake = 0.0
        self._inbox: deque[int] = deque()
        self._move: Move | None = None
        self._place = 0.0
        self.power_on()

    # The port's side.

    def power_on(self) -> None:
        """Power, or a reset by DTR: dark, at rest, position zero; the banner."""
        self._out.clear()
        self._inbox.clear()
        self._move, self._place = None, 0.0
        self._stuck_until = self._deaf_until = self._babble_until = 0.0
        self._awake = self.now + self.boot
        self._set_lit(frozenset())
        self._start()
        self.say(self.banner, self.boot)

    def feed(self, data: bytes) -> None:
        """Bytes from the host."""
        self.received.append((time.monotonic(), data))
        if self.now < max(self._deaf_until, self._awake):
            return
        self._inbox += data

    def run(self, now: float) -> None:
        """Let the board live until ``now``."""
        while True:
            self._work()
            move_end = None if self._move is None else self._move.begin + self._move.duration
            if move_end is None or move_end > now or self._held():
                break
            self.now = max(self.now, move_end)
            self._end_move()
        self.now = max(self.now, now)
        if self.now < self._babble_until:
            self.say(bytes((self._count * 37 + k * 91) % 251 + 1 for k in range(16)))
        self._work()

    def wake(self) -> float | None:
        """When something will happen by itself, board time."""
        times = [self._out[0][0]] if self._out else []
        if self._move is not None and not self._held():
            times.append(self._move.begin + self._move.duration)
        if self.now < self._babble_until:
            times.append(self.now + 0.01)
        return min(times, default=None)

    def take(self) -> bytes:
        """What is due to be sent."""
        data = bytearray()
        while self._out and self._out[0][0] <= self.now:
            data += heapq.heappop(self._out)[2]
        return bytes(data)

    # The lasers.

    @property
    def lit(self) -> frozenset[str]:
        """The outputs that burn."""
        return self.log[-1].outputs

    def _set_lit(self, outputs: frozenset[str]) -> None:
        if self.now < self._stuck_until and outputs != self.lit:
            return
        if outputs != self.lit:
            self.log.append(Lit(time.monotonic(), outputs))
            self._changed()

    @property
    @abstractmethod
    def turns(self) -> float:
        """Where the table stands, in turns."""

    @property
    def place(self) -> float:
        """Where the table stands, in the board's own unit."""
        return self._place if self._move is None else self._move.at(self.now)

    def _changed(self) -> None:
        if self.on_change is not None:
            self.on_change(self)

    # The firmware's side.

    def _start(self) -> None:  # noqa: B027 (a hook that may stay empty)
        """Forget modes."""

    @abstractmethod
    def _work(self) -> None:
        """Do with the inbox what can be done now."""

    def _held(self) -> bool:
        return False

    def say(self, data: bytes, delay: float = 0.0) -> None:
        """Send, after a while; the fault of this command may spoil it."""
        fault, self._mangle = self._mangle, None
        if fault is not None:
            data, delay = _spoilt(fault, data, delay)
        if data:
            self._count += 1
            heapq.heappush(self._out, (self.now + delay, self._count, data))

    def _begin_move(self, target: float, speed: float, acceleration: float) -> None:
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
        if kind == "unplug":
            self.unplugged = max(fault.how_long, 1e-3)
            self._set_lit(frozenset())
        elif kind == "deaf":
            self._deaf_until = self.now + fault.how_long
            self._inbox.clear()
        elif kind == "stuck":
            self._stuck_until = self.now + fault.how_long
            return False
        elif kind == "reboot":
            self.power_on()
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
