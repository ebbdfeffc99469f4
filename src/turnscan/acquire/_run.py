"""One turn of the table into a scan file: step, light, picture, dark, picture."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from turnscan.arrays import Image
from turnscan.devices import Camera, Lasers, Turntable
from turnscan.errors import DeviceTimeout, InputError
from turnscan.scan import Frame

Progress = Callable[[int, int], None]


class Sink(Protocol):
    """Where frames go: a `turnscan.scan.Scan`, or anything else that keeps them."""

    def add(self, frame: Frame) -> object:
        """Keep a frame."""
        ...

    def add_missing(self, step: int, laser: str, cause: str, commanded: float) -> None:
        """Keep the fact that there is none, and why."""
        ...


@dataclass(frozen=True)
class Turn:
    """What to do: at each angle, one picture with each laser and one with none.

    Raises InputError, naming the value, where it cannot be done.
    """

    angles: tuple[float, ...]
    """rad, where the table stops, in order."""
    lasers: tuple[str, ...]
    seconds: float
    """Exposure time."""
    gain: float = 1.0
    grab_timeout: float = 5.0
    """s, for one picture; a camera that misses it is asked once more."""
    move_timeout: float = 30.0
    """s, for one move."""
    lease: float = 30.0
    """s after which a laser goes dark by itself if this program dies."""

    def __post_init__(self) -> None:
        if not self.angles or not all(map(math.isfinite, self.angles)):
            raise InputError("a turn needs at least one finite angle")
        if not 0.0 < self.seconds < math.inf:
            raise InputError(f"exposure {self.seconds:g} s", hint="give an exposure above 0 s")
        if not 0.0 < self.gain < math.inf:
            raise InputError(f"gain {self.gain:g}", hint="give a gain above 0")
        if not self.lasers:
            raise InputError("a turn needs at least one laser")


def run(
    turn: Turn,
    camera: Camera,
    turntable: Turntable,
    lasers: Lasers,
    sink: Sink,
    progress: Progress | None = None,
    *,
    first_step: int = 0,
    clock: Callable[[], float] = time.time,
) -> None:
    """Drive the devices through the turn and store every frame as it comes.

    A picture that does not arrive is asked for once more, then recorded as missing with its cause;
    the turn goes on. The lasers are dark when this returns, however it returns.

    Raises InputError for a laser that is not there, and DeviceError, SafetyError or ScanError as
    devices and sink do.
    """
    for name in turn.lasers:
        if name not in lasers.names:
            raise InputError(f"no laser {name!r}", hint=f"there is {', '.join(lasers.names)}")
    try:
        lasers.off()
        seconds, gain = camera.configure(turn.seconds, turn.gain)
        told = {"seconds": seconds, "gain": gain}
        settings = {name: value for name, value in told.items() if math.isfinite(value)}
        for step, angle in enumerate(turn.angles):
            if step < first_step:
                continue
            reached = turntable.move_to(angle, turn.move_timeout)
            dark = _picture(turn, camera, lasers, frozenset())
            for name in turn.lasers:
                lit = _picture(turn, camera, lasers, frozenset({name}))
                lasers.off()
                if lit is None or dark is None:
                    sink.add_missing(step, name, "the camera gave no picture", angle)
                    continue
                measured = reached if reached != angle else math.nan
                sink.add(
                    Frame(step, name, lit, dark, commanded=angle, measured=measured,
                          time=clock(), settings=settings)
                )  # fmt: skip
            if progress is not None:
                progress(step + 1, len(turn.angles))
    finally:
        lasers.off()


def _picture(turn: Turn, camera: Camera, lasers: Lasers, lit: frozenset[str]) -> Image | None:
    for _ in range(2):
        if lit:
            lasers.light(lit, turn.lease)
        else:
            lasers.off()
        try:
            return camera.grab(turn.grab_timeout)
        except DeviceTimeout:
            continue
    return None


def even_turn(steps: int) -> tuple[float, ...]:
    """The angles of ``steps`` even steps of one turn, rad. Raises InputError below one step."""
    if steps < 1:
        raise InputError(f"{steps} steps", hint="a turn has at least one step")
    return tuple(2 * math.pi * k / steps for k in range(steps))
