"""A camera, table and lasers in one, quick and exact: a picture is a function of what is asked."""

from __future__ import annotations

import hashlib
import math
import threading
import time
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from turnscan.acquire import Exposure, Hardware, Plan
from turnscan.arrays import Image
from turnscan.errors import DeviceRefused

WIDTH, HEIGHT = 64, 48
NAMES = ("left", "right")


def picture_of(angle: float, lit: frozenset[str], seconds: float, attempt: int) -> Image:
    """The same arguments give the same bytes, in any process."""
    text = f"{angle:.9f} {sorted(lit)} {seconds:.6f} {attempt}"
    seed = int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big")
    noise = np.random.default_rng(seed).normal(12.0, 1.0, (HEIGHT, WIDTH))
    v, u = np.mgrid[:HEIGHT, :WIDTH]
    for name in lit:
        side = 20.0 if name == "left" else 44.0
        centre = side + 6.0 * math.cos(angle) * np.sin(v / 9.0)
        noise += 150.0 * np.exp(-((u - centre) ** 2) / 2 / 1.5**2)
    return np.clip(np.rint(noise), 0, 255).astype(np.uint8)


@dataclass
class Rig:
    """Writes down what is asked of it, with the time; ``errors`` are raised by the n-th picture."""

    names: tuple[str, ...] = NAMES
    stuck_on: frozenset[str] = frozenset()
    dead: frozenset[str] = frozenset()
    errors: dict[int, BaseException] = field(default_factory=dict)
    sunlit: float = 0.0
    """Grey levels per second of daylight on the part."""
    exposing: float = 0.0
    """s that a picture really takes."""
    moving: float = 0.0
    log: list[tuple[float, str]] = field(default_factory=list)
    lit: frozenset[str] = frozenset()
    seconds: float = 0.0
    at: float = 0.0
    grabs: int = 0
    _attempts: dict[object, int] = field(default_factory=dict)
    _stop: threading.Event = field(default_factory=threading.Event)

    def note(self, what: str) -> None:
        self.log.append((time.monotonic(), what))

    @property
    def said(self) -> list[str]:
        return [what for _, what in self.log]

    @property
    def hardware(self) -> Hardware:
        return Hardware(self, self, self)

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        self.note(f"configure {seconds:g} {gain:g}")
        self.seconds = seconds
        return seconds, gain

    def grab(self, timeout: float) -> Image:
        self.grabs += 1
        self.note(f"grab {'+'.join(sorted(self.lit)) or 'dark'}")
        if self.exposing:
            time.sleep(self.exposing)
        self.note("grabbed")
        if self.grabs in self.errors:
            raise self.errors[self.grabs]
        burning = (self.lit | self.stuck_on) - self.dead
        place = (self.at, burning, self.seconds)
        attempt = self._attempts[place] = self._attempts.get(place, -1) + 1
        picture = picture_of(self.at, burning, self.seconds, attempt)
        if self.sunlit:  # a bright part in the middle of the picture, the brighter the longer
            picture[:, 12:52] = np.minimum(picture[:, 12:52] + self.sunlit * self.seconds, 255)
        return picture

    def move_to(self, angle: float, timeout: float) -> float:
        assert not self.lit, "the table turns while a laser is lit"
        self.note(f"move {math.degrees(angle):g}")
        self._stop.clear()
        if self.moving and self._stop.wait(self.moving):
            raise DeviceRefused("stopped")
        self.at = angle
        self.note("moved")
        return angle

    def stop(self) -> None:
        self.note("stop")
        self._stop.set()

    def light(self, lit: frozenset[str], lease: float) -> None:
        self.note(f"light {'+'.join(sorted(lit)) or 'none'}")
        self.lit = lit

    def renew(self, lease: float) -> None:
        self.note("renew")

    def off(self) -> None:
        self.note("off")
        self.lit = frozenset()


def plan_of(stops: int = 8, **more: object) -> Plan:
    """Steps of 9°, two lasers, one exposure."""
    given: dict[str, object] = {
        "step_deg": Fraction(9), "stops": stops, "lasers": NAMES, "exposures": (Exposure(0.01),),
    }  # fmt: skip
    return Plan(**{**given, **more})  # type: ignore[arg-type]
