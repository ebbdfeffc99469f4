"""The skew of stripes: which side of their light is cut off."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from tests.stripes.pictures import light, picture
from turnscan.stripes import Candidates, Strategy, StripeSettings, detect, find_candidates

ROWS, WIDTH, FINE = 200, 81, 50


def cut_at(c: float, sigma: float, side: int = 1) -> np.ndarray:
    """(ROWS, WIDTH) stripes that wander by a pixel, of whose light nothing is left beyond ``c``
    widths to the right of their middle, or to the left where ``side`` is -1."""
    centre = 40.0 + np.linspace(0.0, 1.0, ROWS)
    x = (np.arange(WIDTH * FINE) + 0.5) / FINE - 0.5 - centre[:, None]
    fine = np.exp(-0.5 * (x / sigma) ** 2) * (side * x < c * sigma)
    return 3e4 * fine.reshape(ROWS, WIDTH, FINE).mean(axis=2)


def skew_of(electrons: np.ndarray, **settings: object) -> float:
    lit = picture(np.random.default_rng(5), electrons)
    found = detect(lit, np.full_like(lit, 100), StripeSettings(**settings))
    assert found.skew is not None
    return float(np.median(found.skew[found.found]))


@pytest.mark.parametrize("sigma", [0.7, 1.3, 3.0])
def test_light_that_is_alike_on_both_sides_has_none(sigma):
    centre = 40.0 + np.linspace(0.0, 1.0, ROWS)
    assert skew_of(light(centre, sigma, 3e4, WIDTH)) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize(
    ("c", "least", "most"), [(2.0, 0.15, 0.25), (1.0, 0.4, 0.65), (0, 0.55, 1)]
)
@pytest.mark.parametrize("sigma", [1.5, 4.0])
def test_what_an_edge_leaves_has_its_tail_on_the_other_side(c, sigma, least, most):
    """Of a Gaussian cut 2, 1 and 0 widths beside its middle -0.22, -0.59 and -0.99; pixels blur."""
    assert least < -skew_of(cut_at(c, sigma)) < most
    assert least < skew_of(cut_at(c, sigma, side=-1)) < most


@pytest.mark.parametrize("strategy", get_args(Strategy))
def test_it_is_that_of_the_light_by_whatever_strategy_the_centre_is_found(strategy):
    window = skew_of(cut_at(0.5, 2.0))
    assert skew_of(cut_at(0.5, 2.0), strategy=strategy) == pytest.approx(window, abs=1e-12)


def test_where_there_is_no_centre_there_is_none():
    electrons = cut_at(1.0, 2.0)
    electrons[50:70] = 0.0
    lit = picture(np.random.default_rng(5), electrons)
    found = detect(lit, np.full_like(lit, 100), StripeSettings(threshold=200.0))
    assert found.skew is not None
    assert np.array_equal(np.isnan(found.skew), ~found.found)
    assert not found.found[50:70].any()
    every = find_candidates(lit, np.full_like(lit, 100), StripeSettings(threshold=200.0))
    assert every.skew is not None
    assert np.array_equal(every.skew[found.found, 0], found.skew[found.found])


def test_noise_that_cancels_the_light_makes_no_skew_of_thousands():
    """Faint stripes, a third of them lost: what is known of the others is a skew, or nothing."""
    electrons = light(40.0 + np.linspace(0.0, 1.0, ROWS), 1.0, 25.0, WIDTH)
    lit = picture(np.random.default_rng(5), electrons)
    found = detect(lit, np.full_like(lit, 100), StripeSettings(threshold=15.0))
    assert found.skew is not None
    assert found.found.sum() > 100
    assert np.nanmax(np.abs(found.skew)) < 100.0


def test_candidates_without_one_hand_on_none():
    """What a detector does not measure is missing, not zero."""
    one = np.ones((3, 1))
    bare = Candidates(10.0 * one, 0.1 * one, 90.0 * one, one, np.zeros((3, 1), np.uint16))
    assert bare.skew is None
    assert np.isnan(bare.table()[5]).all()
    assert Candidates.made_of(bare.table(), bare.flags, "vertical").table().shape == (6, 3, 1)
