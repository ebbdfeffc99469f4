"""An edge cuts the stripes beside each other alike: none of them is doubted much less."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from turnscan.arrays import Floats
from turnscan.points._build import _doubted_alike

NOISE = 0.1
"""mm."""


def raised(doubt: Floats, near: bool = False, closed: bool = False) -> Floats:
    sigma = np.hypot(NOISE, doubt)
    return _doubted_alike(sigma, doubt, np.full(doubt.shape, near), closed)


@pytest.mark.parametrize("seed", range(10))
def test_a_profile_along_an_edge_is_doubted_as_most_of_its_points(seed: int) -> None:
    """As at the mouth of a keyway: light of the rim, each line by its width doubted differently."""
    doubt = np.zeros((5, 120))
    doubt[2] = np.random.default_rng(seed).uniform(0.2, 0.8, 120)
    sigma = raised(doubt)
    assert np.quantile(sigma[2], 0.02) > 0.35
    beside = [0, 1, 3, 4]
    assert np.array_equal(sigma[beside], np.full((4, 120), NOISE)), "other profiles are not"
    high = doubt[2] > 0.75
    assert np.array_equal(sigma[2, high], np.hypot(NOISE, doubt[2, high])), "what is more is kept"


def test_single_doubts_and_a_short_edge_across_profiles_spread_to_nothing() -> None:
    doubt = np.zeros((9, 60))
    doubt[4, 30] = 1.0
    doubt[:, 10:18] = 0.5  # an edge across the profiles: few lines of each
    assert np.array_equal(raised(doubt), np.hypot(NOISE, doubt))


@pytest.mark.parametrize("closed", [False, True])
def test_a_profile_between_two_doubted_ones_is_doubted_as_the_lesser(closed: bool) -> None:
    doubt = np.zeros((6, 40))
    doubt[[1, 3, 5], 5] = 0.6, 0.4, 0.7
    sigma = raised(doubt, near=True, closed=closed)
    assert sigma[2, 5] == 0.4
    assert sigma[0, 5] == (0.6 if closed else NOISE)
    assert np.array_equal(raised(doubt, near=False, closed=closed), np.hypot(NOISE, doubt))


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("width", [1, 2, 3])
def test_two_profiles_of_a_narrow_face_are_doubted_as_its_edges(width: int, closed: bool) -> None:
    """As on the wall of a slot in a sheet that is hardly thicker than the light, of which the
    profiles at its edges alone show that they are cut. Of three none is: they are too far apart."""
    doubt = np.zeros((9, 40))
    doubt[[2, 3 + width], 5] = 0.4, 0.6
    face = raised(doubt, near=True, closed=closed)[3 : 3 + width, 5]
    assert face == pytest.approx([0.4] * width if width < 3 else [NOISE] * 3)
    beyond = np.delete(raised(doubt, near=True, closed=closed), np.s_[2 : 4 + width], axis=0)
    assert (beyond == NOISE).all(), "on the faces beside it"


def test_where_the_next_profile_is_missing_none_further_off_says_anything() -> None:
    doubt = np.zeros((7, 40))
    doubt[[1, 5], 5] = 0.6
    doubt[2, 5] = np.nan
    assert raised(doubt, near=True)[3, 5] == NOISE


@given(
    hnp.arrays(np.float64, (4, 30), elements=st.floats(0.0, 2.0)),
    hnp.arrays(np.bool_, (4, 30)),
    st.booleans(),
)
def test_no_claim_shrinks_none_exceeds_the_largest_and_gaps_stay(
    doubt: Floats, gone: Floats, near: bool
) -> None:
    doubt = np.where(gone, np.nan, doubt)
    before, after = np.hypot(NOISE, doubt), raised(doubt, near)
    assert np.array_equal(np.isnan(after), np.isnan(before))
    have = ~np.isnan(before)
    assert (after[have] >= before[have]).all()
    if have.any():
        assert after[have].max() <= before[have].max()
