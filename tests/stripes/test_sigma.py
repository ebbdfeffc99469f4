"""Claimed sigmas against the scatter where one cause of error outweighs all others."""

from __future__ import annotations

import numpy as np
import pytest

from tests.stripes.pictures import light, picture
from turnscan.arrays import Floats
from turnscan.stripes import StripeFlag, StripeSettings, _clipped, detect
from turnscan.stripes._list import COLUMNS, ROW
from turnscan.stripes._list import WIDTH as WIDE

N = 2000
WIDTH = 161


def centres(rng: np.random.Generator) -> np.ndarray:
    return np.asarray(80 + rng.uniform(-0.5, 0.5, N))


@pytest.mark.parametrize("part", [0.6, 0.7])
def test_a_window_that_cuts_a_stripe_short_scatters_more_and_says_so(part: float) -> None:
    """The window follows the centre that it measures, and where light is cut off at its ends a move
    lets in more on that side: noise grows by 1 / (1 − 2 h p(h)), p the share of light in a pixel
    there. By 1.8 and 1.5 here."""
    rng = np.random.default_rng(3)
    centre = centres(rng)
    lit = picture(rng, light(centre, 4.0, 2000.0, WIDTH), 5.0)
    stripe = detect(lit, None, StripeSettings(electrons_per_dn=1.0, width=4.0 * part))
    z = (stripe.position - centre) / stripe.sigma
    # 2000 rows: the scatter is known to 1.6 %.
    assert 0.85 < z.std() < 1.15


def test_the_dark_picture_brings_its_own_read_noise() -> None:
    """A stripe under much read noise: the difference of two pictures has that of both."""
    rng = np.random.default_rng(5)
    centre = centres(rng)
    settings = StripeSettings(electrons_per_dn=1.0, read_noise=60.0)
    lit = picture(rng, light(centre, 1.5, 3000.0, WIDTH) + 400.0, 60.0)
    dark = picture(rng, np.full((N, WIDTH), 400.0), 60.0)
    scatter = []
    for off in (dark, None):
        stripe = detect(lit, off, settings)
        assert stripe.found.all()
        z = (stripe.position - centre) / stripe.sigma
        assert 0.8 < z.std() < 1.1
        scatter.append(float((stripe.position - centre).std()))
    assert scatter[0] > 1.2 * scatter[1]


@pytest.mark.parametrize(("share", "reach"), [(0.25, 30.0), (0.4, 16.0), (0.4, 40.0)])
def test_what_glows_beside_a_stripe_drags_the_centre_and_is_in_its_sigma(
    share: float, reach: float
) -> None:
    """A glow twice as bright on one side as on the other; noise is the least of the errors.

    How much it drags depends on its shape, which nobody knows: the sigma is right to a factor.
    """
    rng = np.random.default_rng(7)
    centre = 240 + centres(rng)[:400]
    away = np.arange(640) - centre[:, None]
    glow = 6000.0 * share * np.exp(-np.abs(away) / reach) * np.where(away > 0, 1.0, 0.5)
    settings = StripeSettings(electrons_per_dn=1.0, read_noise=5.0)
    stripe = detect(picture(rng, light(centre, 2.0, 6000.0, 640) + glow, 5.0), None, settings)
    assert stripe.found.all()
    error = stripe.position - centre
    assert abs(error.mean()) > 10 * error.std(), "it drags all lines the same way"
    assert 0.5 < np.sqrt(np.mean((error / stripe.sigma) ** 2)) < 6.0


def moved_by_clipping(sigma: float, run: int, ratio: float, slant: float) -> tuple[Floats, Floats]:
    """(n,) px by which clipping over ``run`` px moves stripes of two halves of Gaussians, and their
    sigma."""
    from scipy.special import erf

    rng = np.random.default_rng(17)
    centre = 80.37 + slant * np.arange(600) % 40
    off = np.arange(WIDTH + 1) - 0.5 - centre[:, None]
    wide = np.where(off < 0, sigma / np.sqrt(ratio), sigma * np.sqrt(ratio))
    shape = np.diff(wide * np.sqrt(np.pi / 2) * erf(off / (wide * np.sqrt(2))))
    full, span = 3000.0, sigma * (1 / np.sqrt(ratio) + np.sqrt(ratio))
    settings = StripeSettings(electrons_per_dn=1.0, saturation=full + 100.0)
    plain = detect(picture(rng, 0.5 * full * shape, 5.0, full), None, settings)
    bright = full * np.exp(0.5 * (run / span) ** 2)
    cut = detect(picture(rng, bright * shape, 5.0, full), None, settings)
    assert (cut.flags & StripeFlag.SATURATED).all()
    return cut.position - centre - np.mean(plain.position - centre), cut.sigma


@pytest.mark.parametrize(("sigma", "run"), [(3.0, 5), (3.0, 11), (4.0, 14), (1.5, 4)])
@pytest.mark.parametrize("ratio", [1.0, 1 / 1.3, 1.8])
def test_clipping_moves_a_lopsided_stripe_and_sigma_says_how_far(
    sigma: float, run: int, ratio: float
) -> None:
    """The centre is asked where nothing is clipped; symmetric ones are not moved, and their sigma
    stays small."""
    moved, stated = moved_by_clipping(sigma, run, ratio, 0.03)
    z = float(np.sqrt(np.mean((moved / stated) ** 2)))
    if ratio == 1.0:
        assert abs(moved.mean()) < 0.01 * sigma
        assert np.median(stated) < 0.04
        assert 0.3 < z < 1.2
    else:
        assert np.sign(moved.mean()) == np.sign(ratio - 1.0)
        assert 0.6 < z < 1.4


def test_flanks_that_do_not_fall_leave_what_is_usual() -> None:
    """Light that spread beside a clipped stripe hides how its own falls: nothing was taken for
    certain there."""
    line = np.full(121, 0.2 * 3000.0)
    line[56:65] = 3000.0
    share, _, unit = _clipped.cut_share(line, np.array([56.0, 64.0]), 3000.0, 2.0)
    assert np.isnan(share)
    assert unit > 1.0
    some = np.zeros((3, COLUMNS))
    some[:, ROW], some[:, WIDE] = np.arange(3), 1.5
    count, middle, phase = np.full(3, 9), np.full(3, 60.0), np.full(3, 1e-4)
    for known, usual in ((np.full(3, share), 1.0), (np.array([0.0, share, 0.0]), 0.0)):
        square = _clipped._square(some, 1, 3, count, middle, known, phase)
        assert square == pytest.approx(usual * _clipped.USUAL_SHARE**2, abs=2e-4)


@pytest.mark.parametrize(("sigma", "run"), [(1.5, 8), (1.5, 12), (1.2, 6)])
@pytest.mark.parametrize("slant", [0.0, 0.003, 0.2])
def test_flanks_that_fall_within_a_pixel_or_two_leave_the_centre_open(
    sigma: float, run: int, slant: float
) -> None:
    """The fewer phases of the pixels there are, the less flanks say of each other."""
    for ratio in (1.2, 1.8):
        moved, stated = moved_by_clipping(sigma, run, ratio, slant)
        assert moved.mean() > 0.1
        assert 0.6 < np.sqrt(np.mean((moved / stated) ** 2)) < 2.5
    moved, stated = moved_by_clipping(sigma, run, 1.0, slant)
    assert abs(moved.mean()) < 0.01 * sigma
    assert 0.03 < np.median(stated) < 0.06 * run
