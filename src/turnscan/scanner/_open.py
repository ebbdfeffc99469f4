"""Devices by their addresses: real ones, or a simulated rig that is all of them in one."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from turnscan.acquire import Hardware
from turnscan.devices import Steady, open_camera, open_devices, open_turntable
from turnscan.errors import InputError
from turnscan.rig import Rig

_USUAL_SECONDS = 0.02
"""Of an exposure, by default."""


@dataclass(frozen=True)
class Addresses:
    """Where the devices are."""

    camera: str
    turntable: str
    lasers: str
    """Empty for none, with a table that a person turns."""


@dataclass(frozen=True)
class Opened:
    """Devices, and what only a simulated rig knows."""

    at: Addresses
    hardware: Hardware
    seconds: float | None = None
    """The exposure that suits it, where that is known."""
    steps: int | None = None
    """Of a turn."""
    rig: Rig | None = None
    """The true one."""

    @property
    def exposure(self) -> float:
        """s, by default."""
        return self.seconds or _USUAL_SECONDS


@contextmanager
def opened(at: Addresses) -> Iterator[Opened]:
    """The devices, closed on every way out, the lasers dark before anything else.

    Pictures of real cameras are looked at, and taken again where something is wrong with them.
    Raises InputError for addresses that are none, DeviceError and SafetyError as the devices do.
    """
    simulated = [a.startswith("sim:") for a in (at.turntable, at.lasers)]
    if any(simulated):
        if not len({at.camera, at.turntable, at.lasers}) == 1:
            raise InputError(
                "a simulated rig is camera, turntable and lasers in one",
                hint="give sim:… alone, for all three",
            )
        yield _bench(at)
        return
    if not at.lasers and at.turntable == "manual:":
        with open_camera(at.camera) as camera:
            yield Opened(at, Hardware(Steady(camera), open_turntable("manual:"), _NoLasers()))
        return
    with open_devices(at.turntable, at.lasers) as board, open_camera(at.camera) as camera:
        yield Opened(at, Hardware(Steady(camera), board.turntable, board.lasers))


class _NoLasers:
    """Nothing that could be lit."""

    names: tuple[str, ...] = ()

    def light(self, lit: frozenset[str], lease: float) -> None:
        """Nothing, or InputError for a laser."""
        if lit:
            raise InputError(f"no laser {min(lit)!r}", hint="give the address of the lasers")

    def renew(self, lease: float) -> None:
        """Nothing is lit."""

    def off(self) -> None:
        """Dark already."""


def _bench(at: Addresses) -> Opened:
    from turnscan.simulate import simulated

    bench = simulated(at.camera)
    hardware = Hardware(bench.camera, bench.turntable, bench.lasers)
    return Opened(at, hardware, bench.seconds, bench.steps, bench.world.bench.rig)
