"""Cameras that misbehave on purpose, in a time of their own."""

from __future__ import annotations

import math
import time
from collections import deque
from typing import Any

import numpy as np

from turnscan.arrays import Image
from turnscan.devices import CameraTraits
from turnscan.errors import DeviceTimeout


class Clock:
    """A time that passes only when somebody waits."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


class WallClock(Clock):
    """The time of the wall: setting it forward waits."""

    @property
    def now(self) -> float:
        return time.monotonic()

    @now.setter
    def now(self, until: float) -> None:
        time.sleep(max(until - time.monotonic(), 0.0))


class Rolling:
    """A camera that runs all the time: picture k is exposed from k·period on.

    It arrives ``latency`` periods after its exposure began and waits in a queue; when the queue
    is full, new pictures are lost and old ones stay, as in Linux.
    """

    def __init__(self, clock: Clock, buffers: int, period: float, latency: float) -> None:
        self.clock, self.buffers, self.period, self.latency = clock, buffers, period, latency
        self.queue: deque[int] = deque()
        self.next = math.ceil((clock.now + period) / period)

    def arrival(self, number: int) -> float:
        return (number + self.latency) * self.period

    def start(self, number: int) -> float:
        return number * self.period

    def take(self) -> int:
        """The oldest picture in the queue, or the next one that arrives."""
        while self.arrival(self.next) <= self.clock.now:
            if len(self.queue) < self.buffers:
                self.queue.append(self.next)
            self.next += 1
        if self.queue:
            return self.queue.popleft()
        self.clock.now = self.arrival(self.next)
        self.next += 1
        return self.next - 1


class FakeCapture:
    """`cv2.VideoCapture` of a webcam, with the step of the table drawn into every picture."""

    def __init__(self, roll: Rolling, seed: int = 0, size: tuple[int, int] = (24, 32)) -> None:
        self.roll, self.size = roll, size
        self.rng = np.random.default_rng(seed)
        self.props: dict[int, float] = {3: size[1], 4: size[0], 5: 1 / roll.period, 14: 16.0, 15: 1}
        self.fixed: set[int] = set()
        self.backend = "V4L2"
        self.opened, self.gone, self.released = True, False, False
        self.steps: list[tuple[float, int]] = [(-1.0, 0)]
        self.number = -1

    def isOpened(self) -> bool:
        return self.opened

    def getBackendName(self) -> str:
        return self.backend

    def get(self, prop: int, /) -> float:
        return self.props.get(prop, 0.0)

    def set(self, prop: int, value: float, /) -> bool:
        if prop not in self.fixed:
            self.props[prop] = value
        return prop not in self.fixed

    def grab(self) -> bool:
        if self.gone:
            return False
        self.roll.clock.now += self.rng.uniform(0.0, 0.1 * self.roll.period)
        self.number = self.roll.take()
        return True

    def step_at(self, when: float) -> int:
        return next(s for t, s in reversed(self.steps) if t <= when)

    def retrieve(self) -> tuple[bool, Any]:
        image = self.rng.integers(0, 30, (*self.size, 3)).astype(np.uint8)
        step = self.step_at(self.roll.start(self.number))
        image[0, 0] = step % 256, step // 256 % 256, step // 65536  # blue, green, red
        return True, image

    def release(self) -> None:
        self.released = True


def step_in(image: Image) -> int:
    """The step drawn into a picture of a `FakeCapture`, after it has become red, green, blue."""
    red, green, blue = (int(x) for x in image[0, 0])
    return blue + 256 * green + 65536 * red


class Buffered:
    """A driver that breaks its promise: it hands out what lies in the buffer."""

    traits = CameraTraits()

    def __init__(self, roll: Rolling, seconds: float) -> None:
        self.roll, self.seconds = roll, seconds
        self.rng = np.random.default_rng(1)
        self.last = -1

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        return self.seconds, gain

    def grab(self, timeout: float) -> Image:
        self.last = self.roll.take()
        return self.rng.integers(0, 30, (16, 32)).astype(np.uint8)


KINDS = ("dropped", "frozen", "torn", "blank", "wrong size", "black", "saturated")


class Faulty:
    """A camera with noise whose pictures go wrong as a script says: one kind per grab, or None."""

    traits = CameraTraits(instant=True)

    def __init__(self, script: Any, shape: tuple[int, ...] = (48, 64), seed: int = 0) -> None:
        self.script, self.shape = iter(script), shape
        self.rng = np.random.default_rng(seed)
        self.last = self._good()
        self.right: Image | None = None
        """The picture of the last grab if it was as it should be."""
        self.injected: list[str] = []

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        return seconds, gain

    def _good(self) -> Image:
        image = self.rng.normal(40.0, 3.0, self.shape)
        image[:, self.shape[1] // 2] += 150.0
        return np.clip(image, 0, 255).astype(np.uint8)

    def grab(self, timeout: float) -> Image:
        kind = next(self.script)
        self.right = None
        if kind is not None:
            self.injected.append(kind)
        if kind == "dropped":
            raise DeviceTimeout(f"no picture within {timeout:g} s")
        image = self._good()
        rows = int(self.rng.integers(8, self.shape[0] - 8))
        if kind == "frozen":
            image = self.last
        elif kind == "torn":
            image[rows:] = self.last[rows:]
        elif kind == "blank":
            image[rows:] = 0
        elif kind == "wrong size":
            image = image[:-2]
        elif kind == "black":
            image = np.full_like(image, 2)
        elif kind == "saturated":
            image = np.full_like(image, 255)
        else:
            self.right = image
        if kind not in ("wrong size", "black", "saturated"):
            self.last = image
        return image
