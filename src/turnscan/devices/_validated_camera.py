"""Steady: a camera whose every picture has been looked at before anybody relies on it."""

from __future__ import annotations

import contextvars
import threading
import time
from collections import Counter, deque
from collections.abc import Callable

import numpy as np

from turnscan.arrays import Image
from turnscan.devices._lit import alive, exposing, went_out
from turnscan.devices._picture_faults import blank_rows, fault_of
from turnscan.devices._protocols import Camera, CameraTraits
from turnscan.errors import (
    DeviceDisconnected,
    DeviceError,
    DeviceGarbled,
    DeviceRefused,
    DeviceTimeout,
    LeaseEnded,
)

RETRIES = 3
FLUSHED = 64
"""Pictures from a buffer that are thrown away for one good one, at most."""
_EARLY = 0.9
"""A picture that comes before this share of its exposure is over began before it was asked for."""
_SCENE = 3
"""A part without light that is there so often, in the same rows, is the scene and no tear."""
_GRACE = 1.0
"""s that a driver may go beyond the time-out it was given before it counts as hanging."""
_SHORT = 0.5
"""s: longer exposures count as a sign of life while they last."""
_EXPOSURES = 2.0
"""For so many: the one that the camera was in, and the one that was asked for."""
_SLICE = 0.25

_HINTS = {
    "dropped": "check cable, power and USB or network load",
    "incomplete": "check cable and network; larger packets (packet=8192) lose less",
    "stale": "the driver returns buffered pictures, which is a defect of the driver",
    "frozen": "the camera delivers the same picture again; unplug it and plug it in again",
    "torn": "pictures are incomplete; check cable and bandwidth; use fewer pixels",
    "wrong size": "the picture size has changed; open the camera again, and calibrate again if "
    "the size is intended",
    "black": "check lens cap, laser and exposure",
    "saturated": "shorten the exposure or darken the room",
}


def frame_deadline(seconds: float, first: bool = False) -> float:
    """s to wait for a picture of this exposure; the first after opening may take longer."""
    return max(20.0 if first else 5.0, 5.0 * seconds if seconds > 0 else 0.0)


