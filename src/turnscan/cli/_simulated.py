"""One simulated turn into a scan file or a folder, for ``turnscan simulate`` and ``demo``."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from turnscan.acquire import Turn, even_turn, run
from turnscan.arrays import Image
from turnscan.cli._import_signal import LEAST_THRESHOLD, NOISE_FACTOR
from turnscan.cli._output import write_atomically
from turnscan.errors import InputError
from turnscan.rig import rig_to_json
from turnscan.scan import Frame, ScanPlan, replacing_scan, signal_of, statistics
from turnscan.simulate import Simulated

Tick = Callable[[], None]
Keep = Literal["sparse", "full"]


def turn_of(devices: Simulated, seconds: float | None = None) -> Turn:
    """One whole turn with every laser. Raises InputError for an exposure that is not above 0."""
    exposure = devices.seconds if seconds is None else seconds
    return Turn(even_turn(devices.steps), devices.lasers.names, exposure)


def scan_into_file(devices: Simulated, turn: Turn, path: Path, keep: Keep, tick: Tick) -> None:
    """Write a scan file with the true rig in it; it appears only when it is whole."""
    plan = _plan(devices, turn, keep)
    with replacing_scan(path, plan, devices.world.bench.rig) as scan:
        run(
            turn, devices.camera, devices.turntable, devices.lasers, scan, lambda *_: tick(),
            clock=lambda: math.nan,
        )  # fmt: skip


def scan_into_folder(devices: Simulated, turn: Turn, folder: Path, tick: Tick) -> None:
    """Write pictures: a folder per laser and one for dark, angles.csv, rig.json.

    Raises InputError where the folder holds anything already.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder}: exists and is not an empty folder", hint="name a new folder")
    for name in ("dark", *turn.lasers):
        (folder / name).mkdir(parents=True, exist_ok=True)
    sink = _Folder(folder)
    run(turn, devices.camera, devices.turntable, devices.lasers, sink, lambda *_: tick())
    rows = [f"{step},{math.degrees(angle):.9f}" for step, angle in enumerate(turn.angles)]
    text = "\n".join(["number,angle_deg", *rows, ""])
    write_atomically(folder / "angles.csv", text.encode())
    write_atomically(folder / "rig.json", rig_to_json(devices.world.bench.rig).encode())


def _plan(devices: Simulated, turn: Turn, keep: Keep) -> ScanPlan:
    """A plan that fits the camera's pictures, its threshold from their noise."""
    camera, lasers = devices.camera, devices.lasers
    camera.configure(turn.seconds, turn.gain)
    lasers.off()
    devices.turntable.move_to(turn.angles[0], turn.move_timeout)
    dark, again = camera.grab(turn.grab_timeout), camera.grab(turn.grab_timeout)
    weights = None if dark.ndim == 2 else _weights(devices, turn, dark)
    noise = statistics(signal_of(dark, again, weights)).noise
    return ScanPlan(
        width=dark.shape[1],
        height=dark.shape[0],
        dtype="uint8" if dark.dtype == np.uint8 else "uint16",
        channels=1 if dark.ndim == 2 else 3,
        lasers=turn.lasers,
        steps=len(turn.angles),
        threshold=max(NOISE_FACTOR * noise, LEAST_THRESHOLD),
        keep=keep,
        weights=weights,
        source=f"simulated {devices.wish.scene}, rig {devices.wish.rig}",
    )


def _weights(devices: Simulated, turn: Turn, dark: Image) -> tuple[float, float, float]:
    from turnscan.stripes import learn_colour

    try:
        devices.lasers.light(frozenset(turn.lasers[:1]), turn.lease)
        red, green, blue = learn_colour(devices.camera.grab(turn.grab_timeout), dark)
        return float(red), float(green), float(blue)
    finally:
        devices.lasers.off()


@dataclass
class _Folder:
    """A `turnscan.acquire.Sink` that writes PNG files."""

    folder: Path
    _dark: set[int] = field(default_factory=set)

    def add(self, frame: Frame) -> None:
        """Write the lit picture, and the dark one of a new step."""
        write_png(self.folder / frame.laser / f"step_{frame.step:04d}.png", frame.lit)
        if frame.dark is not None and frame.step not in self._dark:
            self._dark.add(frame.step)
            write_png(self.folder / "dark" / f"step_{frame.step:04d}.png", frame.dark)

    def add_missing(self, step: int, laser: str, cause: str, commanded: float) -> None:
        """Write nothing: a picture that is not there is missing."""


def write_png(path: Path, picture: Image) -> None:
    """Write a picture, red first when it has colours, as PNG of 8 or 16 bits."""
    import cv2

    page = picture if picture.ndim == 2 else np.ascontiguousarray(picture[..., ::-1])
    _, data = cv2.imencode(".png", page)
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    part.write_bytes(data.tobytes())
    part.replace(path)
