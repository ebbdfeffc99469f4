"""The simulated camera, turntable and lasers: one bench, driven like any other hardware."""

from __future__ import annotations

import math
import threading
from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Image
from turnscan.devices import CameraTraits, exposed
from turnscan.errors import DeviceRefused, DeviceTimeout, InputError
from turnscan.simulate._bench import Bench
from turnscan.simulate._hand import Hand
from turnscan.simulate._random import seed64
from turnscan.simulate._render import Renderer


@dataclass(frozen=True)
class Faults:
    """What goes wrong, on request. Shares are of all pictures, 0 to 1."""

    stale: float = 0.0
    """Pictures that are the one before, from a buffer."""
    drop: float = 0.0
    """Pictures that never arrive."""
    stuck_on: frozenset[str] = frozenset()
    """Lasers that stay lit."""
    stuck_off: frozenset[str] = frozenset()
    """Lasers that stay dark."""

    def __post_init__(self) -> None:
        for name in ("stale", "drop"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InputError(f"{name} = {getattr(self, name):g}, expected 0 to 1")


class World:
    """What camera, turntable and lasers share: where the table is and which lasers are lit.

    A ``hand`` holds its board another way each time the camera is set up, and puts it on the table
    as soon as that is told to move: so whoever takes pictures for a calibration needs no more
    than one address.
    """

    def __init__(
        self, bench: Bench, faults: Faults | None = None, hand: Hand | None = None
    ) -> None:
        self.bench = bench
        self.faults = faults or Faults()
        self._hand, self._held = hand, 0
        self._renderer = Renderer(bench) if hand is None else None
        self._on_table: Renderer | None = None
        self.put_down()
        self.commanded = 0.0
        self.moves = 0
        self.forward = True
        self.lit: frozenset[str] = frozenset()

    @property
    def angle(self) -> float:
        """The table's true angle, rad."""
        b = self.bench
        return b.motion.angle(self.commanded, self.moves, self.forward, b.seed)

    @property
    def renderer(self) -> Renderer:
        """Of what there is to be seen now."""
        if self._renderer is None:
            self._renderer = Renderer(self.bench)
        return self._renderer

    def take_up(self) -> None:
        """The hand, if there is one, holds the board another way."""
        if self._hand is not None:
            self._held += 1
            self.bench, self._renderer = self._hand.holding(self._held, self.angle), None

    def put_down(self) -> None:
        """The hand, if there is one, puts the board on the table."""
        if self._hand is not None:
            if self._on_table is None:
                self._on_table = Renderer(self._hand.standing())
            self.bench, self._renderer = self._on_table.bench, self._on_table

    @property
    def burning(self) -> frozenset[str]:
        """The lasers that really are lit."""
        return (self.lit | self.faults.stuck_on) - self.faults.stuck_off


class SimCamera:
    """`turnscan.devices.Camera` of a bench."""

    def __init__(self, world: World) -> None:
        self._world = world
        self.traits = CameraTraits(instant=True, noiseless=not world.bench.noise)
        self._seconds, self._gain = 0.02, 1.0
        self._attempts: dict[tuple[object, ...], int] = {}
        self._last: Image | None = None

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        """Exposure in steps of 10 µs and gain 0.1 to 100; raises DeviceRefused for others."""
        if not 0.0 < seconds <= 60.0:
            raise DeviceRefused(
                f"simulated camera: exposure {seconds:g} s",
                hint="give an exposure of 10 µs to 60 s",
            )
        if not 0.1 <= gain <= 100.0:
            raise DeviceRefused(
                f"simulated camera: gain {gain:g}", hint="give a gain of 0.1 to 100"
            )
        self._seconds, self._gain = max(round(seconds, 5), 1e-5), gain
        self._world.take_up()
        return self._seconds, self._gain

    def grab(self, timeout: float) -> Image:
        """One picture; raises DeviceTimeout for one that a fault has dropped."""
        world, faults = self._world, self._world.faults
        place = (world.angle, world.burning, self._seconds, self._gain)
        exposed()  # what takes long from here on is arithmetic, which needs no light
        attempt = self._attempts[place] = self._attempts.get(place, -1) + 1
        luck = chance(world.bench, world.commanded, world.burning, attempt)
        if luck[0] < faults.drop:
            raise DeviceTimeout(f"simulated camera: no picture within {timeout:g} s")
        if luck[1] < faults.stale and self._last is not None:
            return self._last
        self._last = world.renderer.picture(
            world.angle,
            world.burning,
            self._seconds,
            gain=self._gain,
            start=float(luck[2]),
            shot=attempt,
        )
        self._last.flags.writeable = False
        return self._last


def chance(
    bench: Bench, angle: float, burning: frozenset[str], attempt: int
) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Three numbers in (0, 1) that this picture decides."""
    lit = sum(1 << i for i, b in enumerate(bench.beams) if b.name in burning)
    seed = seed64(bench.seed, round(angle * 1e9), lit, attempt, 11)
    return np.random.default_rng(int(seed)).uniform(size=3)


class SimTurntable:
    """`turnscan.devices.Turntable` of a bench; it reports the commanded angle, as steppers do."""

    def __init__(self, world: World) -> None:
        self._world = world

    def move_to(self, angle: float, timeout: float) -> float:
        """Go there at once. Raises DeviceRefused for an angle that is not a number."""
        if not math.isfinite(angle):
            raise DeviceRefused(f"simulated turntable: angle {angle}", hint="give a finite angle")
        if angle != self._world.commanded:
            self._world.forward = angle > self._world.commanded
            self._world.moves += 1
        self._world.commanded = angle
        self._world.put_down()
        return angle

    def stop(self) -> None:
        """It is always at rest."""


class SimLasers:
    """`turnscan.devices.Lasers` of a bench."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._lock = threading.RLock()
        self._timer: threading.Timer | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The lasers there are."""
        return tuple(b.name for b in self._world.bench.beams)

    def light(self, lit: frozenset[str], lease: float) -> None:
        """Light these. Raises DeviceRefused for a name there is not or a lease that is not > 0."""
        unknown = sorted(lit - set(self.names))
        if unknown:
            raise DeviceRefused(f"simulated lasers: no {unknown[0]!r}; there is {self.names}")
        if not 0.0 < lease < 1e6:
            raise DeviceRefused(f"simulated lasers: lease {lease:g} s", hint="give 0 to 1e6 s")
        with self._lock:
            self._world.lit = frozenset(lit)
            self._count_down(lease if lit else None)

    def renew(self, lease: float) -> None:
        """See `turnscan.devices.Lasers`."""
        with self._lock:
            if self._timer is not None:
                self._count_down(lease)

    def _count_down(self, lease: float | None) -> None:
        """Again; None for nothing that is lit."""
        if self._timer is not None:
            self._timer.cancel()
        self._timer = None if lease is None else threading.Timer(lease, self._expire)
        if self._timer is not None:
            self._timer.daemon = True
            self._timer.start()

    def _expire(self) -> None:
        with self._lock:
            if threading.current_thread() is self._timer:  # and not one that came too late
                self.off()

    def off(self) -> None:
        """All dark, from any state and thread."""
        with self._lock:
            self._world.lit = frozenset()
            self._count_down(None)
