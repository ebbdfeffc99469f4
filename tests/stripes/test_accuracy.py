"""The error of the centres: not above what is promised, not below what physics allows."""

from __future__ import annotations

import numpy as np
import pytest

from tests.stripes.pictures import bound, light, picture, speckled
from turnscan.arrays import Floats
from turnscan.stripes import Stripe, StripeFlag, StripeSettings, detect

N = 4000
WIDTH = 101
KNOWN = StripeSettings(electrons_per_dn=1.0)


def errors(
    sigma: float,
    peak: float,
    read: float,
    settings: StripeSettings = KNOWN,
    background: float = 0.0,
    full: float | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors (px), claimed sigmas (px) and flags of N rows with random phase."""
    rng = np.random.default_rng(7)
    centre = 50 + rng.uniform(-0.5, 0.5, N)
    lit = picture(rng, light(centre, sigma, peak, WIDTH) + background, read, full)
    stripe = detect(lit, None, settings)
    assert stripe.found.all()
    return stripe.position - centre, stripe.sigma, stripe.flags


@pytest.mark.parametrize(
    ("sigma", "peak", "read", "background", "ceiling"),
    [
        (1.5, 10_000.0, 5.0, 0.0, 0.0086),
        (0.6, 10_000.0, 5.0, 0.0, 0.0072),
        (3.0, 10_000.0, 5.0, 0.0, 0.0121),
        (1.5, 300.0, 8.0, 50.0, 0.078),
    ],
)
def test_the_default_is_near_the_bound_and_not_below(
    sigma: float, peak: float, read: float, background: float, ceiling: float
) -> None:
    error, claimed, flags = errors(sigma, peak, read, background=background)
    rms = float(np.sqrt(np.mean(error**2)))
    # 4000 rows: the sampling error of an rms is 1.1 %.
    assert 0.97 * bound(sigma, peak, read, background) <= rms <= ceiling
    assert abs(error.mean()) < 4 * rms / np.sqrt(N)
    assert 0.85 < (error / claimed).std() < 1.2
    assert np.count_nonzero(flags) < 0.02 * N


@pytest.mark.parametrize(
    ("sigma", "ceiling"),
    [(0.5, 0.004), (0.6, 0.006), (0.7, 0.002), (0.8, 0.003), (0.9, 0.001), (1.1, 0.001)]
    + [(1.3, 0.001), (1.7, 0.001), (2.2, 0.001), (3.0, 0.001), (4.0, 0.001), (6.0, 0.002)],
)
def test_where_the_pixels_lie_moves_no_centre(sigma: float, ceiling: float) -> None:
    """Stripes without noise at 500 places in a pixel, where rounding is 2e-5 of their height.

    Light that a window ends in moves its centre with that place, alike in all pictures of what
    turns on the axis. What is left is that of pixels as wide as the stripe.
    """
    centre = 60 + np.linspace(-0.5, 0.5, 500, endpoint=False)
    lit = np.round(light(centre, sigma, 50_000.0, 121)).astype(np.uint16)
    stripe = detect(lit, None, KNOWN)
    assert np.abs(stripe.position - centre).max() < ceiling
    # A pixel's own width is in the stripe's.
    assert stripe.width == pytest.approx(np.hypot(sigma, np.sqrt(1 / 12)), rel=0.035)


@pytest.mark.parametrize("sigma", [0.6, 0.8, 1.0])
def test_the_median_of_a_narrow_stripe_says_how_far_pixels_move_it(sigma: float) -> None:
    settings = StripeSettings(strategy="median", electrons_per_dn=1.0)
    error, claimed, _ = errors(sigma, 10_000.0, 5.0, settings)
    assert 0.5 < (error / claimed).std() < 1.2


def test_a_clipped_stripe_is_flagged_and_its_sigma_honest() -> None:
    settings = StripeSettings(electrons_per_dn=1.0, saturation=10_000.0)
    error, claimed, flags = errors(1.5, 30_000.0, 8.0, settings, full=10_000.0)
    assert (flags & StripeFlag.SATURATED).all()
    assert error.std() < 0.044
    assert 0.7 < (error / claimed).std() < 1.2


@pytest.mark.parametrize(
    ("strategy", "low", "high"),
    [
        ("maximum", 0.25, 0.33),
        ("centroid", 0.005, 0.06),
        ("median", 0.005, 0.04),
        ("parabola", 0.02, 0.036),
        ("gauss3", 0.015, 0.03),
        ("squared", 0.008, 0.012),
        ("blais-rioux", 0.008, 0.012),
    ],
)
def test_the_other_strategies_are_as_good_as_theory_says(
    strategy: str, low: float, high: float
) -> None:
    settings = StripeSettings(strategy=strategy, electrons_per_dn=1.0)  # type: ignore[arg-type]
    error, claimed, _ = errors(1.5, 10_000.0, 5.0, settings)
    assert low < error.std() < high
    assert abs(error.mean()) < 0.02
    assert 0.3 < (error / claimed).std() < 1.3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("grain", "sigma", "ceiling"), [(0.24, 1.5, 0.129), (0.5, 2.0, 0.301), (0.24, 3.0, 0.186)]
)
def test_speckle_is_averaged_as_well_as_a_window_can(
    grain: float, sigma: float, ceiling: float
) -> None:
    rng = np.random.default_rng(3)
    error, claimed = [], []
    settings = StripeSettings(electrons_per_dn=1.0, speckle_contrast=1.0, speckle_grain=grain)
    for _ in range(4):
        intensity, centre = speckled(rng, grain, sigma, rows=192, fine=16 if grain < 0.3 else 8)
        lit = picture(rng, intensity / intensity[:, 30].mean() * 5000)
        stripe = detect(lit, None, settings)
        error.append(stripe.position - centre)
        claimed.append(stripe.sigma)
    e, s = np.concatenate(error), np.concatenate(claimed)
    assert np.isfinite(e).all()
    rms = float(np.sqrt(np.mean(e**2)))
    # docs/explain/stripes.md: a full-width centroid without camera noise; no window is better.
    area = 4 / np.pi * grain**2
    floor = np.sqrt(area / np.hypot(1, 1.18 * grain) * sigma / (4 * np.sqrt(np.pi)))
    assert 0.85 * floor < rms < 1.1 * ceiling
    assert 0.8 < (e / s).std() < 1.3


def test_sigma_is_honest_where_the_noise_is_unknown() -> None:
    rng = np.random.default_rng(11)
    centre = 50 + 8 * np.sin(np.arange(N) / 300)
    lit = picture(rng, light(centre, 1.5, 2000.0, WIDTH), 5.0)
    stripe = detect(lit)
    z = (stripe.position - centre) / stripe.sigma
    assert 0.85 < z.std() < 1.2


def test_a_constant_background_does_not_move_the_centre() -> None:
    rng = np.random.default_rng(5)
    centre = 50 + rng.uniform(-0.5, 0.5, 500)
    lit = np.round(light(centre, 1.5, 20_000, WIDTH)).astype(np.uint16)
    dark = np.full_like(lit, 3000)
    plain = detect(lit)
    raised = detect(lit + dark, dark)
    np.testing.assert_allclose(raised.position, plain.position, atol=1e-3)
    np.testing.assert_allclose(raised.amplitude, plain.amplitude, rtol=0.01)


def test_a_halo_does_not_drag_the_window() -> None:
    """Narrow line, broad one-sided glow holding four times its light: the window stays put."""
    centre = np.linspace(90.0, 110.0, 300)
    u = np.arange(300)
    d = u - centre[:, None]
    glow = 35.0 * np.exp(-np.abs(d) / np.where(d > 0, 60.0, 12.0))
    lit = np.round(light(centre, 1.8, 170.0, 300) + glow + 10).astype(np.uint8)
    stripe = detect(lit, np.full_like(lit, 10))
    assert stripe.found.all()
    assert np.abs(stripe.position - centre).max() < 0.15
    moved = np.abs(stripe.position - centre).mean()
    assert moved < np.median(stripe.sigma), "what it moves is in sigma …"
    assert ((stripe.flags & StripeFlag.HALO) != 0).mean() < 0.1, "… so it needs no flag"
    everything = (glow + light(centre, 1.8, 170.0, 300)) * u
    dragged = everything.sum(axis=1) / (glow + light(centre, 1.8, 170.0, 300)).sum(axis=1)
    assert np.abs(dragged - centre).min() > 10  # what a plain centre of gravity would do


@pytest.mark.parametrize(("tail", "height"), [(20.0, 35.0), (60.0, 35.0), (6.0, 35.0), (6.0, 80.0)])
def test_the_flag_tells_a_halo_that_moves_the_centre_by_more_than_its_sigma(
    tail: float, height: float
) -> None:
    centre = np.linspace(90.0, 110.0, 300)
    d = np.arange(300) - centre[:, None]
    near = 12.0 if tail > 12 else 2.0
    glow = height * np.exp(-np.abs(d) / np.where(d > 0, tail, near))
    lit = np.round(light(centre, 1.8, 205.0 - height, 300) + glow + 10).clip(0, 255)
    stripe = detect(lit.astype(np.uint8), np.full(lit.shape, 10, np.uint8))
    ratio = float((stripe.position - centre).mean() / np.median(stripe.sigma))
    flagged = ((stripe.flags & StripeFlag.HALO) != 0).mean()
    assert not 0.9 < ratio < 1.1, "a case that tells the two apart"
    assert flagged > 0.9 if ratio > 1 else flagged < 0.1


def beside(length: float, glow: float, sigma: float) -> tuple[Floats, Stripe]:
    """Light that an exponential carries to one side, and a grain in every pixel: the error of each
    centre, NaN where there is none, and the stripe."""
    centre = 45.0 + 0.01 * np.arange(400.0)
    carried = -length * np.log1p(-(np.arange(40) + 0.5) / 40)
    halo = np.mean([light(centre + far, sigma, 8000.0, 121) for far in carried], axis=0)
    whole = light(centre, sigma, 8000.0, 121) + glow * halo
    lit = picture(
        np.random.default_rng(7), whole * np.random.default_rng(6).gamma(8, 1 / 8, whole.shape)
    )
    stripe = detect(lit, np.full_like(lit, 100))
    return stripe.position - centre, stripe


@pytest.mark.parametrize("sigma", [1.3, 2.0, 3.0])
@pytest.mark.parametrize("length", [6.0, 12.0])
def test_a_halo_flag_comes_with_its_size(length: float, sigma: float) -> None:
    error, stripe = beside(length, 0.8, sigma)
    flagged = (stripe.flags & StripeFlag.HALO) != 0
    assert flagged.mean() > 0.4
    assert stripe.halo is not None
    assert np.isnan(stripe.halo[~flagged]).all()
    assert 0.7 < np.nanmedian(stripe.halo) / error[flagged].mean() < 1.4


@pytest.mark.parametrize("length", [3.0, 6.0, 12.0])
@pytest.mark.parametrize(("glow", "told"), [(0.0, False), (0.1, False), (1.2, True)])
def test_a_halo_is_told_under_speckle_once_it_moves_the_centre_by_more_than_sigma(
    length: float, glow: float, told: bool
) -> None:
    error, stripe = beside(length, glow, 1.5)
    there = stripe.found
    ratio = float(np.mean(error[there]) / np.median(stripe.sigma[there]))
    flagged = float(((stripe.flags & StripeFlag.HALO) != 0)[there].mean())
    assert ratio > 1.3 if told else ratio < 0.6, "a case that tells the two apart"
    assert flagged > 0.7 if told else flagged < 0.05


@pytest.mark.parametrize("share", [0.0, 0.06])
def test_speckle_in_the_tails_and_a_glow_on_both_sides_move_nothing(share: float) -> None:
    """Grains of a pixel on a stripe of 1.7 px, beside it a glow of a share of its height."""
    rng = np.random.default_rng(4)
    grains, centre = speckled(rng, 1.1, 1.7, 300, 121)
    clean = 1500.0 * 1.7 * np.sqrt(2 * np.pi) / 121 * grains
    away = np.abs(np.arange(121) - centre)
    stripe = detect(picture(rng, clean + 1500.0 * share * np.exp(-away / 25.0)))
    flagged = (stripe.flags[stripe.found] & StripeFlag.HALO) != 0
    assert stripe.found.mean() > 0.95
    assert flagged.mean() <= 0.1
