"""Fused exposures: right on average, as noisy as predicted, and of greater range."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnscan.arrays import Image
from turnscan.errors import InputError
from turnscan.stripes import detect, fuse_exposures

BLACK, READ, ELECTRONS = 6.0, 0.7, 40.0
TIMES = (0.002, 0.008, 0.032)


def exposed(light: np.ndarray, seconds: float, rng: np.random.Generator, bits: int = 8) -> Image:
    """Light in grey levels per second → a picture of a camera with this noise."""
    factor = 1.0 if bits == 8 else 64.0
    electrons = rng.poisson(light * seconds * ELECTRONS)
    levels = (electrons / ELECTRONS + BLACK + rng.normal(0.0, READ, light.shape)) * factor
    top, kind = (255, np.uint8) if bits == 8 else (65535, np.uint16)
    return np.clip(np.round(levels), 0, top).astype(kind)


@pytest.mark.parametrize("bits", [8, 16])
def test_noise_is_as_predicted_from_black_to_the_end_of_the_range(bits: int) -> None:
    rng = np.random.default_rng(3)
    # Each row one light, from nothing to nearly the clipping of the shortest exposure.
    true = np.concatenate([[0.0], np.geomspace(30.0, 115_000.0, 60)])
    light = np.repeat(true[:, None], 4000, axis=1)
    factor = 1.0 if bits == 8 else 64.0
    fused = fuse_exposures(
        [exposed(light, t, rng, bits) for t in TIMES],
        TIMES,
        read_noise=READ * factor,
        electrons_per_dn=ELECTRONS / factor,
        black=BLACK * factor,
        saturation=255.0 * factor,
    )
    want = (BLACK + true * TIMES[0]) * factor * fused.scale
    off = fused.image.mean(axis=1) - want
    spread, sigma = fused.image.std(axis=1), fused.sigma.mean(axis=1)
    assert not fused.saturated.any()
    # 4000 pixels tell a standard deviation to 1.1 %.
    ratio = spread / sigma
    assert ratio.min() > 0.94
    assert ratio.max() < 1.06
    assert np.median(np.abs(ratio - 1.0)) < 0.02
    assert np.abs(off / sigma).max() < 0.1, "biased"


def test_it_beats_the_shortest_where_the_longer_ones_are_not_clipped() -> None:
    rng = np.random.default_rng(4)
    light = np.full((100, 100), 2000.0)
    pictures = [exposed(light, t, rng) for t in TIMES]
    fused = fuse_exposures(
        pictures, TIMES, read_noise=READ, electrons_per_dn=ELECTRONS, black=BLACK
    )
    short = float(np.std(pictures[0])) * fused.scale
    # Read noise of three looks: 1/σ² adds up as t².
    variances = [READ**2 + 1 / 12 + 2000.0 * t / ELECTRONS for t in TIMES]
    best = np.sqrt(1 / sum(t**2 / v for t, v in zip(TIMES, variances, strict=True))) * TIMES[0]
    assert np.std(fused.image) == pytest.approx(best * fused.scale, rel=0.05)
    assert np.std(fused.image) < 0.12 * short


def test_a_stripe_half_on_chrome_half_on_black_is_found_everywhere() -> None:
    rng = np.random.default_rng(5)
    rows, columns = np.mgrid[0:200, 0:120].astype(float)
    centre = 60.3 + 0.02 * rows
    peak = np.where(rows < 100, 100_000.0, 1_200.0)
    light = peak * np.exp(-0.5 * ((columns - centre) / 2.0) ** 2)
    pictures = [exposed(light, t, rng) for t in TIMES]
    fused = fuse_exposures(
        pictures, TIMES, read_noise=READ, electrons_per_dn=ELECTRONS, black=BLACK
    )
    rms = {}
    for name, picture in {"short": pictures[0], "long": pictures[2], "fused": fused.image}.items():
        stripe = detect(picture)
        error = stripe.position - centre[:, 0]
        bright, dark = error[5:95], error[105:195]
        rms[name] = [
            float(np.sqrt(np.mean(e**2))) if np.isfinite(e).all() else np.inf
            for e in (bright, dark)
        ]
    assert rms["short"][1] == np.inf, "the shortest exposure would do"
    assert rms["fused"][0] < 1.2 * rms["short"][0] + 0.005
    assert rms["fused"][1] < 1.2 * rms["long"][1] + 0.005


def test_what_clips_in_the_shortest_is_said() -> None:
    rng = np.random.default_rng(6)
    light = np.full((4, 5), 1000.0)
    light[1, 2] = 1e6
    fused = fuse_exposures(
        [exposed(light, t, rng) for t in TIMES], TIMES,
        read_noise=READ, electrons_per_dn=ELECTRONS, black=BLACK,
    )  # fmt: skip
    assert fused.saturated.sum() == 1
    assert fused.saturated[1, 2]
    assert fused.image[1, 2] == 65535
    assert np.isnan(fused.sigma[1, 2])
    assert not fused.image.flags.writeable


@settings(max_examples=40)
@given(st.permutations(range(3)), st.integers(0, 2**32 - 1), st.booleans())
def test_the_order_of_the_pictures_does_not_matter(
    order: list[int], seed: int, colour: bool
) -> None:
    rng = np.random.default_rng(seed)
    light = rng.uniform(0, 1e5, (6, 7, 3) if colour else (6, 7))
    pictures = [exposed(light, t, rng) for t in TIMES]
    noise = {"read_noise": READ, "electrons_per_dn": ELECTRONS, "black": BLACK}
    one = fuse_exposures(pictures, TIMES, **noise)
    other = fuse_exposures([pictures[k] for k in order], [TIMES[k] for k in order], **noise)
    assert np.array_equal(one.image, other.image)
    assert one.image.shape == light.shape


def test_what_cannot_be_fused() -> None:
    a, b = np.zeros((4, 5), np.uint8), np.zeros((4, 6), np.uint8)
    noise = {"read_noise": 1.0, "electrons_per_dn": 10.0}
    for pictures, times, more in (
        ([a], [0.1], {}),
        ([a, a], [0.1], {}),
        ([a, b], [0.1, 0.2], {}),
        ([a, a.astype(np.uint16)], [0.1, 0.2], {}),
        ([a, a], [0.1, 0.1], {}),
        ([a, a], [0.1, float("nan")], {}),
        ([a, a], [0.0, 0.1], {}),
        ([a, a], [0.1, 0.2], {"black": 300.0}),
        ([a, a], [0.1, 0.2], {"saturation": 256.0}),
        ([a, a], [0.1, 0.2], {"read_noise": -1.0}),
        ([a, a], [0.1, 0.2], {"electrons_per_dn": 0.0}),
    ):
        with pytest.raises(InputError):
            fuse_exposures(pictures, times, **{**noise, **more})
