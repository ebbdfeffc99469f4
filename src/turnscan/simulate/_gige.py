"""An emulated GigE Vision camera: real packets on the network, pictures of our own."""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Image
from turnscan.devices import aravis_library
from turnscan.errors import DeviceRefused

Picture = Callable[[float, float], Image]
"""(exposure s, gain factor) → what the camera sees."""

_BAYER = {
    0x01080008: ((1, 0), (2, 1)),  # GR
    0x01080009: ((0, 1), (1, 2)),  # RG
    0x0108000A: ((1, 2), (0, 1)),  # GB
    0x0108000B: ((2, 1), (1, 0)),  # BG
}
_SIZE_REGISTERS = (0x11C, 0x118, 0x100, 0x104)
"""Of the sensor, then of the picture: width, height each."""
_HEARTBEAT = 0x938, 15000
"""Register, and ms without a sign of its client after which a camera is free for another: a picture
that takes a busy machine three seconds, as is usual, would end the connection."""
_MONO8, _MONO16, _RGB8 = 0x01080001, 0x01100007, 0x02180014


class GigeServer:
    """Serves pictures as the GigE Vision camera ``Aravis-Fake-SERIAL`` until it is closed.

    ``picture`` is called for every picture that a client triggers, in a thread of its own, after
    the exposure has passed; the client's width and height are cut out of it from the top left. It
    should be back within a second: the library answers its clients from the same thread, and they
    take a camera that is silent for longer to be gone.
    ``loss`` is the share of packets that never leave, ``size`` the sensor's width and height
    (2048 × 2048 without it). A context manager.

    Raises DeviceNotFound where Aravis is missing, DeviceRefused where the network address is none
    of this machine or taken.
    """

    def __init__(
        self,
        picture: Picture,
        serial: str = "TS01",
        address: str = "127.0.0.1",
        loss: float = 0.0,
        size: tuple[int, int] | None = None,
    ) -> None:
        library = aravis_library()
        self.error: Exception | None = None
        """What ``picture`` raised, if it did; the client then sees black."""
        self.served = 0
        self._picture = picture
        self._server: Any = library.GvFakeCamera.new(address, serial)
        if not self._server.is_running():
            raise DeviceRefused(
                f"{address}: no camera can be served here",
                hint="is the address one of this machine, and no other fake camera on it?",
            )
        self._server.set_property("gvsp-lost-ratio", loss)
        self._native = _native()
        self._fake = self._server.get_fake_camera()
        # The introspected version of this call crashes (Aravis 0.8.26), the plain one does not.
        for register, value in zip(_SIZE_REGISTERS, (size or ()) * 2, strict=False):
            self._native.arv_fake_camera_write_register(hash(self._fake), register, value)
        self._native.arv_fake_camera_write_register(hash(self._fake), *_HEARTBEAT)
        self._callback = _FILL(self._fill)
        self._native.arv_fake_camera_set_fill_pattern(hash(self._fake), self._callback, None)

    def _fill(self, buffer: int, _data: int, exposure: int, gain: int, form: int) -> None:
        native = self._native
        width = native.arv_buffer_get_image_width(buffer)
        height = native.arv_buffer_get_image_height(buffer)
        room = native.arv_fake_camera_get_payload(hash(self._fake))
        time.sleep(exposure * 1e-6)
        try:
            image = self._picture(exposure * 1e-6, 1.0 + gain)
            data = _encoded(_cut(image, width, height), form).tobytes()
        except Exception as e:  # noqa: BLE001 nothing can be raised into the library's thread
            self.error = e
            data = bytes(room)
        ctypes.memmove(native.arv_buffer_get_data(buffer, None), data, min(room, len(data)))
        self.served += 1

    def close(self) -> None:
        """Take the camera off the network."""
        self._server = self._fake = None

    def __enter__(self) -> GigeServer:
        """Itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close."""
        self.close()


_FILL = ctypes.CFUNCTYPE(
    None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint32, ctypes.c_uint32
)


def _native() -> Any:
    """The functions of the C library that the callback needs."""
    native = ctypes.CDLL("libaravis-0.8.so.0")
    native.arv_buffer_get_data.restype = ctypes.c_void_p
    native.arv_buffer_get_data.argtypes = [ctypes.c_void_p, ctypes.c_void_p]
    native.arv_fake_camera_get_payload.restype = ctypes.c_size_t
    native.arv_fake_camera_get_payload.argtypes = [ctypes.c_void_p]
    native.arv_fake_camera_write_register.argtypes = [
        ctypes.c_void_p, ctypes.c_uint32, ctypes.c_uint32,
    ]  # fmt: skip
    native.arv_fake_camera_set_fill_pattern.argtypes = [ctypes.c_void_p, _FILL, ctypes.c_void_p]
    for name in ("arv_buffer_get_image_width", "arv_buffer_get_image_height"):
        getattr(native, name).restype = ctypes.c_int
        getattr(native, name).argtypes = [ctypes.c_void_p]
    return native


def _cut(image: Image, width: int, height: int) -> Image:
    """The top left part, black where the picture is smaller."""
    if image.shape[:2] == (height, width):
        return image
    out = np.zeros((height, width, *image.shape[2:]), image.dtype)
    part = image[:height, :width]
    out[: part.shape[0], : part.shape[1]] = part
    return out


def _encoded(image: Image, form: int) -> npt.NDArray[Any]:
    """The bytes of a pixel format that the fake knows."""
    wide = image.dtype == np.uint16
    if form == _MONO16:
        grey = _grey(image)
        return grey if wide else np.asarray(grey.astype(np.uint16) * 257)
    small = (image >> 8).astype(np.uint8) if wide else image
    if form == _MONO8:
        return _grey(small)
    colour = small if small.ndim == 3 else np.repeat(small[..., None], 3, axis=2)
    if form == _RGB8:
        return np.asarray(colour)
    mosaic = np.empty(colour.shape[:2], np.uint8)
    for row in range(2):
        for column in range(2):
            mosaic[row::2, column::2] = colour[row::2, column::2, _BAYER[form][row][column]]
    return mosaic


def _grey(image: Image) -> npt.NDArray[Any]:
    return image if image.ndim == 2 else image.mean(axis=2).astype(image.dtype)
