"""Cameras of the GenICam standard through a GenTL producer, by harvesters."""

from __future__ import annotations

import contextlib
import math
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from turnscan.arrays import Image
from turnscan.devices._gain import gain_of_node, gain_to_node
from turnscan.devices._lit import alive
from turnscan.devices._options import check_exposure_and_gain, split_address, whole_of
from turnscan.devices._pixels import image_of
from turnscan.errors import (
    DeviceDisconnected,
    DeviceError,
    DeviceGarbled,
    DeviceNotFound,
    DeviceRefused,
    DeviceTimeout,
)

_PRODUCERS = ("GENICAM_GENTL64_PATH", "GENICAM_GENTL32_PATH")
_DRAIN = 0.002
"""s in which a picture that waits in a buffer is handed out."""


class GenicamCamera:
    """``genicam:SERIAL[?cti=PATH&format=Mono8&lag=2]``: a camera behind a GenTL producer.

    The producer (a ``.cti`` file of the camera's maker) is the one given, or those of the folders
    in ``GENICAM_GENTL64_PATH``. SERIAL is the serial number, the user's name or the identity of
    the camera; without it, the first. A camera that can is triggered by software; of another
    the pictures in the buffers and then ``lag`` more are thrown away before each grab.

    Raises DeviceNotFound where harvesters, the producer or the camera is missing, DeviceRefused
    where another program has the camera.
    """

    def __init__(self, address: str) -> None:
        wanted, options = split_address(address, ("cti", "format", "lag"))
        self._name = f"genicam:{wanted}"
        self._lag = whole_of(options, "lag", 2, 0, 100)
        self._restart = False
        with contextlib.ExitStack() as undo:
            self._harvester = _harvester(options.get("cti"))
            undo.callback(self._harvester.reset)
            with _named(self._name, "opening it"):
                self._camera = self._harvester.create(_index(self._harvester, wanted, self._name))
                undo.callback(self._camera.destroy)
                self._nodes = self._camera.remote_device.node_map
                self._prepare(options.get("format"))
                self._camera.start()
            undo.pop_all()

    @classmethod
    def find(cls) -> list[str]:
        """Addresses of the cameras of the producers in ``GENICAM_GENTL64_PATH``."""
        if not _producers():
            return []
        harvester = _harvester(None)
        try:
            return [f"genicam:{names[0]}" for names in _there(harvester)]
        finally:
            harvester.reset()

    def _prepare(self, form: str | None) -> None:
        if form is not None:
            self._set("PixelFormat", form)
        for automatic in ("ExposureAuto", "GainAuto", "BalanceWhiteAuto"):
            self._set(automatic, "Off")
        self._set("ExposureMode", "Timed")
        self._set("TriggerSelector", "FrameStart")
        self._triggered = (
            self._has("TriggerSoftware")
            and self._set("TriggerSource", "Software")
            and self._set("TriggerMode", "On")
        )

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        """Set and read back; NaN for what this camera does not have."""
        check_exposure_and_gain(self._name, seconds, gain)
        return self._exposed(seconds), self._gained(gain)

    def _exposed(self, seconds: float) -> float:
        node = self._first("ExposureTime", "ExposureTimeAbs", "ExposureTimeRaw")
        if node is None:
            return math.nan
        if not node.min <= seconds * 1e6 <= node.max:
            raise DeviceRefused(
                f"{self._name}: exposure {seconds:g} s",
                hint=f"it can do {node.min / 1e6:g} s to {node.max / 1e6:g} s",
            )
        with _named(self._name, f"setting the exposure to {seconds:g} s"):
            node.value = type(node.value)(seconds * 1e6)
            return float(node.value) / 1e6

    def _gained(self, gain: float) -> float:
        node = self._first("Gain", "GainRaw")
        if node is None:
            return math.nan
        unit = str(getattr(node, "unit", ""))
        value = gain_to_node(self._name, gain, unit, node.min)
        if not node.min <= value <= node.max:
            raise DeviceRefused(f"{self._name}: gain {gain:g} is beyond what this camera has")
        with _named(self._name, f"setting the gain to {gain:g}"):
            node.value = type(node.value)(value)
            return gain_of_node(float(node.value), unit, node.min)

    def grab(self, timeout: float) -> Image:
        """One picture whose exposure began after the call.

        Raises DeviceTimeout, DeviceDisconnected, and DeviceGarbled where parts are missing.
        """
        until = time.monotonic() + timeout
        with _named(self._name, "taking a picture"):
            if self._restart:
                # A picture that was waited for in vain may still come, and would be taken for
                # the next one.
                self._camera.stop()
                self._camera.start()
                self._restart = False
            self._drain(until)
            if self._triggered:
                self._nodes.TriggerSoftware.execute()
            else:
                for _ in range(self._lag):
                    self._fetch(until, timeout).queue()
            buffer = self._fetch(until, timeout)
            try:
                part = buffer.payload.components[0]
                return image_of(part.data, part.data_format, part.width, part.height)
            finally:
                buffer.queue()

    def _drain(self, until: float) -> None:
        """Throw away what waits in the buffers; an incomplete one comes as None, but at once."""
        while (asked := time.monotonic()) < until:
            old = self._camera.try_fetch(timeout=_DRAIN)
            if old is not None:
                old.queue()
            elif time.monotonic() - asked >= _DRAIN:
                return

    def _fetch(self, until: float, timeout: float) -> Any:
        left = until - time.monotonic()
        buffer = self._camera.try_fetch(timeout=left) if left > 0 else None
        if buffer is not None:
            alive()
            return buffer
        self._restart = True
        if time.monotonic() < until:
            raise DeviceGarbled(f"{self._name}: a picture with parts missing")
        raise DeviceTimeout(
            f"{self._name}: no picture within {timeout:g} s", hint="check the camera's cable"
        )

    def close(self) -> None:
        """Stop and let go."""
        with contextlib.suppress(Exception):
            self._camera.stop()
        with contextlib.suppress(Exception):
            self._camera.destroy()
        self._harvester.reset()

    def _has(self, name: str) -> bool:
        return hasattr(self._nodes, name)

    def _first(self, *names: str) -> Any:
        return next((getattr(self._nodes, n) for n in names if self._has(n)), None)

    def _set(self, name: str, value: str) -> bool:
        """Set an enumeration where the camera has it, and say whether it now has that value."""
        if not self._has(name):
            return False
        node = getattr(self._nodes, name)
        if value in node.symbolics:
            node.value = value
        return bool(node.value == value)


