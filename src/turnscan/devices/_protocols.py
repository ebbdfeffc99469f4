"""What a camera, a turntable and a set of lasers must do, whoever made them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from turnscan.arrays import Image


@dataclass(frozen=True)
class CameraTraits:
    """What a camera may say of its pictures, as an attribute ``traits``; without it, this."""

    instant: bool = False
    """A picture comes sooner than its exposure lasts: a file or a simulation."""
    noiseless: bool = False
    """Two pictures of the same thing may have the same bytes."""


@runtime_checkable
class Camera(Protocol):
    """Takes pictures. Errors are `turnscan.errors.DeviceError` and its kinds."""

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        """Set exposure time and gain factor; returns what the hardware accepted.

        NaN stands for a setting that this camera does not have or does not tell. Raises
        DeviceRefused for values that it cannot have; nothing is clipped in silence.
        """
        ...

    def grab(self, timeout: float) -> Image:
        """One picture whose exposure starts after the call; never a buffered frame.

        Raises DeviceTimeout when none arrives within ``timeout`` seconds.
        """
        ...


@runtime_checkable
class Turntable(Protocol):
    """Turns the object."""

    def move_to(self, angle: float, timeout: float) -> float:
        """Turn to ``angle`` rad and return the angle reached; blocks until the table is at rest.

        Raises DeviceTimeout when it is not at rest within ``timeout`` seconds.
        """
        ...

    def stop(self) -> None:
        """Stop at once, from any thread."""
        ...


@runtime_checkable
class Sweeping(Protocol):
    """Lasers whose line a mirror draws, again and again: an exposure must cover whole sweeps."""

    def check_exposure(self, seconds: float) -> None:
        """Raise DeviceRefused, naming the nearest that does, where it covers no whole sweeps."""
        ...


@runtime_checkable
class Lasers(Protocol):
    """Switches the lasers."""

    @property
    def names(self) -> tuple[str, ...]:
        """The lasers there are."""
        ...

    def light(self, lit: frozenset[str], lease: float) -> None:
        """Light exactly these; they go dark by themselves after ``lease`` seconds.

        A driver may refuse a lease above 2 s: who needs light for longer calls `renew`, as
        `turnscan.devices.burning` does.
        """
        ...

    def renew(self, lease: float) -> None:
        """What is lit stays so for ``lease`` seconds from now; lights nothing. From any thread."""
        ...

    def off(self) -> None:
        """All dark. Always transmits, from any state, any thread."""
        ...
