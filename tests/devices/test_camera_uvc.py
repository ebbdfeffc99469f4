"""Webcams through a stand-in for cv2.VideoCapture (RELIABILITY D4, D6, D7)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from tests.devices.fake_cameras import Clock, FakeCapture, Rolling, WallClock, step_in
from turnscan.devices import Camera, open_camera
from turnscan.devices._uvc import UvcCamera
from turnscan.errors import (
    DeviceDisconnected,
    DeviceNotFound,
    DeviceRefused,
    DeviceTimeout,
    InputError,
)
from turnscan.testing import check_camera

PERIOD = 1 / 30


def camera_of(
    buffers: int = 4, latency: float = 1.5, seed: int = 0, address: str = "uvc:0"
) -> tuple[UvcCamera, FakeCapture, Clock]:
    clock = Clock()
    capture = FakeCapture(Rolling(clock, buffers, PERIOD, latency), seed)
    return UvcCamera(address, capture=capture, clock=clock), capture, clock


@pytest.mark.parametrize("buffers", range(1, 9))
def test_ten_thousand_grabs_and_none_began_before_it_was_asked_for(buffers: int) -> None:
    rng = np.random.default_rng(buffers)
    stale = plain = 0
    for latency in (1.0, 1.7, 2.3, 2.9, 3.0):
        camera, capture, clock = camera_of(buffers, latency, seed=buffers)
        for step in range(1, 251):
            # Mostly the table's time, sometimes a pause that fills every buffer.
            clock.now += rng.uniform(0.0, 0.1) if rng.uniform() < 0.7 else rng.uniform(0.0, 2.0)
            capture.grab()
            plain += capture.roll.start(capture.number) < clock.now
            capture.steps.append((clock.now, step))
            asked = clock.now
            image = camera.grab(5.0)
            stale += step_in(image) != step or capture.roll.start(capture.number) < asked
    assert plain > 1000, "the stand-in has no stale pictures to give"
    assert stale == 0


def test_flushing_is_what_keeps_it_fresh() -> None:
    camera, capture, clock = camera_of(address="uvc:0?lag=0", latency=2.9)
    stale = 0
    for step in range(1, 101):
        clock.now += 0.2
        capture.steps.append((clock.now, step))
        stale += step_in(camera.grab(5.0)) != step
    assert stale > 50, "the lag would not be needed"


def test_a_fresh_picture_costs_a_few_periods_and_no_more() -> None:
    camera, _, clock = camera_of(buffers=4)
    asked = clock.now
    for _ in range(100):
        camera.grab(5.0)
    assert (clock.now - asked) / 100 < 6 * PERIOD


def test_settings_are_read_back() -> None:
    camera, capture, _ = camera_of()
    assert camera.configure(0.00512, 1.0) == (pytest.approx(0.0051), 1.0)
    assert capture.props[15] == 51
    assert capture.props[21] == 1  # manual
    assert camera.configure(0.01, 2.0) == (pytest.approx(0.01), 2.0)
    assert capture.props[14] == 32.0


@pytest.mark.parametrize("backend", ["DSHOW", "MSMF"])
def test_windows_counts_exposure_in_powers_of_two(backend: str) -> None:
    clock = Clock()
    capture = FakeCapture(Rolling(clock, 2, PERIOD, 1.0))
    capture.backend = backend
    camera = UvcCamera("uvc:0", capture=capture, clock=clock)
    assert camera.configure(0.01, 1.0)[0] == 2.0**-7
    assert capture.props[15] == -7


def test_a_system_without_a_say_in_the_exposure_says_nan() -> None:
    clock = Clock()
    capture = FakeCapture(Rolling(clock, 2, PERIOD, 1.0))
    capture.backend = "AVFOUNDATION"
    seconds, gain = UvcCamera("uvc:0", capture=capture, clock=clock).configure(0.01, 1.0)
    assert np.isnan(seconds)
    assert gain == 1.0


def test_a_camera_that_does_not_follow_is_refused() -> None:
    camera, capture, _ = camera_of()
    capture.fixed |= {15}
    with pytest.raises(DeviceRefused, match=r"exposure 0\.02 s; the camera stays at 0\.0001 s"):
        camera.configure(0.02, 1.0)
    capture.fixed = {14}
    with pytest.raises(DeviceRefused, match="gain 2; the camera stays at 1"):
        camera.configure(0.02, 2.0)


def test_new_exposure_is_given_time_to_arrive() -> None:
    camera, capture, _ = camera_of()
    camera.grab(5.0)
    before = capture.number
    camera.configure(0.01, 1.0)
    camera.grab(5.0)
    assert capture.number - before >= 6


def test_a_camera_that_comes_back_smaller_is_refused() -> None:
    camera, capture, _ = camera_of()
    camera.grab(5.0)
    capture.size = (12, 16)
    with pytest.raises(DeviceRefused, match="16×12 pixels instead of 32×24"):
        camera.grab(5.0)


def test_losing_the_camera_has_a_name() -> None:
    camera, capture, _ = camera_of()
    capture.gone = True
    with pytest.raises(DeviceDisconnected, match="uvc:0: the camera gives no more pictures"):
        camera.grab(5.0)


def test_time_runs_out() -> None:
    camera, _, _ = camera_of()
    with pytest.raises(DeviceTimeout, match=r"within 0\.05 s"):
        camera.grab(0.05)


def test_no_camera_no_size_no_option() -> None:
    clock = Clock()
    capture = FakeCapture(Rolling(clock, 2, PERIOD, 1.0))
    capture.opened = False
    with pytest.raises(DeviceNotFound, match="no camera opens here"):
        UvcCamera("uvc:0", capture=capture, clock=clock)
    assert capture.released
    capture.opened, capture.fixed = True, {3, 4}
    with pytest.raises(DeviceRefused, match="the nearest this camera does is 32"):
        UvcCamera("uvc:0?width=1920", capture=capture, clock=clock)
    for address in ("uvc:0?colour=1", "uvc:0?width=big", "uvc:0?lag=1.5", "uvc:0?pixel=X"):
        with pytest.raises(InputError):
            UvcCamera(address, capture=capture, clock=clock)


def test_a_number_without_a_camera() -> None:
    with pytest.raises(DeviceNotFound), open_camera("uvc:97"):
        pass
    with pytest.raises(DeviceNotFound, match="no such camera"), open_camera("uvc:/dev/no"):
        pass


def test_it_passes_the_conformance_kit() -> None:
    @contextmanager
    def opened() -> Iterator[Camera]:
        capture = FakeCapture(Rolling(WallClock(), 4, 0.006, 1.5))
        camera = UvcCamera("uvc:0", capture=capture)
        try:
            yield camera
        finally:
            camera.close()
            capture.gone = True
            assert capture.released

    check_camera(opened)
