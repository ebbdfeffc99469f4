"""Symmetric stripes are no cut ones."""

from __future__ import annotations

import numpy as np
import pytest

from turnscan.points._symmetry import as_it_leans

S, N = 5, 60


def left(skewness: float | np.ndarray, width: float = 2.0, doubt: float = 3.0) -> np.ndarray:
    leaning = skewness + 0.03 * np.random.default_rng(1).normal(size=(S, N))
    return as_it_leans(np.full((S, N), doubt), np.full((S, N), width), leaning)


def test_a_symmetric_stripe_is_doubted_by_a_part_of_its_width_at_most() -> None:
    assert np.median(left(0.0)) == pytest.approx(0.25 * 2.0, rel=0.25)
    assert (left(0.0) >= 0.25 * 2.0).all()


@pytest.mark.parametrize("skewness", [0.25, -0.4])
def test_one_that_leans_keeps_all_of_its_doubt(skewness: float) -> None:
    assert (left(skewness) == 3.0).mean() > 0.98


def test_a_small_doubt_stays() -> None:
    assert (left(0.0, doubt=0.2) == 0.2).all()


def test_what_is_no_wider_than_the_blur_tells_nothing() -> None:
    assert (left(0.0, width=0.45) == 3.0).all()
    assert (left(0.0, width=0.55) == 3.0).all()


def test_an_edge_that_cuts_a_few_lines_counts_by_itself() -> None:
    some = np.zeros((S, N))
    some[:, 30:36] = 0.5
    kept = left(some)
    assert (kept[:, 31:35] == 3.0).all()
    assert (kept[:, :15] < 1.0).all()


def test_speckle_that_makes_single_lines_lean_does_not() -> None:
    dice = np.random.default_rng(2)
    noisy = as_it_leans(
        np.full((S, 400), 3.0), np.full((S, 400), 2.0), 0.2 * dice.normal(size=(S, 400))
    )
    assert np.median(noisy) < 1.2


def test_nothing_known_changes_nothing() -> None:
    doubt, width = np.full((S, N), 3.0), np.full((S, N), 2.0)
    assert as_it_leans(doubt, width, None) is doubt
    assert np.array_equal(as_it_leans(doubt, width, np.full((S, N), np.nan)), doubt)
