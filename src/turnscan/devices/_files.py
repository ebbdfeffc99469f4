"""Pictures and videos as cameras: what another program has recorded, one grab after another."""

from __future__ import annotations

import math

from turnscan.arrays import Image
from turnscan.devices._options import check_exposure_and_gain, split_address
from turnscan.devices._protocols import CameraTraits
from turnscan.errors import DeviceDisconnected, DeviceGarbled, FormatError
from turnscan.scan import list_pictures, read_picture, read_video


class _Recorded:
    """What both have in common: nothing can be set, and they end."""

    traits = CameraTraits(instant=True, noiseless=True)

    def __init__(self, address: str) -> None:
        self._address = address

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        """Nothing can be set: (NaN, NaN). Raises DeviceRefused for what no camera could have."""
        check_exposure_and_gain(self._address, seconds, gain)
        return math.nan, math.nan

    def _over(self, count: int) -> DeviceDisconnected:
        return DeviceDisconnected(
            f"{self._address}: all its {count} pictures have been given", hint="add ?loop=1"
        )


class FolderCamera(_Recorded):
    """``folder:PICTURES[?loop=1]``: the pictures of a folder or a pattern, in natural order.

    Raises InputError where there is none.
    """

    def __init__(self, address: str) -> None:
        super().__init__(address)
        name, options = split_address(address, ("loop",))
        self._paths = list_pictures(name or ".")
        self._loop = options.get("loop", "0") not in ("0", "no")
        self._next = 0

    def grab(self, timeout: float) -> Image:
        """The next picture. Raises DeviceDisconnected behind the last, DeviceGarbled if damaged."""
        if self._next >= len(self._paths) and not self._loop:
            raise self._over(len(self._paths))
        path = self._paths[self._next % len(self._paths)]
        self._next += 1
        try:
            return read_picture(path)
        except FormatError as e:
            raise DeviceGarbled(e.message, hint=e.hint) from None


class VideoCamera(_Recorded):
    """``video:FILE[?loop=1]``: the frames of a video, in order.

    Lossy compression moves the centre of a stripe; for measuring, record pictures. Raises
    InputError and FormatError as `turnscan.scan.read_video` does.
    """

    def __init__(self, address: str) -> None:
        super().__init__(address)
        self._name, options = split_address(address, ("loop",))
        self._loop = options.get("loop", "0") not in ("0", "no")
        self._frames = read_video(self._name)
        self._waiting: Image | None = next(self._frames)
        self._count = 0

    def grab(self, timeout: float) -> Image:
        """The next frame. Raises DeviceDisconnected behind the last."""
        image = self._waiting
        self._waiting = None
        if image is None:
            image = next(self._frames, None)
        if image is None and self._loop:
            self._frames = read_video(self._name)
            image = next(self._frames, None)
        if image is None:
            raise self._over(self._count)
        self._count += 1
        return image

    def close(self) -> None:
        """Let go of the file."""
        self._waiting, self._frames = None, iter(())
