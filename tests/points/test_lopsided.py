"""What the skew of stripes makes of what widths and light say of them."""

from __future__ import annotations

import numpy as np
import pytest

from turnscan.points._lit_points import LitPoints
from turnscan.points._lopsided import BySkew, by_skew
from turnscan.points._own_light import Own

S, N, WIDE, NOISE = 6, 60, 2.0, 0.1
STEP, MIDDLE = 3, slice(12, 48)
THICK = 0.4
"""mm: a pixel leads 0.2 mm away from the sheet on the wall, so that a whole stripe is 2 px wide."""


def told(
    skew: float, *, doubt: float = 0.0, shift: float = 0.0, width: float = 1.0, light: float = 1.0,
    lines: slice = MIDDLE, thickness: float = THICK, measured: bool = True, noise: float = NOISE,
) -> BySkew:  # fmt: skip
    """By the skew of a profile of a wall, in some lines of which stripes have this share of their
    width and light, and are judged so, px."""
    seen = noise * np.random.default_rng(3).normal(size=(S, N))
    wide, bright, own = np.full((S, N), WIDE), np.full((S, N), 100.0), np.zeros((2, S, N))
    seen[STEP, lines] += skew
    wide[STEP, lines] *= width
    bright[STEP, lines] *= light
    own[:, STEP, lines] = np.array([shift, doubt])[:, None]
    points = np.zeros((S, N, 3))
    points[..., 0], points[..., 2] = np.arange(S)[:, None], 0.3 * np.arange(N)
    lit = LitPoints(
        points,
        np.tile([0.0, -500.0, 9.0], (S, 1)),
        np.tile([0.2, 0.0, 0.0], (S, N, 1)),
        np.tile([1.0, 0.0, 0.0], (S, N, 1)),
        wide,
        bright,
        0.1 * np.arange(S),
        False,
        skew=seen if measured else None,
    )
    walk = np.full((2, S, N), 0.2)
    return by_skew(lit, Own(wide, bright, walk), (own[0], own[1]), thickness, lambda w: THICK / w)


def usual(values: np.ndarray) -> float:
    return float(np.median(values[STEP, MIDDLE]))


def test_what_is_alike_on_both_sides_is_hardly_doubted_however_narrow_it_is():
    assert usual(told(0.0, doubt=1.0, width=0.5).doubt) == pytest.approx(0.15, abs=0.05)
    assert usual(told(0.0, doubt=1.0, width=0.5).part) == pytest.approx(0.15, abs=0.05)
    assert usual(told(0.4, doubt=1.0, width=0.5).doubt) == pytest.approx(1.0)
    between = usual(told(0.15, doubt=1.0, width=0.5).doubt)
    assert 0.25 < between < 0.55, "with the square of the skew"


def test_what_was_put_back_for_nothing_goes_where_it_was_and_keeps_a_part_of_that_as_doubt():
    even, cut = told(0.0, shift=1.0), told(0.5, shift=1.0)
    assert abs(usual(even.shift)) < 0.2
    assert 0.05 < usual(even.doubt) < 0.25
    assert usual(cut.shift) == pytest.approx(1.0)
    assert usual(cut.doubt) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_narrow_stripe_that_is_lopsided_is_put_back_towards_its_sharp_side(sign):
    """0.65 widths times its skew, and half of a width times its skew stays doubted."""
    cut = told(sign * 0.3, width=0.7)
    assert usual(cut.shift) == pytest.approx(sign * 0.65 * 0.3 * 0.7 * WIDE, rel=0.15)
    assert usual(cut.doubt) == pytest.approx(0.5 * 0.3 * 0.7 * WIDE, rel=0.15)
    wide = told(sign * 0.3, width=1.0)
    assert not wide.shift.any(), "what is as wide as is due lies on two surfaces"
    assert usual(wide.doubt) == pytest.approx(0.5 * 0.3 * WIDE, rel=0.15)
    assert usual(told(sign * 0.3, width=1.4).doubt) == pytest.approx(0.2 * 0.3 * 2.8, rel=0.15)
    assert not told(sign * 0.3, width=0.7, thickness=0.0).shift.any(), "nothing says what is due"
    assert usual(told(sign * 0.6, width=0.7).shift) == 0.0, "of how much, the skew no longer tells"


def test_noise_alone_doubts_next_to_nothing():
    even = told(0.0)
    assert np.mean(even.doubt > 0) < 0.02
    assert np.mean(even.shift != 0) < 0.02


def test_near_an_end_and_where_light_is_dim_and_wide_nothing_is_excused():
    assert np.all(told(0.0, doubt=1.0, lines=slice(0, 6)).doubt[STEP, :6] >= 1.0)
    assert np.all(told(0.0, doubt=1.0, width=1.5, light=0.2).doubt[STEP, MIDDLE] >= 1.0)
    assert usual(told(0.0, doubt=1.0, width=0.9, light=0.2).doubt) < 0.3, "narrow and dim: a slope"


def test_a_few_lines_alone_are_known_worse():
    """Speckle skews each; of three it may have hidden a cut."""
    few, many = (
        told(0.0, doubt=1.0, lines=slice(30, 30 + n), noise=0.25).part[STEP, 30:33].mean()
        for n in (3, 17)
    )
    assert few > 1.5 * many


def test_where_nothing_measured_it_all_stays_as_it_was():
    bare = told(0.5, doubt=1.0, shift=0.3, measured=False)
    assert np.all(bare.doubt[STEP, MIDDLE] == 1.0)
    assert np.all(bare.shift[STEP, MIDDLE] == 0.3)
    assert np.all(bare.part == 1.0)
