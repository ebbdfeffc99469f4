"""Pictures for a calibration: of a board in a hand, or of what is fixed to the table."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from turnscan.arrays import Image
from turnscan.errors import InputError
from turnscan.scanner._examine import Examination
from turnscan.scanner._open import Opened
from turnscan.scanner._prepare import SETTLE, stops_of

MOST_PICTURES = 400
LONGEST_PAUSE = 60.0
"""s between two pictures."""


@dataclass(frozen=True)
class Series:
    """Pictures to be taken; raises InputError naming the value that cannot be."""

    count: int = 1
    range_deg: tuple[Fraction, Fraction] | None = None
    """The table turns from here to there, a picture at each stop; None leaves it where it is."""
    every: float = 0.0
    """s before each picture, in which a hand moves the board."""
    lasers: tuple[str, ...] = ()
    """At each stop one more picture with each of them lit."""
    seconds: float | None = None
    """Exposure; None takes what suits the bench."""
    gain: float = 1.0

    def __post_init__(self) -> None:
        if not 1 <= self.count <= MOST_PICTURES:
            raise InputError(f"{self.count} pictures", hint=f"take 1 to {MOST_PICTURES}")
        if not 0.0 <= self.every <= LONGEST_PAUSE:
            raise InputError(f"{self.every:g} s between pictures", hint="take 0 to 60 s")
        self.angles_deg()

    def angles_deg(self) -> list[float | None]:
        """Commanded angle at each picture. A whole turn ends before its start."""
        if self.range_deg is None:
            return [None] * self.count
        step, count = stops_of(self.range_deg, self.count, None, self.count)
        return [float(self.range_deg[0] + k * step) for k in range(count)]


@dataclass(frozen=True)
class Shot:
    """One picture without laser, and perhaps one of the same with a laser lit."""

    stop: int
    angle_deg: float | None
    """Commanded; None where it was left alone."""
    dark: Image
    laser: str = ""
    lit: Image | None = None


def photograph(
    bench: Opened,
    series: Series,
    keep: Callable[[Shot], None],
    wait: Callable[[float], None] = time.sleep,
) -> None:
    """Take a series and hand over each shot as it is taken, one per laser, or one per stop.

    Each laser has a picture without light of its own, so that the noise of two shots is never the
    same. ``keep`` and ``wait`` may end the series by an exception. The lasers are dark when this
    returns, however it does. Raises InputError for a laser that there is not, DeviceError and
    SafetyError as the devices do.
    """
    unknown = set(series.lasers) - set(bench.hardware.lasers.names)
    if unknown:
        there = ", ".join(bench.hardware.lasers.names)
        raise InputError(f"no laser {min(unknown)!r}", hint=f"there is {there}")
    seconds = series.seconds or bench.exposure
    for stop, angle in enumerate(series.angles_deg()):
        if series.every:
            wait(series.every)
        look = Examination(bench.hardware, seconds, series.gain)
        with look.shooter.dark_at_the_end():
            if angle is not None:
                bench.hardware.turntable.move_to(math.radians(angle), look.shooter.move_timeout)
                if not bench.steps:  # a simulated table does not tremble
                    wait(SETTLE)
            for laser in series.lasers:
                dark = look.picture()
                keep(Shot(stop, angle, dark, laser, look.picture(laser)))
            if not series.lasers:
                keep(Shot(stop, angle, look.picture()))
