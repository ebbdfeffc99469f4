"""One picture: light, expose, dark. The only place of the room that lights a laser."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass

from turnscan.acquire._plan import Exposure, Plan
from turnscan.arrays import Image
from turnscan.devices import Camera, Lasers, Sweeping, Turntable, burning
from turnscan.errors import DeviceDisconnected, DeviceError, DeviceRefused, InputError, LeaseEnded

_TRIES = 2
_LIGHTED = 4
"""Times that a laser is lit for it each time, where it went out before the picture came."""
_MOVE_TIMEOUT = 3600.0
"""s for one move; drivers have shorter ones of their own, and a person may be the driver."""


@dataclass(frozen=True)
class Hardware:
    """All that a scan is taken with."""

    camera: Camera
    turntable: Turntable
    lasers: Lasers


class Shooter:
    """Takes pictures; lasers are lit for the exposure alone."""

    def __init__(self, plan: Plan, hardware: Hardware) -> None:
        self._plan = plan
        self._hw = hardware
        self._exposure: Exposure | None = None
        self._accepted = (0.0, 0.0)
        self._first = True
        self.move_timeout = _MOVE_TIMEOUT

    def check_names(self) -> None:
        """Raise InputError for a laser or lamp that the board does not have."""
        lamps = self._plan.texture.lamps if self._plan.texture else ()
        for name in (*self._plan.lasers, *lamps):
            if name not in self._hw.lasers.names:
                there = ", ".join(self._hw.lasers.names)
                raise InputError(f"no laser {name!r}", hint=f"there is {there}")

    def settle(self) -> None:
        """Wait for the table's last tremor."""
        if self._plan.settle:
            time.sleep(self._plan.settle)

    def configure(self, exposure: Exposure) -> tuple[float, float]:
        """Set an exposure where it is not set already; s and gain that the camera accepted."""
        if exposure != self._exposure:
            self._accepted = self._hw.camera.configure(exposure.seconds, exposure.gain)
            self._exposure = exposure
        return self._accepted

    def picture(self, lit: frozenset[str]) -> tuple[Image | None, str]:
        """One picture with these lasers, asked for twice at most; or None and the cause.

        All is dark when this returns, except by an error. Raises DeviceError and SafetyError, and
        DeviceRefused for an exposure that covers no whole sweeps of a mirror.
        """
        seconds = self._exposure.seconds if self._exposure else 0.0
        if lit and isinstance(self._hw.lasers, Sweeping):
            told = self._accepted[0]
            self._hw.lasers.check_exposure(seconds if math.isnan(told) else told)
        timeout = max(20.0 if self._first else 5.0, 5.0 * seconds)
        cause = ""
        for _ in range(_TRIES):
            picture, cause = self._lighted(lit, timeout)
            if picture is not None:
                self._first = False
                return picture, ""
        return None, cause

    def _lighted(self, lit: frozenset[str], timeout: float) -> tuple[Image | None, str]:
        cause = ""
        for _ in range(_LIGHTED):
            try:
                with burning(self._hw.lasers, lit):
                    return self._exposed(timeout)
            except LeaseEnded as e:
                cause = e.message
        return None, cause

    def _exposed(self, timeout: float) -> tuple[Image | None, str]:
        try:
            return self._hw.camera.grab(timeout), ""
        except (DeviceDisconnected, DeviceRefused):
            raise
        except DeviceError as e:  # late, damaged, frozen, clipped: another one may be better
            return None, e.message

    @contextlib.contextmanager
    def dark_at_the_end(self) -> Iterator[None]:
        """Lasers off before and after the block; after an error the table is stopped too.

        `Lasers.off` transmits whatever is believed about the lasers; where it cannot be confirmed,
        its error is the one that leaves.
        """
        self._hw.lasers.off()
        try:
            yield
        except BaseException:
            try:
                self._hw.lasers.off()
            finally:
                with contextlib.suppress(DeviceError):
                    self._hw.turntable.stop()
            raise
        else:
            self._hw.lasers.off()
