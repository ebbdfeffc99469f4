"""The Raspberry Pi's driver, against a stand-in for its library."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from turnscan.devices import Camera, open_camera
from turnscan.devices._picamera2 import Picamera2Camera
from turnscan.errors import DeviceNotFound, DeviceRefused, DeviceTimeout
from turnscan.testing import check_camera


class FakePicamera2:
    """As much of `picamera2.Picamera2` as the driver uses; settings arrive two pictures late."""

    sensor_resolution = (64, 48)

    def __init__(self, number: int) -> None:
        if number > 0:
            raise IndexError("list index out of range")
        self.rng = np.random.default_rng(1)
        self.pending: list[dict[str, Any]] = []
        self.now: dict[str, Any] = {"ExposureTime": 20_000, "AnalogueGain": 1.0}
        self.config: Any = None
        self.running = self.closed = False
        self.held = 0
        self.stubborn = False
        self.flushed: list[Any] = []

    def create_still_configuration(self, **config: Any) -> Any:
        return config

    def configure(self, config: Any) -> None:
        assert config["main"]["format"] == "BGR888"
        self.config = config

    def set_controls(self, controls: dict[str, Any]) -> None:
        self.pending += [{}, controls]

    def start(self) -> None:
        self.running = True

    def stop(self) -> None:
        self.running = False

    def close(self) -> None:
        self.closed = True

    def capture_metadata(self) -> dict[str, Any]:
        if self.pending and not self.stubborn:
            self.now |= self.pending.pop(0)
        # Whole lines of 12 µs.
        lines = self.now["ExposureTime"] // 12 * 12
        return {"ExposureTime": lines, "AnalogueGain": self.now["AnalogueGain"]}

    def capture_request(self, wait: float, flush: bool) -> Any:
        import time

        self.flushed.append(flush)
        seconds = self.now["ExposureTime"] * 1e-6
        time.sleep(min(wait, seconds))
        if wait < seconds:
            raise TimeoutError
        width, height = self.config["main"]["size"]
        pixels = self.rng.integers(0, 255, (height, width, 3)).astype(np.uint8)
        self.held += 1

        def release() -> None:
            self.held -= 1

        return SimpleNamespace(make_array=lambda _: pixels, release=release)


LIBRARY = SimpleNamespace(Picamera2=FakePicamera2)


def test_it_passes_the_conformance_kit() -> None:
    @contextmanager
    def opened() -> Iterator[Camera]:
        camera = Picamera2Camera("picamera2:0", library=LIBRARY)
        fake = camera._camera
        try:
            yield camera
        finally:
            camera.close()
            assert fake.closed
            assert fake.held == 0, "a request was not given back"
            assert all(fake.flushed)
            fake.capture_request = _gone

    check_camera(opened, seconds=0.012)


def _gone(wait: float, flush: bool) -> None:
    raise TimeoutError


def test_settings_are_waited_for_and_read_back() -> None:
    camera = Picamera2Camera("picamera2:", library=LIBRARY)
    assert camera.configure(0.0101, 2.0) == (pytest.approx(0.010092), 2.0)
    camera._camera.stubborn = True
    with pytest.raises(DeviceRefused, match=r"the camera stays at 0\.010092 s"):
        camera.configure(0.05, 2.0)


def test_time_runs_out() -> None:
    camera = Picamera2Camera("picamera2:0", library=LIBRARY)
    camera.configure(0.5, 1.0)
    with pytest.raises(DeviceTimeout, match=r"within 0\.01 s"):
        camera.grab(0.01)


def test_what_is_not_there() -> None:
    for address in ("picamera2:7", "picamera2:left"):
        with pytest.raises(DeviceNotFound):
            Picamera2Camera(address, library=LIBRARY)
    if importlib.util.find_spec("picamera2") is None:
        with (
            pytest.raises(DeviceNotFound, match="apt install python3-picamera2"),
            open_camera("picamera2:0"),
        ):
            pass
