"""Webcams (UVC and whatever else OpenCV opens)."""

from __future__ import annotations

import contextlib
import math
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from turnscan.arrays import Image
from turnscan.devices._lit import alive
from turnscan.devices._options import check_exposure_and_gain, number_of, split_address, whole_of
from turnscan.devices._pixels import locked
from turnscan.errors import (
    DeviceDisconnected,
    DeviceNotFound,
    DeviceRefused,
    DeviceTimeout,
    InputError,
)

# OpenCV's numbers of properties; they are part of its interface and never change.
_WIDTH, _HEIGHT, _FPS, _FOURCC = 3, 4, 5, 6
_GAIN, _EXPOSURE, _AUTO_EXPOSURE, _BUFFERS, _AUTOFOCUS, _AUTO_WHITE = 14, 15, 21, 38, 39, 44

_UNITS: dict[str, tuple[Callable[[float], float], Callable[[float], float], float]] = {
    "V4L2": (lambda s: round(s * 1e4), lambda v: v * 1e-4, 1.0),
    "DSHOW": (lambda s: round(math.log2(s)), lambda v: 2.0**v, 0.25),
    "MSMF": (lambda s: round(math.log2(s)), lambda v: 2.0**v, 0.25),
}
"""By system: seconds → its exposure value, back, and what switches the automatic off."""

_WAITED = 0.5
"""Of the time between pictures: one that was waited for so long was not in a buffer."""
_SETTLE = 3
"""Pictures until a new exposure has passed through the camera."""


class Capture(Protocol):
    """What is used of `cv2.VideoCapture`."""

    def isOpened(self) -> bool: ...  # noqa: N802
    def getBackendName(self) -> str: ...  # noqa: N802
    def get(self, prop: int, /) -> float: ...
    def set(self, prop: int, value: float, /) -> bool: ...
    def grab(self) -> bool: ...
    def retrieve(self) -> tuple[bool, Any]: ...
    def release(self) -> None: ...