def _producers() -> list[str]:
    folders = [f for name in _PRODUCERS for f in os.environ.get(name, "").split(os.pathsep) if f]
    return sorted(str(p) for f in folders for p in Path(f).glob("*.cti"))


def _harvester(producer: str | None) -> Any:
    try:
        from harvesters.core import Harvester
    except ImportError:
        raise DeviceNotFound(
            "genicam: harvesters is not installed", hint="pip install 'turnscan[genicam]'"
        ) from None
    files = _producers() if producer is None else [producer]
    if not files or (producer is not None and not Path(producer).is_file()):
        raise DeviceNotFound(
            "genicam: no GenTL producer" if producer is None else f"{producer}: no such producer",
            hint="install the camera maker's producer and name its .cti file by ?cti=PATH",
        )
    harvester = Harvester()
    with _named("genicam", f"loading {', '.join(files)}"):
        for file in files:
            harvester.add_file(file)
        harvester.update()
    return harvester


def _there(harvester: Any) -> list[list[str]]:
    """The names of every camera, its serial number first; some producers lack some."""
    told = [d.property_dict for d in harvester.device_info_list]
    keys = ("serial_number", "user_defined_name", "id_")
    return [[str(d[k]) for k in keys if d.get(k)] for d in told]


def _index(harvester: Any, wanted: str, name: str) -> int:
    there = _there(harvester)
    for index, names in enumerate(there):
        if not wanted or wanted in names:
            return index
    have = ", ".join(names[0] for names in there) or "none"
    raise DeviceNotFound(f"{name}: no such camera", hint=f"connected: {have}")


@contextlib.contextmanager
def _named(name: str, doing: str) -> Iterator[None]:
    """Errors of the libraries come out under turnscan's names."""
    from genicam import genapi, gentl

    try:
        yield
    except (gentl.AccessDeniedException, gentl.ResourceInUseException) as e:
        raise DeviceRefused(
            f"{name}: {doing}: in use by another program ({e})", hint="close that program"
        ) from None
    except (gentl.IoException, gentl.InvalidHandleException, gentl.ClosedException) as e:
        raise DeviceDisconnected(
            f"{name}: {doing}: the camera has disconnected ({e})",
            hint="check cable and power, resume",
        ) from None
    except (gentl.GenericException, genapi.GenericException) as e:
        raise DeviceError(f"{name}: {doing}: {e}") from None
