"""Emulate: a simulated controller board on a serial port, and a camera on the network."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from turnscan.errors import InputError
from turnscan.formats import ExportOptions
from turnscan.progress import Progress, no_progress
from turnscan.rig import rig_to_json
from turnscan.simulate import simulated, spec_of
from turnscan.workflows._files._writing import check_writable, write_atomically
from turnscan.workflows._options._emulate import EmulateOptions
from turnscan.workflows._scanning._simulated import truth
from turnscan.workflows._surface._saving import save

_LOOK_EVERY = 0.2
"""s"""


@dataclass(frozen=True)
class EmulatedDevices:
    """Where the emulated devices are."""

    board: str
    """Address of turntable and lasers."""
    camera: str
    """Address of the camera; empty for none."""
    exposure: float
    """s: what suits the scene."""


@dataclass(frozen=True)
class EmulatedLog:
    """What the board and the camera say of the time they ran."""

    pictures: int
    times: int
    """How often a laser was lit."""
    total: float
    """s of laser light."""
    longest: float
    """s without a break."""
    lit: bool
    """At the end."""
    trouble: str
    """Why the camera sent black pictures; empty where it did not."""


def _ignore(devices: EmulatedDevices) -> None:
    """Show nothing."""


def emulate(
    dialect: str,
    scene: str = "sim:cup?seed=7",
    options: EmulateOptions | None = None,
    *,
    port: Path | None = None,
    rig: Path | None = None,
    truth_mesh: Path | None = None,
    ready: Callable[[EmulatedDevices], None] = _ignore,
    ended: type[BaseException] = KeyboardInterrupt,
    progress: Progress = no_progress,
) -> EmulatedLog:
    """Play a controller board on a serial port and a GigE Vision camera on the loopback network.

    Both see one simulated scene: what the board turns and lights, the camera sees.

    Parameters
    ----------
    dialect
        The board: grbl, horus, fabscan or sardauscan.
    scene
        A scene as `simulate` takes it.
    options
        How long, how fast, with or without camera.
    port
        Where the serial port appears; None makes a folder of its own.
    rig, truth_mesh
        Files for the scene's true rig, and for the part's true surface.
    ready
        Called with the addresses when the devices can be used.
    ended
        The exception by which a person ends it before its time; it is not raised on.
    progress
        Told how much of its time is over; it may cancel.

    Returns
    -------
    EmulatedLog
        Pictures taken, and how long lasers were lit.

    Raises
    ------
    InputError
        Where this system has no pseudo terminals, and for a scene or a board that is none.
    ExportError
        Where rig or truth cannot be written.
    """
    if os.name != "posix":
        raise InputError("a serial port can be emulated on Linux only")
    from turnscan.simulate.controllers import Emulator

    o = options or EmulateOptions()
    spec, faults = spec_of(scene if scene.startswith("sim:") else f"sim:{scene}")
    if faults.drop or faults.stale:
        raise InputError("drop, stale: faults of the simulated camera, not of the served one")
    for path in filter(None, (rig, truth_mesh)):
        check_writable(path)
    bench = simulated(spec, faults)
    emulator = Emulator(dialect, bench, port=port, camera=not o.no_camera, hurry=o.hurry)
    if rig is not None:
        write_atomically(rig, rig_to_json(bench.world.bench.rig).encode())
    if truth_mesh is not None:
        save({truth_mesh: truth(bench)}, ExportOptions())
    with _until(ended), emulator:
        ready(EmulatedDevices(emulator.board, emulator.camera or "", emulator.bench.seconds))
        end = time.monotonic() + o.seconds
        while (left := end - time.monotonic()) > 0:
            progress(1 - left / o.seconds)
            time.sleep(min(left, _LOOK_EVERY))
    lasers = emulator.laser_times()
    return EmulatedLog(
        emulator.pictures,
        lasers.times,
        lasers.total,
        lasers.longest,
        bool(emulator.firmware.lit),
        str(emulator.trouble or ""),
    )


@contextmanager
def _until(ended: type[BaseException]) -> Iterator[None]:
    try:
        yield
    except ended:
        return
