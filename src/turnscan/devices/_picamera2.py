"""Cameras of the Raspberry Pi, by picamera2."""

from __future__ import annotations

import contextlib
import math
from typing import Any

import numpy as np

from turnscan.arrays import Image
from turnscan.devices._lit import alive
from turnscan.devices._options import check_exposure_and_gain, split_address, whole_of
from turnscan.devices._pixels import locked
from turnscan.errors import DeviceError, DeviceNotFound, DeviceRefused, DeviceTimeout

_TRIES = 20
"""Pictures in which a new setting must have arrived; libcamera applies it some pictures later."""
_CLOSE = 0.05
"""Relative: sensors expose in whole lines, so what is read back differs a little."""


class Picamera2Camera:
    """``picamera2:0[?width=…&height=…]``: camera number 0 of a Raspberry Pi.

    Automatic exposure, white balance, noise reduction and sharpening are off. picamera2 comes with
    the system (``apt install python3-picamera2`` and a virtual environment made with
    ``--system-site-packages``); it is not installed by pip.

    Raises DeviceNotFound where library or camera is missing, DeviceRefused where it is in use.
    """

    def __init__(self, address: str, *, library: Any = None) -> None:
        where, options = split_address(address, ("width", "height"))
        where = where or "0"
        self._name = f"picamera2:{where}"
        if not where.isdigit():
            raise DeviceNotFound(f"{self._name}: not a number", hint="try picamera2:0")
        library = _library() if library is None else library
        try:
            self._camera = library.Picamera2(int(where))
        except IndexError:
            raise DeviceNotFound(
                f"{self._name}: no such camera", hint="rpicam-hello lists those there are"
            ) from None
        except RuntimeError as e:
            raise DeviceRefused(
                f"{self._name}: it does not open ({e})", hint="close other programs that use it"
            ) from None
        try:
            self._start(options)
        except BaseException:
            self._camera.close()
            raise

    @classmethod
    def find(cls) -> list[str]:
        """Addresses of the cameras of this machine."""
        try:
            library = _library()
        except DeviceNotFound:
            return []
        return [f"picamera2:{n}" for n in range(len(library.Picamera2.global_camera_info()))]

    def _start(self, options: Any) -> None:
        full = self._camera.sensor_resolution
        size = (
            whole_of(options, "width", full[0], 1, full[0]),
            whole_of(options, "height", full[1], 1, full[1]),
        )
        # What libcamera calls BGR888 lies in memory as red, green, blue.
        still = self._camera.create_still_configuration(
            main={"size": size, "format": "BGR888"}, buffer_count=2
        )
        self._camera.configure(still)
        self._camera.set_controls(
            {"AeEnable": False, "AwbEnable": False, "Sharpness": 0.0, "NoiseReductionMode": 0}
        )
        self._shape = (size[1], size[0], 3)
        self._camera.start()

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        """Set, and read back from the pictures until they have it. Raises DeviceRefused else."""
        check_exposure_and_gain(self._name, seconds, gain)
        wanted = {"ExposureTime": round(seconds * 1e6), "AnalogueGain": gain}
        self._camera.set_controls(wanted)
        got = math.nan, math.nan
        for _ in range(_TRIES):
            said = self._camera.capture_metadata()
            alive()
            got = said["ExposureTime"] * 1e-6, float(said["AnalogueGain"])
            if abs(got[0] - seconds) <= _CLOSE * seconds + 1e-4 and abs(got[1] - gain) <= (
                _CLOSE * gain
            ):
                return got
        raise DeviceRefused(
            f"{self._name}: exposure {seconds:g} s and gain {gain:g}; the camera stays at "
            f"{got[0]:g} s and {got[1]:g}",
            hint="give values that this sensor can have",
        )

    def grab(self, timeout: float) -> Image:
        """One picture whose exposure began after the call. Raises DeviceTimeout, DeviceError."""
        try:
            # flush=True: its first line was exposed no earlier than now.
            request = self._camera.capture_request(wait=timeout, flush=True)
        except TimeoutError:
            raise DeviceTimeout(f"{self._name}: no picture within {timeout:g} s") from None
        try:
            pixels = np.asarray(request.make_array("main"))
        finally:
            request.release()
        if pixels.shape != self._shape:
            raise DeviceError(f"{self._name}: pixels {pixels.shape} instead of {self._shape}")
        return locked(pixels)

    def close(self) -> None:
        """Stop and let go."""
        with contextlib.suppress(RuntimeError):
            self._camera.stop()
        self._camera.close()


def _library() -> Any:
    try:
        import picamera2
    except ImportError:
        raise DeviceNotFound(
            "picamera2: the library is not installed",
            hint="on a Raspberry Pi: apt install python3-picamera2, and make the virtual "
            "environment with access to the site packages of the system",
        ) from None
    return picamera2
