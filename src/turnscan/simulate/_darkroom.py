"""Pictures of a bench that somebody else turns and lights, ready before they are asked for."""

from __future__ import annotations

import threading
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor

from turnscan.arrays import Image
from turnscan.errors import DeviceTimeout
from turnscan.simulate._devices import World, chance

Exposure = tuple[float, float]
_Place = tuple[float, frozenset[str], Exposure]
_MOST = 4
"""Exposures that are kept in mind; a bracketed scan has so many."""
_LONGEST = 30.0
"""s that a picture may take to render."""


class Darkroom:
    """Renders what a camera will be asked for next: dark, then each laser, where the table rests.

    A served camera must hand out a picture at once, and rendering one takes longer than that. So
    the next pictures are begun when the table comes to rest (`look`), in a thread of its own, with
    the exposures that were asked for before. A context manager.
    """

    def __init__(self, world: World, seconds: float) -> None:
        """``seconds``: the exposure to begin with, until others are asked for."""
        self._world = world
        self._exposures: list[Exposure] = [(seconds, 1.0)]
        self._attempts: dict[_Place, int] = {}
        self._ready: dict[tuple[_Place, int], Future[Image]] = {}
        self._angle: float | None = None
        self._lock = threading.Lock()
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="darkroom")

    def __enter__(self) -> Darkroom:
        """Itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Drop what is not needed any more."""
        self._worker.shutdown(cancel_futures=True)

    def look(self) -> None:
        """The table has come to rest, perhaps elsewhere."""
        angle, faults = self._world.angle, self._world.faults
        with self._lock:
            if angle == self._angle:
                return
            self._angle = angle
            for future in self._ready.values():
                future.cancel()
            self._ready, self._attempts = {}, {}
            dark = frozenset[str]()
            for exposure in self._exposures:
                for lit in (dark, *(frozenset({b.name}) for b in self._world.bench.beams)):
                    burning = (lit | faults.stuck_on) - faults.stuck_off
                    self._develop((angle, burning, exposure), 0)

    def picture(self, seconds: float, gain: float) -> Image:
        """What the camera sees now.

        Raises DeviceTimeout where it takes too long to render, or the table turns meanwhile.
        """
        exposure = (seconds, gain)
        place = (self._world.angle, self._world.burning, exposure)
        with self._lock:
            if exposure not in self._exposures:
                self._exposures = [exposure, *self._exposures][:_MOST]
            attempt = self._attempts[place] = self._attempts.get(place, -1) + 1
            picture = self._develop(place, attempt)
        try:
            return picture.result(_LONGEST)
        except TimeoutError:
            raise DeviceTimeout(f"rendering took longer than {_LONGEST:g} s") from None
        except CancelledError:
            raise DeviceTimeout("the table turned during the exposure") from None

    def _develop(self, place: _Place, attempt: int) -> Future[Image]:
        key = (place, attempt)
        if key not in self._ready:
            self._ready[key] = self._worker.submit(self._render, place, attempt)
        return self._ready[key]

    def _render(self, place: _Place, attempt: int) -> Image:
        angle, burning, (seconds, gain) = place
        start = float(chance(self._world.bench, angle, burning, attempt)[2])
        return self._world.renderer.picture(
            angle, burning, seconds, gain=gain, start=start, shot=attempt
        )
