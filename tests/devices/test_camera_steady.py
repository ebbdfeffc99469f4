"""Bad pictures are recognised and taken again, and never handed on (RELIABILITY D2, D4, D5, D6)."""

from __future__ import annotations

import threading
import time
from collections import Counter
from itertools import chain, cycle, repeat

import numpy as np
import pytest

from tests.devices.fake_cameras import KINDS, Buffered, Clock, Faulty, Rolling
from turnscan.arrays import Image
from turnscan.devices import Camera, CameraTraits, Steady, frame_deadline
from turnscan.errors import (
    DeviceDisconnected,
    DeviceError,
    DeviceGarbled,
    DeviceRefused,
    DeviceTimeout,
)

SEEN_AS = {"blank": "torn"}


def test_each_fault_at_one_percent_is_recognised_and_no_bad_picture_gets_through() -> None:
    rng = np.random.default_rng(5)
    share = [0.01] * len(KINDS)
    script = rng.choice([*KINDS, None], size=20_000, p=[*share, 1 - sum(share)])
    camera = Faulty(chain([None], script))
    steady = Steady(camera)
    good = missing = 0
    for _ in range(4000):
        try:
            assert steady.grab(1.0, lit=True) is camera.right
            good += 1
        except DeviceError:
            missing += 1
    injected = Counter(SEEN_AS.get(k, k) for k in camera.injected)
    assert missing <= 2  # 0.07**4 of 4000
    assert good + missing == 4000
    assert min(Counter(camera.injected).values()) >= 20
    assert steady.counts == injected


@pytest.mark.parametrize("kind", KINDS)
def test_bursts_either_end_in_time_or_in_a_named_error(kind: str) -> None:
    rng = np.random.default_rng(6)
    script: list[str | None] = [None]
    for _ in range(120):
        script += [kind] * int(rng.integers(1, 7)) + [None] * int(rng.integers(1, 5))
    camera = Faulty(chain(script, repeat(None)), shape=(240, 32))
    steady = Steady(camera)
    errors: list[DeviceError] = []
    for _ in range(300):
        try:
            assert steady.grab(0.5, lit=True) is camera.right
        except DeviceError as e:
            errors.append(e)
    assert len(errors) >= 20
    assert all(e.hint and SEEN_AS.get(kind, kind) in e.message for e in errors)


@pytest.mark.parametrize(
    ("kind", "error", "words"),
    [
        ("dropped", DeviceTimeout, "4 attempts (4 × dropped), 0.5 s each"),
        ("frozen", DeviceGarbled, "4 × frozen"),
        ("torn", DeviceGarbled, "4 × torn"),
        ("wrong size", DeviceRefused, "the first had 64×48 pixels of uint8"),
        ("black", DeviceError, "4 × black"),
        ("saturated", DeviceError, "4 × saturated"),
    ],
)
def test_after_three_retries_the_error_says_what_it_was(
    kind: str, error: type[DeviceError], words: str
) -> None:
    camera = Faulty(chain([None], repeat(kind)))
    steady = Steady(camera)
    steady.grab(0.5)
    with pytest.raises(error) as caught:
        steady.grab(0.5, lit=True)
    assert words in str(caught.value)
    assert type(caught.value) is error
    assert len(camera.injected) == 4


def test_a_lower_resolution_is_refused_and_not_adapted_to() -> None:
    camera = Faulty(repeat(None))
    steady = Steady(camera)
    steady.grab(1.0)
    camera.shape = (24, 32)
    with pytest.raises(DeviceRefused, match="64×48"):
        steady.grab(1.0)


def test_a_dark_room_and_a_scene_with_a_black_half_are_no_faults() -> None:
    class Clipped(Faulty):
        def _good(self) -> Image:
            return np.zeros(self.shape, np.uint8)

    steady = Steady(Clipped(repeat(None)))
    for _ in range(5):
        assert not steady.grab(1.0).any()
    with pytest.raises(DeviceError, match="black"):
        steady.grab(1.0, lit=True)

    class Half(Faulty):
        def _good(self) -> Image:
            image = super()._good()
            image[20:] = 0
            return image

    steady = Steady(Half(repeat(None)))
    for _ in range(5):
        steady.grab(1.0)
    assert steady.counts == {"torn": 2}


def test_a_camera_without_noise_may_repeat_itself() -> None:
    class Same:
        traits = CameraTraits(instant=True, noiseless=True)

        def configure(self, seconds: float, gain: float) -> tuple[float, float]:
            return seconds, gain

        def grab(self, timeout: float) -> Image:
            return np.arange(4096, dtype=np.uint16).reshape(64, 64)

    steady = Steady(Same())
    assert isinstance(steady, Camera)
    for _ in range(3):
        steady.grab(1.0)
    assert not steady.counts


@pytest.mark.parametrize("buffers", range(1, 9))
def test_no_picture_that_was_waiting_in_a_buffer_gets_through(buffers: int) -> None:
    rng = np.random.default_rng(buffers)
    clock = Clock()
    roll = Rolling(clock, buffers, period=0.04, latency=1.2)
    camera = Buffered(roll, seconds=0.036)
    steady = Steady(camera, clock=clock)
    steady.configure(0.036, 1.0)
    plain = 0
    for _ in range(250):
        clock.now += rng.uniform(0.0, 0.6)
        asked, stale = clock.now, steady.counts["stale"]
        steady.grab(5.0)
        assert roll.arrival(camera.last) - asked >= 0.9 * 0.036
        if steady.counts["stale"] > stale:
            assert roll.start(camera.last) >= asked, "on its way when the buffer was emptied"
        clock.now += rng.uniform(0.0, 0.6)
        asked = clock.now
        camera.grab(5.0)
        plain += roll.arrival(camera.last) < asked
    assert plain > 200, "the test's camera has nothing in its buffer"
    assert steady.counts["stale"] > 200


def test_a_driver_that_only_has_buffered_pictures_is_given_up() -> None:
    camera = Faulty(repeat(None))
    camera.traits = CameraTraits(instant=False)
    steady = Steady(camera)
    steady.configure(10.0, 1.0)
    with pytest.raises(DeviceError, match="stale"):
        steady.grab(1.0)


def test_a_driver_that_hangs_is_left_alone() -> None:
    release = threading.Event()

    class Hangs(Faulty):
        def grab(self, timeout: float) -> Image:
            release.wait(30.0)
            return super().grab(timeout)

    steady = Steady(Hangs(repeat(None)), retries=0)
    begun = time.monotonic()
    with pytest.raises(DeviceTimeout):
        steady.grab(0.05)
    with pytest.raises(DeviceDisconnected, match="still blocked"):
        steady.grab(0.05)
    assert time.monotonic() - begun < 20.0
    release.set()


def test_errors_that_no_retry_can_mend_come_out_at_once() -> None:
    calls = []

    class Gone(Faulty):
        def grab(self, timeout: float) -> Image:
            calls.append(timeout)
            raise DeviceDisconnected("gone")

    with pytest.raises(DeviceDisconnected):
        Steady(Gone(cycle([None]))).grab(1.0)
    assert calls == [1.0]


def test_deadlines() -> None:
    assert frame_deadline(0.01) == 5.0
    assert frame_deadline(4.0) == 20.0
    assert frame_deadline(0.01, first=True) == 20.0
    assert frame_deadline(float("nan")) == 5.0
