"""How far stripes lean: by Gaussians that an edge cuts off."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from turnscan.arrays import Image
from turnscan.stripes import Stripe, choose, detect, find_candidates

LINES, WIDTH, FINE, SIGMA = 120, 80, 20, 2.0


def picture(cut: float, blur: float, noise: float, flip: bool) -> Image:
    """A stripe of which nothing lies below ``cut`` sigma beside its middle, seen through a lens."""
    at = np.arange(WIDTH * FINE) / FINE - WIDTH / 2 + 0.37
    light = np.exp(-0.5 * (at / SIGMA) ** 2) * (at > cut * SIGMA)
    light = gaussian_filter1d(light, blur * FINE).reshape(WIDTH, FINE).mean(axis=1)
    light = light[::-1] if flip else light
    dice = np.random.default_rng(4)
    lit = 10.0 + 150.0 * light + noise * dice.normal(size=(LINES, WIDTH))
    return np.clip(np.rint(lit), 0, 255).astype(np.uint8)


def skewness(stripe: Stripe) -> float:
    assert stripe.skewness is not None
    return float(np.nanmedian(stripe.skewness))


@pytest.mark.parametrize("noise", [0.3, 2.0])
def test_a_whole_stripe_is_symmetric(noise: float) -> None:
    assert abs(skewness(detect(picture(-9.0, 0.5, noise, False)))) < 0.03


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize(
    ("cut", "low", "high"), [(-1.2, 0.15, 0.35), (-0.5, 0.25, 0.5), (0, 0.3, 0.6)]
)
def test_a_cut_stripe_leans_towards_what_is_left(cut, low, high, flip) -> None:
    found = skewness(detect(picture(cut, 0.5, 1.0, flip)))
    assert low < (-found if flip else found) < high


def test_blur_hides_it() -> None:
    """It adds to the variance alone: a third moment stays. Of a sharp one the window cuts more."""
    sharp, soft = (detect(picture(-0.5, blur, 0.3, False)) for blur in (0.5, 1.5))
    part = (np.nanmedian(sharp.width) / np.nanmedian(soft.width)) ** 3
    assert part < skewness(soft) / skewness(sharp) < 2.0 * part < 0.8


def test_it_stays_with_its_centre() -> None:
    lit = picture(-0.5, 0.5, 1.0, False)
    candidates = find_candidates(lit)
    assert candidates.skewness is not None
    assert np.array_equal(choose(candidates).skewness, detect(lit).skewness, equal_nan=True)
    stripe = detect(lit)
    assert stripe.skewness is not None
    assert np.array_equal(np.isnan(stripe.skewness), ~stripe.found)
    assert np.array_equal(stripe.table()[-1], stripe.skewness, equal_nan=True)
