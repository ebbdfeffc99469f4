"""GigE Vision and USB3 Vision cameras through Aravis."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Iterator
from typing import Any

from turnscan.arrays import Image
from turnscan.devices._gain import gain_of_node, gain_to_node
from turnscan.devices._lit import alive
from turnscan.devices._options import check_exposure_and_gain, split_address, whole_of
from turnscan.devices._pixels import image_of
from turnscan.devices._protocols import CameraTraits
from turnscan.errors import (
    DeviceDisconnected,
    DeviceError,
    DeviceGarbled,
    DeviceNotFound,
    DeviceRefused,
    DeviceTimeout,
)

_BUFFERS = 4
_LOST = 3.0
"""s after its exposure at which a picture that has not come is triggered again: the network may
have lost the trigger, or the whole picture. It makes no wait longer."""
_PREFERRED = ("Mono8", "Mono16", "Mono12", "BayerRG8", "BayerGR8", "BayerGB8", "BayerBG8", "RGB8")


class AravisCamera:
    """``aravis:NAME[?format=Mono8&width=…&height=…&lag=2&packet=8192]``: one that Aravis finds.

    NAME is the identity, serial number, model or address; without it, the first. A camera that
    can is triggered by software; of another the pictures in the buffers and then ``lag`` more are
    thrown away before each grab. Picture numbers of the camera are not relied on: they wrap.
    Packets are as large as the network is found to take, or have ``packet`` bytes; the camera is
    asked again for those that get lost, where it can.

    Raises DeviceNotFound where Aravis or the camera is missing, DeviceRefused where another
    program has the camera or it cannot have this format or size.
    """

    def __init__(self, address: str) -> None:
        wanted, options = split_address(address, ("format", "width", "height", "lag", "packet"))
        self._name = f"aravis:{wanted}"
        self._lag = whole_of(options, "lag", 2, 0, 100)
        self._aravis = aravis_library()
        identity = _identity(self._aravis, wanted, self._name)
        self._gone = threading.Event()
        gone = self._gone  # not self: the device would hold what holds the device
        self._restart = False
        self._seconds = math.inf  # where it is not known, no picture is known to be late
        with self._named("opening it"):
            self._camera = self._aravis.Camera.new(identity)
            device = self._camera.get_device()
            if hasattr(device, "is_controller") and not device.is_controller():
                raise DeviceRefused(
                    f"{self._name}: in use by another program", hint="close that program"
                )
            self._prepare(options)
            device.connect("control-lost", lambda *_: gone.set())
            self._stream = self._camera.create_stream(None, None)
            if self._stream is None:
                raise DeviceError(f"{self._name}: no stream", hint="check the firewall")
            for _ in range(_BUFFERS):
                payload = self._camera.get_payload()
                self._stream.push_buffer(self._aravis.Buffer.new_allocate(payload))
            self._camera.start_acquisition()

    @classmethod
    def find(cls) -> list[str]:
        """Addresses of the cameras that Aravis finds."""
        return [f"aravis:{found[0]}" for found in _found(aravis_library())]

    def _prepare(self, options: Any) -> None:
        camera = self._camera
        there = camera.dup_available_pixel_formats_as_strings()
        form = options.get("format") or next((f for f in _PREFERRED if f in there), there[0])
        if form not in there:
            raise DeviceRefused(f"{self._name}: no format {form!r}", hint=f"it has {there}")
        camera.set_pixel_format_from_string(form)
        self._form = form
        width, height = camera.get_sensor_size()
        width = whole_of(options, "width", width, 1, width)
        height = whole_of(options, "height", height, 1, height)
        camera.set_region(0, 0, width, height)
        self._size = tuple(camera.get_region())[2:]
        if self._size != (width, height):
            raise DeviceRefused(
                f"{self._name}: {width}×{height} pixels",
                hint=f"the nearest it can do is {self._size[0]}×{self._size[1]}",
            )
        off = self._aravis.Auto.OFF
        if camera.is_exposure_auto_available():
            camera.set_exposure_time_auto(off)
        if camera.is_gain_auto_available():
            camera.set_gain_auto(off)
        if camera.is_frame_rate_available():
            camera.set_frame_rate(camera.get_frame_rate_bounds()[1])
        self._triggered = bool(camera.is_software_trigger_supported())
        if self._triggered:
            camera.set_trigger("Software")
        # What a trigger makes was not exposed before it, however soon it comes.
        self.traits = CameraTraits(instant=self._triggered)
        if camera.is_gv_device():
            self._set_packets(whole_of(options, "packet", 0, 0, 65535))

    def _set_packets(self, wanted: int) -> None:
        """Raises DeviceRefused for a size that the camera cannot have."""
        from gi.repository import GLib

        if not wanted:
            with contextlib.suppress(GLib.Error):  # a camera that cannot be asked
                self._camera.gv_auto_packet_size()
            return
        self._camera.gv_set_packet_size(wanted)
        has = self._camera.gv_get_packet_size()
        if has != wanted:
            raise DeviceRefused(f"{self._name}: packets of {wanted} bytes", hint=f"it has {has}")

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        """Set and read back; NaN for what this camera does not have."""
        check_exposure_and_gain(self._name, seconds, gain)
        exposed = self._exposed(seconds)
        self._seconds = math.inf if math.isnan(exposed) else exposed
        return exposed, self._gained(gain)

    def _exposed(self, seconds: float) -> float:
        if not self._camera.is_exposure_time_available():
            return math.nan
        with self._named(f"setting the exposure to {seconds:g} s"):
            low, high = tuple(self._camera.get_exposure_time_bounds())
            if not low <= seconds * 1e6 <= high:
                raise DeviceRefused(
                    f"{self._name}: exposure {seconds:g} s",
                    hint=f"it can do {low / 1e6:g} s to {high / 1e6:g} s",
                )
            self._camera.set_exposure_time(seconds * 1e6)
            return float(self._camera.get_exposure_time()) / 1e6

    def _gained(self, gain: float) -> float:
        if not self._camera.is_gain_available():
            return math.nan
        with self._named(f"setting the gain to {gain:g}"):
            low, high = tuple(self._camera.get_gain_bounds())
            node = self._camera.get_device().get_feature("Gain")
            unit = (node.get_unit() or "") if hasattr(node, "get_unit") else ""
            value = gain_to_node(self._name, gain, unit, low)
            if not low <= value <= high:
                raise DeviceRefused(f"{self._name}: gain {gain:g} is beyond what this camera has")
            self._camera.set_gain(value)
            return gain_of_node(float(self._camera.get_gain()), unit, low)

    def grab(self, timeout: float) -> Image:
        """One picture whose exposure began after the call.

        Raises DeviceTimeout, DeviceDisconnected once the camera has been missed for some seconds,
        and DeviceGarbled for a picture with packets missing.
        """
        until = time.monotonic() + timeout
        with self._named("taking a picture"):
            self._check_there()
            self._empty()
            if self._triggered:
                buffer = self._triggered_picture(until, timeout)
            else:
                for _ in range(self._lag):
                    self._stream.push_buffer(self._pop(until, timeout))
                buffer = self._pop(until, timeout)
            try:
                return self._image(buffer)
            finally:
                self._stream.push_buffer(buffer)

    def _empty(self) -> None:
        """No picture from before is left, or on its way."""
        if self._restart:
            # A picture that was waited for in vain may still come, and would be taken for the next.
            self._camera.stop_acquisition()
            self._camera.start_acquisition()
            self._restart = False
        while (old := self._stream.try_pop_buffer()) is not None:
            self._stream.push_buffer(old)

    def _triggered_picture(self, until: float, timeout: float) -> Any:
        """The picture that a trigger makes, or that of another trigger where none comes."""
        self._camera.software_trigger()
        while (late := time.monotonic() + self._seconds + _LOST) < until:
            if (buffer := self._waited(late)) is not None:
                return buffer
            self._restart = True
            self._check_there()
            self._empty()
            self._restart = True  # the picture of the trigger before may come after this one's
            self._camera.software_trigger()
        return self._pop(until, timeout)

    def _waited(self, until: float) -> Any:
        """A picture that comes by then, or None."""
        while (left := until - time.monotonic()) > 0:
            buffer = self._stream.timeout_pop_buffer(int(left * 1e6))
            if buffer is None:
                return None
            if buffer.get_status() != self._aravis.BufferStatus.CLEARED:
                alive()
                return buffer
            # Nothing was written to it: it was waiting when the acquisition was begun once more.
            self._stream.push_buffer(buffer)
        return None

    def _pop(self, until: float, timeout: float) -> Any:
        buffer = self._waited(until)
        if buffer is not None:
            return buffer
        self._restart = True
        self._check_there()
        raise DeviceTimeout(
            f"{self._name}: no picture within {timeout:g} s", hint="check the camera's cable"
        )

    def _image(self, buffer: Any) -> Image:
        status = buffer.get_status()
        if status != self._aravis.BufferStatus.SUCCESS:
            self._restart = True
            raise DeviceGarbled(
                f"{self._name}: a picture with parts missing ({status.value_nick})",
                hint="check the network: use a separate cable, and larger packets (packet=8192 in "
                "its address, where the network takes them)",
            )
        size = buffer.get_image_width(), buffer.get_image_height()
        if size != self._size:
            raise DeviceRefused(
                f"{self._name}: {size[0]}×{size[1]} pixels instead of "
                f"{self._size[0]}×{self._size[1]}",
                hint="another program changed the camera; open it again",
            )
        return image_of(bytes(buffer.get_data()), self._form, *size)

    def _check_there(self) -> None:
        if self._gone.is_set():
            raise DeviceDisconnected(
                f"{self._name}: the camera has disconnected",
                hint="check cable and power, then resume",
            )

    def close(self) -> None:
        """Stop and let go."""
        from gi.repository import GLib

        with contextlib.suppress(GLib.Error):
            self._camera.stop_acquisition()
        # The last references: Aravis gives up control of the camera with them.
        del self._stream, self._camera

    @contextlib.contextmanager
    def _named(self, doing: str) -> Iterator[None]:
        """Errors of the library come out under turnscan's names."""
        from gi.repository import GLib

        try:
            yield
        except GLib.Error as e:
            said = f"{self._name}: {doing}: {e.message}"
            codes = self._aravis.DeviceError
            if self._gone.is_set() or e.code in (codes.TIMEOUT, codes.TRANSFER_ERROR):
                self._gone.set()
                raise DeviceDisconnected(said, hint="check cable and power, resume") from None
            if "access" in e.message.lower() or e.code == codes.NOT_CONTROLLER:
                raise DeviceRefused(said, hint="close the other program that uses it") from None
            if e.code == codes.NOT_FOUND:
                raise DeviceNotFound(said, hint="check cable and power") from None
            raise DeviceError(said) from None


def aravis_library() -> Any:
    """The Aravis library. Raises DeviceNotFound, with what to install, where it is missing."""
    try:
        import gi

        gi.require_version("Aravis", "0.8")
        from gi.repository import Aravis
    except (ImportError, ValueError) as e:
        raise DeviceNotFound(
            f"aravis: the library is not installed ({e})",
            hint="install the packages gir1.2-aravis-0.8 libgirepository1.0-dev libcairo2-dev gcc "
            "pkg-config (Debian), then pip install 'turnscan[gige]'",
        ) from None
    return Aravis


def _found(library: Any) -> list[tuple[str, ...]]:
    # Without this a camera opens by its name, but no picture ever comes (Aravis 0.8.26).
    library.update_device_list()
    ask = (
        library.get_device_id,
        library.get_device_serial_nbr,
        library.get_device_model,
        library.get_device_address,
    )
    return [tuple(f(i) or "" for f in ask) for i in range(library.get_n_devices())]


def _identity(library: Any, wanted: str, name: str) -> str:
    there = _found(library)
    for names in there:
        if not wanted or wanted in names:
            return names[0]
    have = ", ".join(n[0] for n in there) or "none"
    raise DeviceNotFound(f"{name}: no such camera", hint=f"connected: {have}")
