"""The sensor: noise as the theory of photon transfer has it, and every stage of the chain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from turnscan.simulate import Sensor, ccd_1990s, cmos_imx264, expose, webcam
from turnscan.simulate._random import normal, normal_tables
from turnscan.simulate._readout import CHUNK, poisson, tables
from turnscan.simulate._validate import fit_efficiency, photon_transfer

PLAIN = Sensor(pitch_x=0.005, pitch_y=0.005, full_well=60_000.0, gain=1.0, read_noise=0.0, bits=16)


def draws(mean: float, n: int = 400_000) -> np.ndarray:
    """Poisson numbers at evenly spread quantiles: moments without sampling error."""
    out = np.empty((-(-n // CHUNK), CHUNK))
    work = np.empty((5, CHUNK))
    for i, row in enumerate(out):
        work[0], work[1] = mean, (CHUNK * i + np.arange(CHUNK) + 0.5) / out.size
        poisson(work.ravel(), CHUNK, tables())
        row[:] = work[2]
    return out.ravel()


@pytest.mark.parametrize("n", [1, 2, CHUNK - 1, CHUNK])
def test_a_number_is_drawn_alone_as_among_others(n: int) -> None:
    rng = np.random.default_rng(n)
    means = rng.choice([0.0, 1e-30, 0.02, 3.0, 15.999999, 16.0, 400.0], CHUNK)
    u = rng.uniform(1e-9, 1 - 1e-9, CHUNK)
    work = np.full((5, CHUNK), np.nan)
    work[0], work[1] = means, u
    poisson(work.ravel(), n, tables())
    few = (means < 16.0)[:n]
    assert (work[2, :n][few] == stats.poisson.ppf(u, means)[:n][few].clip(0)).all()
    assert (np.abs(work[2, :n] - stats.poisson.ppf(u, means)[:n].clip(0)) <= 1).all()


def test_normal_quantiles_are_those_of_scipy() -> None:
    u = np.concatenate([np.geomspace(1e-9, 0.5, 400), 1 - np.geomspace(1e-9, 0.5, 400)])
    ours = np.array([normal(v, *normal_tables()) for v in u])
    assert np.abs(ours - stats.norm.ppf(u)).max() < 1e-3


@pytest.mark.parametrize("mean", [0.01, 0.3, 2.0, 9.0, 15.99, 16.0, 25.0, 100.0, 5000.0])
def test_shot_noise_is_poisson_in_its_first_three_moments(mean: float) -> None:
    k = draws(mean)
    assert k.mean() == pytest.approx(mean, rel=1e-3)
    assert k.var() == pytest.approx(mean, rel=3e-3)
    assert stats.skew(k) == pytest.approx(mean**-0.5, abs=0.01 * (1 + mean**-0.5))


@pytest.mark.parametrize("mean", [0.5, 8.0, 17.0, 40.0])
def test_shot_noise_has_the_poisson_distribution(mean: float) -> None:
    k = np.arange(int(mean + 6 * mean**0.5) + 1)
    drawn = draws(mean)
    ours = np.array([np.mean(drawn <= i) for i in k])
    assert np.abs(ours - stats.poisson.cdf(k, mean)).max() < 1e-3


@pytest.mark.parametrize(
    "sensor",
    [cmos_imx264(), replace(ccd_1990s(), bits=12, gain=25.0, black=64.0, jitter=0.0)],
    ids=["cmos", "ccd"],
)
def test_photon_transfer_curve_gives_back_gain_and_read_noise(sensor: Sensor) -> None:
    gain, read = photon_transfer(sensor, seed=11)
    assert gain == pytest.approx(sensor.gain, rel=0.01)
    assert read == pytest.approx(sensor.read_noise, rel=0.02)


def test_a_weighted_fit_on_noisy_rows_reaches_the_cramer_rao_bound() -> None:
    error, bound = fit_efficiency(cmos_imx264(), seed=5)
    assert error / bound == pytest.approx(1.0, abs=0.03)


def test_a_picture_is_a_function_of_its_seed() -> None:
    light = np.full((60, 80), 900.0)
    for sensor in (ccd_1990s(), cmos_imx264(), webcam()):
        one, two, other = (expose(light, sensor, seed, 0.02) for seed in (3, 3, 4))
        assert (one == two).all()
        assert (one != other).any()


def test_noise_of_a_pixel_does_not_depend_on_the_rest_of_the_picture() -> None:
    dim = np.full((20, 30), 40.0)
    lit = dim.copy()
    lit[:, 20:] = 5000.0
    assert (expose(dim, PLAIN, 7)[:, :20] == expose(lit, PLAIN, 7)[:, :20]).all()


def test_neighbouring_pixels_and_seeds_are_independent() -> None:
    light = np.full((300, 300), 1000.0)
    a, b = (expose(light, PLAIN, seed).astype(float) - 1000 for seed in (1, 2))
    pairs = [(a, b), (a[1:], a[:-1]), (a[:, 1:], a[:, :-1])]
    for x, y in pairs:
        assert abs(np.corrcoef(x.ravel(), y.ravel())[0, 1]) < 0.015


@settings(max_examples=30)
@given(st.floats(0, 1e5), st.integers(-(2**70), 2**70), st.sampled_from(["ccd", "cmos", "web"]))
def test_any_light_gives_a_picture_of_the_right_kind(level: float, seed: int, kind: str) -> None:
    sensor = {"ccd": ccd_1990s(), "cmos": cmos_imx264(), "web": webcam()}[kind]
    image = expose(np.full((12, 14), level), sensor, seed, 0.01)
    assert image.dtype == (np.uint16 if sensor.bits > 8 else np.uint8)
    assert image.shape == ((12, 14, 3) if sensor.bayer else (12, 14))
    assert int(image.max()) < sensor.levels


def test_saturation_is_monotone_and_ends_at_white() -> None:
    light = np.repeat(np.linspace(0, 3e4, 200)[None], 50, axis=0)
    mean = expose(light, replace(cmos_imx264(), prnu=0.0), 1).mean(axis=0)
    assert (np.diff(mean) > -15).all()
    assert mean[-1] == 4095
    assert mean[0] == pytest.approx(30, abs=1)


def test_pixels_differ_by_the_fixed_pattern_of_the_specimen() -> None:
    sensor = replace(PLAIN, prnu=0.02, full_well=1e8, gain=1e6 / 60_000, serial=4)
    light = np.full((200, 200), 4e5)
    a, b = (expose(light, sensor, seed).astype(float) for seed in (1, 2))
    other = expose(light, replace(sensor, serial=5), 1).astype(float)
    shot = 1 / 4e5
    assert (0.5 * (a + b)).std() / a.mean() == pytest.approx((4e-4 + shot / 2) ** 0.5, rel=0.02)
    assert np.corrcoef(a.ravel(), b.ravel())[0, 1] > 0.98
    assert abs(np.corrcoef(a.ravel(), other.ravel())[0, 1]) < 0.02


def test_dark_current_grows_with_time() -> None:
    sensor = replace(PLAIN, dark_current=500.0)
    assert expose(np.zeros((200, 200)), sensor, 1, 0.1).mean() == pytest.approx(50, rel=0.01)


@pytest.mark.parametrize("bloom", ["column", "blob"])
def test_bloom_moves_the_excess_and_keeps_it(bloom: str) -> None:
    sensor = replace(PLAIN, full_well=1000.0, bloom=bloom)
    light = np.zeros((61, 41))
    light[30, 20] = 12_000.0
    image = expose(light, sensor, 1).astype(float)
    assert image.sum() == pytest.approx(12_000, rel=0.05)
    assert image.max() <= 1000
    assert image[29, 20] > 0
    assert image[31, 20] > 0
    assert (image[:, 19].sum() > 0) == (bloom == "blob")
    drained = expose(light, replace(sensor, anti_bloom=0.75), 1).sum()
    assert drained == pytest.approx(1000 + 0.25 * 11_000, rel=0.05)
    clipped = expose(light, replace(sensor, bloom="none"), 1).sum()
    assert clipped == 1000


def test_jitter_moves_whole_rows_by_the_stated_amount() -> None:
    x = np.arange(120.0)
    light = np.repeat(4e4 * np.exp(-((x - 60) ** 2) / (2 * 4.0**2))[None], 600, axis=0)
    image = expose(light, replace(PLAIN, jitter=0.4), 2).astype(float)
    centre = (image @ x) / image.sum(axis=1)
    assert centre.std() == pytest.approx(0.4, rel=0.1)
    assert image.sum() == pytest.approx(light.sum(), rel=2e-3)


@pytest.mark.parametrize("pattern", ["RGGB", "BGGR", "GRBG", "GBRG"])
def test_colour_survives_the_bayer_filter(pattern: str) -> None:
    light = np.empty((40, 60, 3))
    light[:] = (30_000.0, 9_000.0, 1_000.0)
    image = expose(light, replace(PLAIN, bayer=pattern), 1).astype(float)
    got = image[4:-4, 4:-4].mean(axis=(0, 1))
    assert got == pytest.approx([30_000, 9_000, 1_000], rel=0.01)


@pytest.mark.parametrize("gamma", [1.0, 1.8, 2.2])
def test_gamma_can_be_undone(gamma: float) -> None:
    sensor = replace(PLAIN, bits=12, adc_bits=16, gamma=gamma)
    ramp = np.repeat(np.linspace(2000, 58_000, 64)[None], 400, axis=0)
    image = expose(ramp, sensor, 3).mean(axis=0)
    linear = (image / 4095) ** gamma * 65535
    assert linear == pytest.approx(ramp[0], rel=0.01)


def test_jpeg_changes_little_and_keeps_colours_in_order() -> None:
    light = np.empty((64, 64, 3))
    light[:] = (5000.0, 2000.0, 500.0)
    sharp = expose(light, replace(webcam(), jpeg_quality=0), 1).astype(float)
    coded = expose(light, webcam(), 1).astype(float)
    assert (sharp != coded).any()
    assert coded.mean(axis=(0, 1)) == pytest.approx(sharp.mean(axis=(0, 1)), abs=2)


def test_red_light_is_seen_by_red_pixels() -> None:
    red = webcam().response(650e-6)
    assert red.argmax() == 0
    assert red[0] > 5 * red[2]
    assert ccd_1990s().response(650e-6).shape == (1,)


def test_amplified_gives_more_steps_per_electron() -> None:
    light = np.full((100, 100), 1000.0)
    plain = replace(cmos_imx264(), black=0.0)
    ratio = expose(light, plain.amplified(2.0), 1).mean() / expose(light, plain, 1).mean()
    assert ratio == pytest.approx(2, rel=0.01)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"bits": 7}, "bits"),
        ({"bits": 17}, "bits"),
        ({"gain": 0.0}, "gain"),
        ({"gain": float("nan")}, "gain"),
        ({"read_noise": -1.0}, "read_noise"),
        ({"bayer": "RGB"}, "bayer"),
        ({"bloom": "star"}, "bloom"),
        ({"bits": 12, "adc_bits": 10}, "adc_bits"),
        ({"jpeg_quality": 90}, "jpeg_quality"),
        ({"black": 65535.0}, "black"),
    ],
)
def test_an_impossible_sensor_is_refused_by_field(change: dict[str, object], word: str) -> None:
    with pytest.raises(ValueError, match=f"Sensor.{word}"):
        replace(PLAIN, **change)


@pytest.mark.parametrize(
    "light", [np.full((4, 4), -1.0), np.full((4, 4), np.nan), np.full((4, 4), np.inf)]
)
def test_impossible_light_is_refused(light: np.ndarray) -> None:
    with pytest.raises(ValueError, match="electrons must be finite"):
        expose(light, PLAIN, 1)


def test_wrong_shapes_and_times_are_refused() -> None:
    with pytest.raises(ValueError, match="shape"):
        expose(np.zeros((4, 4, 3)), PLAIN, 1)
    with pytest.raises(ValueError, match="shape"):
        expose(np.zeros((0, 4)), PLAIN, 1)
    with pytest.raises(ValueError, match="seconds"):
        expose(np.zeros((4, 4)), PLAIN, 1, -1.0)
