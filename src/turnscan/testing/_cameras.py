"""What every camera driver must do, as checks that its author can run."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress

import numpy as np

from turnscan.arrays import Image
from turnscan.devices import Camera, CameraTraits, open_camera
from turnscan.errors import DeviceError, DeviceRefused, DeviceTimeout

_LATE = 3.0
"""s beyond its time-out within which a grab must be back."""
_EARLY = 0.9
"""A picture cannot come before this share of its exposure has passed."""


def check_camera(
    opener: str | Callable[[], AbstractContextManager[Camera]],
    *,
    seconds: float = 0.005,
    gain: float = 1.0,
    pictures: int = 4,
    timeout: float = 20.0,
) -> None:
    """Run a camera driver through all that turnscan relies on.

    ``opener`` is its address, or a callable that gives a context manager of a `Camera`; it is
    opened three times. ``seconds`` and ``gain`` must be values that the camera can have, and it
    must be able to give ``pictures`` + 3 pictures each time.

    Checked are: settings are read back and refused where they cannot be; pictures are uint8 or
    uint16, (H, W) or (H, W, 3), read-only, contiguous, of one size, and no buffer that changes
    later; none comes before its exposure can be over; a time-out is kept, and the next picture
    comes all the same; a closed camera says so; it opens again after closing and after an error.

    Raises AssertionError, saying what is not as it must be.
    """

    def opened() -> AbstractContextManager[Camera]:
        return open_camera(opener) if isinstance(opener, str) else opener()

    with opened() as camera:
        exposure = _check_settings(camera, seconds, gain)
        first = _check_pictures(camera, pictures, timeout, exposure)
        _check_refusals(camera)
        _check_impatience(camera, timeout)
        _check_picture(camera.grab(timeout), first)
    _check_closed(camera)
    _check_error_closes(opened)
    with opened() as camera:
        camera.configure(seconds, gain)
        _check_picture(camera.grab(timeout), first)


def _check_settings(camera: Camera, seconds: float, gain: float) -> float:
    """The exposure that it accepted, NaN where it does not say."""
    assert isinstance(camera, Camera), "it lacks configure or grab"
    accepted = camera.configure(seconds, gain)
    assert len(accepted) == 2, f"configure returned {accepted!r}, not exposure and gain"
    for name, value in zip(("exposure", "gain"), accepted, strict=True):
        assert isinstance(value, float), f"configure: {name} is {value!r}, not a float"
        assert math.isnan(value) or value > 0, f"configure: {name} is {value:g}"
    told = [w if math.isnan(a) else a for a, w in zip(accepted, (seconds, gain), strict=True)]
    twice = camera.configure(*told)
    assert np.allclose(twice, accepted, rtol=1e-6, equal_nan=True), (
        f"configure: given what it had accepted, {accepted}, it now says {twice}"
    )
    return accepted[0]


def _check_pictures(camera: Camera, pictures: int, timeout: float, exposure: float) -> Image:
    traits: CameraTraits = getattr(camera, "traits", CameraTraits())
    least = 0.0 if traits.instant or math.isnan(exposure) else _EARLY * exposure
    got: list[tuple[Image, Image]] = []
    for _ in range(pictures):
        begun = time.monotonic()
        image = camera.grab(timeout)
        waited = time.monotonic() - begun
        _check_picture(image, got[0][0] if got else image)
        assert waited >= least, (
            f"a picture of {exposure:g} s came after {waited:g} s: it began before it was asked for"
        )
        got.append((image, image.copy()))
    for image, as_it_came in got:
        assert np.array_equal(image, as_it_came), "a picture changed when later ones came: copy it"
    return got[0][0]


def _check_picture(image: Image, like: Image) -> None:
    assert isinstance(image, np.ndarray), f"grab returned {type(image).__name__}, not an array"
    assert image.dtype in (np.uint8, np.uint16), f"a picture of {image.dtype}"
    grey, colour = image.ndim == 2, image.ndim == 3 and image.shape[2] == 3
    assert grey or colour, f"a picture of shape {image.shape}"
    assert image.size > 0, f"a picture of shape {image.shape}"
    assert image.flags.c_contiguous, "a picture that is not C-contiguous"
    assert not image.flags.writeable, "a picture that can be written to"
    assert (image.shape, image.dtype) == (like.shape, like.dtype), (
        f"pictures of {like.shape} {like.dtype} and then of {image.shape} {image.dtype}"
    )


def _check_refusals(camera: Camera) -> None:
    for seconds, gain in ((0.0, 1.0), (-1.0, 1.0), (math.nan, 1.0), (0.01, -1.0), (0.01, math.inf)):
        try:
            accepted = camera.configure(seconds, gain)
        except DeviceRefused:
            continue
        raise AssertionError(
            f"configure({seconds:g}, {gain:g}) returned {accepted} instead of raising DeviceRefused"
        )


def _check_impatience(camera: Camera, timeout: float) -> None:
    """A time-out too short to be met: a picture or DeviceTimeout at once, and the next comes."""
    begun = time.monotonic()
    with suppress(DeviceTimeout):
        camera.grab(1e-4)
    waited = time.monotonic() - begun
    assert waited < _LATE, f"a time-out of 0.1 ms took {waited:g} s"
    camera.grab(timeout)


def _check_closed(camera: Camera) -> None:
    try:
        camera.grab(1.0)
    except DeviceError:
        return
    raise AssertionError("a closed camera gave a picture instead of raising a DeviceError")


def _check_error_closes(opened: Callable[[], AbstractContextManager[Camera]]) -> None:
    class _Passer(Exception):
        pass

    try:
        with opened() as camera:
            raise _Passer
    except _Passer:
        _check_closed(camera)
        return
    raise AssertionError("it swallows errors raised while it is open")