class Steady:
    """A `Camera` around another one: bad pictures are recognised and taken again.

    Dropped, incomplete, stale, frozen (the bytes of the picture before), torn (rows of the picture
    before, or none), of another size or type than the first, black where light is expected, and
    saturated ones are taken again up to three times. A camera that hangs beyond its time-out is
    left alone. ``counts`` says how often each was met.

    Inside `burning` each picture is a sign of life, and so is an exposure above 0.5 s for twice as
    long as it lasts. Once the laser has gone out there is nothing more to be taken.
    """

    def __init__(
        self,
        camera: Camera,
        *,
        retries: int = RETRIES,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.counts: Counter[str] = Counter()
        self._camera, self._retries, self._clock = camera, retries, clock
        self._traits: CameraTraits = getattr(camera, "traits", CameraTraits())
        self._seconds = 0.0
        self._size: tuple[tuple[int, ...], np.dtype[np.generic]] | None = None
        self._before: deque[Image] = deque(maxlen=2)
        self._accepted: Image | None = None
        self._blank: tuple[int, int] | None = None
        self._blank_seen = 0
        self._noise_seen = False
        self._hanging: threading.Thread | None = None

    @property
    def retaken(self) -> str:
        """How many pictures had to be taken again and why, with what to do; empty for none."""
        if not self.counts:
            return ""
        kinds = self.counts.most_common()
        many = ", ".join(f"{n} × {kind}" for kind, n in kinds)
        return f"pictures retaken: {many} → {_HINTS[kinds[0][0]]}"

    @property
    def traits(self) -> CameraTraits:
        """Those of the camera inside."""
        return self._traits

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        """As the camera inside does."""
        accepted = self._camera.configure(seconds, gain)
        self._seconds = accepted[0] if accepted[0] > 0 else 0.0
        return accepted

    def grab(self, timeout: float, *, lit: bool = False) -> Image:
        """One picture that shows nothing wrong; each attempt may take ``timeout`` seconds.

        ``lit`` says that there is light to be seen. Raises DeviceTimeout where none came in any
        attempt, DeviceRefused where all had another size than the first picture ever,
        DeviceGarbled where all were damaged and DeviceError where the reasons were several;
        LeaseEnded where the laser that burnt for it went out before.
        DeviceDisconnected and DeviceRefused of the driver come out at once.
        """
        faults: list[str] = []
        flushed, doubtful = 0, False
        while len(faults) <= self._retries:
            if went_out():
                raise LeaseEnded(
                    f"camera: no valid picture before the laser was switched off{_why(faults)}",
                    hint="check the camera and its cable",
                )
            fault, image = self._attempt(timeout, lit)
            if fault is None and image is not None:
                if not doubtful:
                    self._accepted = image
                    return image
                doubtful = False
                continue
            self.counts[str(fault)] += 1
            if fault == "stale" and flushed < FLUSHED:
                # The first picture behind the buffered ones may have begun before they were out;
                # the second has not.
                flushed, doubtful = flushed + 1, True
                continue
            faults.append(str(fault))
        raise self._given_up(faults, timeout)

    def _attempt(self, timeout: float, lit: bool) -> tuple[str | None, Image | None]:
        asked = self._clock()
        try:
            image = self._patiently(timeout)
        except DeviceTimeout:
            return "dropped", None
        except DeviceGarbled:
            return "incomplete", None
        if not self._traits.instant and self._clock() - asked < _EARLY * self._seconds:
            return "stale", None
        return self._look(image, lit), image

    def _look(self, image: object, lit: bool) -> str | None:
        if not isinstance(image, np.ndarray):
            return "wrong size"
        size = (image.shape, image.dtype)
        if self._size is None and image.ndim in (2, 3) and image.dtype in (np.uint8, np.uint16):
            self._size = size
        if size != self._size:
            return "wrong size"
        # Behind a burst of bad pictures, the one that comes again is the last good one.
        before = [*self._before] if self._accepted is None else [*self._before, self._accepted]
        fault = fault_of(image, () if self._traits.noiseless else before, lit)
        self._before.append(image)
        if fault is not None:
            return fault
        if image.min() == image.max():
            # In a dark room a clipped sensor gives nothing but zeros; one that has shown noise
            # before does not.
            return "black" if self._noise_seen else None
        blank = blank_rows(image)
        if blank is not None:
            self._blank_seen = self._blank_seen + 1 if blank == self._blank else 1
            self._blank = blank
            if self._blank_seen < _SCENE:
                return "torn"
        self._noise_seen = self._noise_seen or not lit
        return None

    def _patiently(self, timeout: float) -> Image:
        """The driver's picture, or DeviceTimeout even where the driver never returns."""
        if self._hanging is not None and self._hanging.is_alive():
            raise DeviceDisconnected(
                "camera: its driver is still blocked by an earlier picture",
                hint="unplug the camera, plug it in again and resume",
            )
        images: list[Image] = []
        errors: list[BaseException] = []

        def work() -> None:
            try:
                images.append(self._camera.grab(timeout))
            except BaseException as e:  # noqa: BLE001 raised again below, in the caller's thread
                errors.append(e)

        inside = contextvars.copy_context()  # so that the driver's signs of life count
        self._hanging = threading.Thread(
            target=inside.run, args=(work,), name="camera", daemon=True
        )
        self._hanging.start()
        self._wait(self._hanging, timeout + _GRACE)
        if errors:
            raise errors[0]
        if not images:
            raise DeviceTimeout(
                f"camera: its driver did not return within {timeout:g} s + {_GRACE:g} s"
            )
        alive()
        return images[0]

    def _wait(self, driver: threading.Thread, longest: float) -> None:
        """Until it is back. While it may be exposing, that it is not does not mean it hangs."""
        end = time.monotonic() + longest
        declared = _EXPOSURES * self._seconds if self._seconds > _SHORT else 0.0
        while driver.is_alive() and (left := end - time.monotonic()) > 0:
            driver.join(min(left, _SLICE) if declared else left)
            exposing(declared)

    def _given_up(self, faults: list[str], timeout: float) -> DeviceError:
        last = faults[-1]
        kinds = set(faults)
        message = f"camera: no valid picture in {len(faults)} attempts{_why(faults)}"
        if kinds == {"dropped"}:
            error: type[DeviceError] = DeviceTimeout
            message += f", {timeout:g} s each"
        elif kinds == {"wrong size"} and self._size is not None:
            error = DeviceRefused
            shape, dtype = self._size
            message += f"; the first had {shape[1]}×{shape[0]} pixels of {dtype}"
        elif kinds <= {"torn", "incomplete", "frozen"}:
            error = DeviceGarbled
        else:
            error = DeviceError
        return error(message, hint=_HINTS[last])


def _why(faults: list[str]) -> str:
    said = ", ".join(f"{n} × {name}" for name, n in Counter(faults).items())
    return f" ({said})" if said else ""
