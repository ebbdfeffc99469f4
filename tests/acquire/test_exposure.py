"""Auto-exposure on the stripe, brackets, and cameras that lie about their exposure (D7)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnscan.acquire import auto_exposure, bracket, exposure_findings, stripe_peak
from turnscan.arrays import Image
from turnscan.errors import DeviceRefused, InputError
from turnscan.simulate import simulated


class Bench:
    """A stripe of a given brightness, seen by a camera with noise, black level and gamma."""

    def __init__(self, light: float, black: float = 4.0, gamma: float = 1.0, bits: int = 8) -> None:
        self.light, self.black, self.gamma, self.bits = light, black, gamma, bits
        self.rng = np.random.default_rng(1)
        self.seconds, self.asked = 0.01, []
        self.lies = self.silent = False
        self.quantum = 1e-5

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        if seconds > 10.0:
            raise DeviceRefused("too long")
        self.asked.append(seconds)
        accepted = max(round(seconds / self.quantum), 1) * self.quantum
        if not self.lies:
            self.seconds = accepted
        return (math.nan, math.nan) if self.silent else (accepted, gain)

    def grab(self, timeout: float) -> Image:
        columns = np.arange(120.0)
        row = self.light * self.seconds * np.exp(-0.5 * ((columns - 50.0) / 2.5) ** 2)
        image = np.tile(row, (200, 1)) * np.linspace(0.3, 1.0, 200)[:, None]
        image[:40] = 0.0  # nothing there
        image += self.light * self.seconds * 0.02
        image = np.clip(image + self.black + self.rng.normal(0, 1.0, image.shape), 0, 255)
        out = np.round(255.0 * (image / 255.0) ** (1.0 / self.gamma))
        return out.astype(np.uint8) if self.bits == 8 else (out * 257).astype(np.uint16)


@settings(max_examples=60)
@given(
    light=st.floats(1e3, 1e6),
    start=st.floats(3e-4, 0.3),
    gamma=st.sampled_from([1.0, 2.2]),
    black=st.floats(0.0, 12.0),
    bits=st.sampled_from([8, 16]),
)
def test_the_stripe_comes_to_60_to_80_percent(
    light: float, start: float, gamma: float, black: float, bits: int
) -> None:
    camera = Bench(light, black, gamma, bits)
    found = auto_exposure(camera, start)
    assert found.reached
    assert 0.6 <= found.peak <= 0.8
    assert found.pictures <= 8
    assert camera.seconds == found.seconds
    assert 0.58 <= stripe_peak(camera.grab(1.0)) <= 0.82


def test_too_dark_and_too_bright_give_the_best_there_is() -> None:
    dark = Bench(light=50.0)
    found = auto_exposure(dark, 0.01, longest=0.5)
    assert not found.reached
    assert found.seconds == pytest.approx(0.5)
    assert found.peak < 0.3
    bright = Bench(light=1e8)
    found = auto_exposure(bright, 0.01)
    assert not found.reached
    assert found.seconds == pytest.approx(1e-4)
    assert bright.seconds == found.seconds


def test_a_camera_that_cannot_be_set_is_not_asked_ten_times() -> None:
    camera = Bench(light=1e4)
    camera.silent = camera.lies = True
    found = auto_exposure(camera, 0.01)
    assert found.pictures == 1
    assert not found.reached


def test_a_few_steps_of_exposure_are_enough_for_a_coarse_camera() -> None:
    camera = Bench(light=2.4e4)
    camera.quantum = 0.005
    found = auto_exposure(camera, 0.1)
    assert found.pictures <= 10
    assert found.peak < 0.98


def test_limits_must_be_in_order() -> None:
    for more in ({"longest": 0.001}, {"shortest": 0.1}, {"low": 0.9}, {"high": 1.0}):
        with pytest.raises(InputError):
            auto_exposure(Bench(1e4), 0.01, **more)


def test_the_peak_is_the_stripes_even_where_few_rows_see_it() -> None:
    image = np.full((480, 640), 5, np.uint8)
    image[100:110, 300] = 180
    assert stripe_peak(image) == pytest.approx(180 / 255)
    assert stripe_peak(np.repeat(image[..., None], 3, axis=2)) == pytest.approx(180 / 255)

    assert stripe_peak(np.full((8, 8), 65535, np.uint16)) == 1.0


def test_a_simulated_stripe() -> None:
    devices = simulated("sim:sphere?rig=ciclop&lasers=1&perfect=1")
    devices.lasers.light(frozenset(devices.lasers.names), 60.0)
    found = auto_exposure(devices.camera, 0.2)
    devices.lasers.off()
    assert found.reached
    assert 0.6 <= found.peak <= 0.8


def test_a_bracket_gives_what_was_accepted() -> None:
    camera = Bench(light=1e4)
    taken = bracket(camera, (0.001, 0.004004))
    assert [t for _, t in taken] == pytest.approx([0.001, 0.004])
    assert taken[1][0].mean() > taken[0][0].mean()


def test_an_honest_camera_has_no_findings() -> None:
    assert exposure_findings(Bench(light=2e4), 0.01) == []


def test_a_camera_that_ignores_its_exposure_is_named_before_the_scan() -> None:
    camera = Bench(light=2e4)
    camera.lies = True
    codes = {f.code: f.severity for f in exposure_findings(camera, 0.01)}
    assert codes == {"devices.exposure-ignored": "error"}


def test_a_camera_that_takes_another_or_tells_none_is_named() -> None:
    camera = Bench(light=2e4)
    camera.quantum = 0.008
    assert [f.code for f in exposure_findings(camera, 0.010)] == ["devices.exposure-differs"]
    camera.silent = True
    codes = [f.code for f in exposure_findings(camera, 0.016)]
    assert codes == ["devices.exposure-unknown", "devices.gain-unknown"]
