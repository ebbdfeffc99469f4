"""Devices behind a stop switch, and live pictures of them."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

from turnscan.arrays import Image
from turnscan.devices import StopSwitch, burning, frame_deadline
from turnscan.scanner import Opened
from turnscan.workflows._options._device import DeviceOptions
from turnscan.workflows._scanning._scan import opened_devices
from turnscan.workflows._scanning._watched import WatchedLasers, watched

_FASTEST = 1 / 30
"""s from one live picture to the next, at least."""


@dataclass(frozen=True)
class StoppableDevices:
    """Devices that obey until the switch is pressed."""

    opened: Opened
    """Behind the switch."""
    lasers: WatchedLasers
    """Know what was confirmed of each."""
    switch: StopSwitch


@contextmanager
def stoppable_devices(options: DeviceOptions) -> Iterator[StoppableDevices]:
    """Open devices, their lasers dark. Raises InputError, DeviceError and SafetyError."""
    with opened_devices(options) as there:
        lasers = watched(there.hardware.lasers)
        lasers.off()
        switch = StopSwitch(lasers, there.hardware.turntable)
        hardware = replace(there.hardware, lasers=switch.lasers, turntable=switch.turntable)
        yield StoppableDevices(replace(there, hardware=hardware), lasers, switch)


def live_pictures(
    devices: Opened,
    lit: frozenset[str],
    exposure: float | None,
    gain: float,
    wanted: Callable[[], bool],
) -> Generator[Image]:
    """Pictures with these lasers lit, for as long as they are ``wanted``; close it at the end.

    ``exposure`` in s; None takes what suits the devices.

    The lasers burn while a picture is taken, and are dark when it is handed out, and at the end.
    Raises DeviceError and SafetyError.
    """
    hardware = devices.hardware
    seconds = exposure or devices.exposure
    try:
        exposed, _ = hardware.camera.configure(seconds, gain)
        wait = frame_deadline(exposed if math.isfinite(exposed) else seconds)
        if lit:  # the first picture may take long, and nothing needs light for it
            hardware.camera.grab(frame_deadline(seconds, first=True))
        while wanted():
            began = time.monotonic()
            with burning(hardware.lasers, lit):
                picture = hardware.camera.grab(wait)
            yield picture
            time.sleep(max(0.0, _FASTEST - (time.monotonic() - began)))
    finally:
        hardware.lasers.off()
