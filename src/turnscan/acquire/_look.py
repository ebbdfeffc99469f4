"""The first pictures of a scan decide its threshold and its size, and are its first frames."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from turnscan.acquire._capture import Hardware, Shooter
from turnscan.acquire._plan import Exposure, Plan
from turnscan.arrays import ColourWeights, Image
from turnscan.errors import DeviceTimeout, InputError, StorageFull
from turnscan.scan import (
    LEAST_THRESHOLD,
    NOISE_FACTOR,
    Frame,
    Keep,
    ScanPlan,
    packed_size,
    signal_of,
    statistics,
)

Weigh = Callable[[Image, Image], ColourWeights]
"""Lit and dark colour picture → how much of red, green and blue is laser."""

_ROOM_FACTOR = 1.2
_ROOM_BYTES = 200_000_000
_TEXTURE_PACKED = 0.8
"""Size of a packed whole picture, as a share of the raw one."""


@dataclass(frozen=True)
class FirstLook:
    """What the first angle showed."""

    scan_plan: ScanPlan
    pictures: Mapping[tuple[str, int], Image]
    """By set of lasers ("" for none) and exposure; the run uses them and takes them no more."""
    accepted: Mapping[int, tuple[float, float]]
    """s and gain that the camera accepted for each exposure."""
    noise: float
    """Grey levels of the signal."""
    frame_bytes: float
    """Of one stored frame, about."""

    @property
    def threshold_reason(self) -> str:
        """Why the threshold is what it is, in words."""
        t = self.scan_plan.threshold
        if t > NOISE_FACTOR * self.noise:
            return f"threshold {t:.1f} grey levels, the least there is; noise {self.noise:.2f}"
        return f"threshold {t:.1f} grey levels: {NOISE_FACTOR:g} × the noise of {self.noise:.2f}"


def look(
    plan: Plan,
    hardware: Hardware,
    *,
    keep: Keep = "sparse",
    orientation: str = "vertical",
    source: str = "",
    weigh: Weigh | None = None,
    threshold: float | None = None,
) -> FirstLook:
    """Take the pictures of the first step with the first exposure and plan the scan file by them.

    ``weigh`` is needed for colour cameras; ``threshold`` None is chosen from the noise. Raises
    InputError for a laser there is not or a camera whose pictures cannot be used, and DeviceError
    and SafetyError as the devices do. The lasers are dark when this returns, however it returns.
    """
    shooter = Shooter(plan, hardware)
    shooter.check_names()
    exposure: Exposure = plan.exposures[0]
    with shooter.dark_at_the_end():
        hardware.turntable.move_to(plan.angle(0), shooter.move_timeout)
        shooter.settle()
        accepted = shooter.configure(exposure)
        pictures: dict[tuple[str, int], Image] = {}
        wanted = {"": frozenset[str](), **plan.sets}
        for name, lit in wanted.items():
            picture, cause = shooter.picture(lit)
            if picture is None:
                raise DeviceTimeout(
                    f"camera: no picture ({cause})", hint="check the camera before the scan"
                )
            pictures[name, 0] = picture
    dark, first = pictures["", 0], pictures[next(iter(plan.sets)), 0]
    weights = None
    if first.ndim == 3:
        if weigh is None:
            raise InputError("a colour camera needs the colour of the laser")
        weights = weigh(first, dark)
    off = dark if plan.dark_every else None
    seen = [statistics(signal_of(pictures[name, 0], off, weights)) for name in plan.sets]
    noise = max(s.noise for s in seen)
    chosen = max(NOISE_FACTOR * noise, LEAST_THRESHOLD) if threshold is None else threshold
    _check_threshold(chosen, first.dtype, noise, threshold is None)
    scan_plan = ScanPlan(
        width=first.shape[1],
        height=first.shape[0],
        dtype="uint8" if first.dtype == np.uint8 else "uint16",
        channels=1 if first.ndim == 2 else 3,
        lasers=tuple(plan.sets),
        steps=plan.steps,
        threshold=chosen,
        keep=keep,
        orientation="vertical" if orientation == "vertical" else "horizontal",
        weights=weights,
        source=source,
        exposures=len(plan.exposures),
    )
    sizes = [packed_size(Frame(0, name, pictures[name, 0], off), scan_plan) for name in plan.sets]
    if not plan.dark_every:
        del pictures["", 0]
    return FirstLook(scan_plan, pictures, {0: accepted}, noise, sum(sizes) / len(sizes))


def _check_threshold(threshold: float, dtype: np.dtype[Any], noise: float, by_noise: bool) -> None:
    """Raise InputError for a threshold that no pixel of this depth can exceed."""
    top = np.iinfo(dtype).max
    if threshold < top:
        return
    reason = f"chosen for a noise of {noise:.1f}, " if by_noise else ""
    raise InputError(
        f"threshold {threshold:g} grey levels, {reason}and the pixels of this camera end at {top}",
        hint="darken the room and check the camera's gain" if by_noise else f"give less than {top}",
    )


def estimate(plan: Plan, first: FirstLook) -> int:
    """Bytes that the scan file will have, about."""
    frames = plan.steps * len(plan.sets) * len(plan.exposures)
    total = frames * (first.frame_bytes + 500)
    if plan.texture is not None:
        p = first.scan_plan
        raw = p.width * p.height * p.channels * np.dtype(p.dtype).itemsize
        total += math.ceil(plan.steps / plan.texture.every) * raw * _TEXTURE_PACKED
    return int(total)


def check_room(path: Path, wanted: int, free: int | None = None) -> None:
    """Raise StorageFull where less is free than 1.2 times the estimate and 200 MB.

    ``free`` None asks the disk.
    """
    if free is None:
        free = shutil.disk_usage(path.resolve().parent).free
    needed = int(_ROOM_FACTOR * wanted) + _ROOM_BYTES
    if free < needed:
        raise StorageFull(
            f"{path}: the scan needs {needed / 1e6:.0f} MB with reserve, {free / 1e6:.0f} MB are "
            "free",
            hint="free some space, choose another disk, or take fewer steps",
        )