class UvcCamera:
    """``uvc:0[?width=…&height=…&fps=…&pixel=MJPG&lag=2]``: a webcam by number or device file.

    Exposure, focus and white balance are set to manual where the camera lets them be. Before each
    grab the buffers are emptied: pictures are thrown away until one had to be waited for, and then
    ``lag`` more, which may have been on their way.

    Raises DeviceNotFound where there is no camera, DeviceRefused where it is in use or does not
    take the size.
    """

    def __init__(
        self,
        address: str,
        *,
        capture: Capture | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        where, options = split_address(address, ("width", "height", "fps", "pixel", "lag"))
        self._name, self._clock = f"uvc:{where}", clock
        self._lag = whole_of(options, "lag", 2, 0, 100)
        self._capture = _opened(self._name, where) if capture is None else capture
        try:
            self._prepare(options)
        except BaseException:
            self._capture.release()
            raise

    @classmethod
    def find(cls) -> list[str]:
        """Addresses of the video devices of this machine (Linux); none is opened."""
        nodes = Path("/sys/class/video4linux").glob("video*")
        numbers = sorted(int(n.name[5:]) for n in nodes if n.name[5:].isdigit())
        # A camera has several nodes; only the first of each gives pictures.
        first = [n for n in numbers if _text(f"/sys/class/video4linux/video{n}/index") in ("0", "")]
        return [f"uvc:{n}" for n in first]

    def _prepare(self, options: Any) -> None:
        capture = self._capture
        if not capture.isOpened():
            raise DeviceNotFound(
                f"{self._name}: no camera opens here",
                hint="is it plugged in, not used by another program, and may you read it?",
            )
        if "pixel" in options:
            if len(options["pixel"]) != 4 or not options["pixel"].isascii():
                raise InputError(f"pixel={options['pixel']}: not four letters such as MJPG")
            code = sum(ord(c) << 8 * k for k, c in enumerate(options["pixel"]))
            capture.set(_FOURCC, code)
        for key, prop in (("width", _WIDTH), ("height", _HEIGHT)):
            if key in options:
                self._must(prop, key, whole_of(options, key, 0, 1, 100_000))
        if "fps" in options:
            capture.set(_FPS, number_of(options, "fps", 30.0, 0.01, 10_000.0))
        self._backend = capture.getBackendName()
        unit = _UNITS.get(self._backend)
        self._manual = unit is not None and capture.set(_AUTO_EXPOSURE, unit[2])
        capture.set(_AUTOFOCUS, 0)
        capture.set(_AUTO_WHITE, 0)
        capture.set(_BUFFERS, 1)
        fps = capture.get(_FPS)
        self._period = 1.0 / fps if 0.0 < fps < 10_000.0 else 1.0 / 30.0
        self._gain_at_start = capture.get(_GAIN)
        self._size: tuple[int, ...] | None = None
        self._seconds = 0.0
        self._settle = 0

    def _must(self, prop: int, key: str, wanted: int) -> None:
        self._capture.set(prop, wanted)
        got = self._capture.get(prop)
        if got != wanted:
            raise DeviceRefused(
                f"{self._name}: {key} {wanted}", hint=f"the nearest this camera does is {got:g}"
            )

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        """Set and read back.

        The exposure is NaN where OpenCV has no say in it. Gain 1 is the value found on opening;
        webcams do not tell more. Raises DeviceRefused where the camera does not follow.
        """
        check_exposure_and_gain(self._name, seconds, gain)
        self._settle = _SETTLE
        return self._exposed(seconds), self._gained(gain)

    def _exposed(self, seconds: float) -> float:
        if not self._manual:
            return math.nan
        there, back, _ = _UNITS[self._backend]
        value = there(seconds)
        took = self._capture.set(_EXPOSURE, value)
        got = back(self._capture.get(_EXPOSURE))
        if not took or not 0.5 * seconds <= got <= 2.0 * seconds:
            raise DeviceRefused(
                f"{self._name}: exposure {seconds:g} s; the camera stays at {got:g} s",
                hint="give a time that it can do; most webcams do 0.1 ms to 1/fps",
            )
        self._seconds = got
        return got

    def _gained(self, gain: float) -> float:
        base = self._gain_at_start
        if gain == 1.0 and self._capture.get(_GAIN) == base:
            return 1.0
        took = base > 0.0 and self._capture.set(_GAIN, gain * base)
        got = self._capture.get(_GAIN) / base if base > 0.0 else 1.0
        if not took or abs(got - gain) > 0.5 * gain:
            raise DeviceRefused(
                f"{self._name}: gain {gain:g}; the camera stays at {got:g}", hint="take gain 1"
            )
        return got

    def grab(self, timeout: float) -> Image:
        """One picture whose exposure began after the call.

        Raises DeviceTimeout, DeviceDisconnected where the camera gives no more pictures, and
        DeviceRefused where they have changed their size.
        """
        until = self._clock() + timeout
        self._empty(until, timeout)
        for _ in range(self._lag + self._settle):
            self._next(until, timeout)
        self._next(until, timeout)
        self._settle = 0
        good, pixels = self._capture.retrieve()
        if not good or pixels is None:
            raise self._lost()
        shape = np.shape(pixels)
        if self._size is None:
            self._size = shape
        if shape != self._size:
            raise DeviceRefused(
                f"{self._name}: {shape[1]}×{shape[0]} pixels instead of "
                f"{self._size[1]}×{self._size[0]}: another camera, or another setting",
                hint="plug in the camera that was calibrated and open it again",
            )
        return locked(pixels[..., ::-1] if len(shape) == 3 else pixels)

    def _empty(self, until: float, timeout: float) -> None:
        """Throw pictures away until one has to be waited for."""
        patience = _WAITED * max(self._period, self._seconds)
        while self._next(until, timeout) < patience:
            pass

    def _next(self, until: float, timeout: float) -> float:
        """Take a picture out of the buffer, undecoded; returns how long it was waited for."""
        asked = self._clock()
        if asked >= until:
            raise DeviceTimeout(
                f"{self._name}: no fresh picture within {timeout:g} s",
                hint="give it more time, or a camera that is not as slow",
            )
        if not self._capture.grab():
            if self._clock() >= until:
                raise DeviceTimeout(f"{self._name}: no picture within {timeout:g} s")
            raise self._lost()
        alive()
        return self._clock() - asked

    def _lost(self) -> DeviceDisconnected:
        return DeviceDisconnected(
            f"{self._name}: the camera gives no more pictures; OpenCV does not say why",
            hint="check its cable; close other programs that use it; then resume",
        )

    def close(self) -> None:
        """Let go of the camera."""
        self._capture.release()


def _opened(name: str, where: str) -> Capture:
    import cv2

    if not where.isdigit() and not Path(where).exists():
        raise DeviceNotFound(f"{name}: no such camera", hint="try uvc:0")
    device: int | str = int(where) if where.isdigit() else os.fspath(where)
    with contextlib.suppress(AttributeError):
        cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)
    try:
        capture: Capture = cv2.VideoCapture(device)
    except cv2.error as e:
        raise DeviceNotFound(f"{name}: OpenCV cannot open it ({e.err})") from None
    return capture


def _text(path: str) -> str:
    try:
        return Path(path).read_text().strip()
    except OSError:
        return ""
