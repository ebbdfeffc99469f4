"""Corners of boards in drawn pictures whose truth is known: no pixel draws them to its middle."""

from __future__ import annotations

import numpy as np
import pytest

from tests.calibrate.drawn import BOARD, places_seen, seen_board
from turnscan.arrays import Floats
from turnscan.calibrate import detect_board


def _off(picture: Floats, H: Floats) -> tuple[Floats, Floats]:
    """(n, 2) px that the corners are off, and (n, 2) px where they are."""
    view = detect_board(picture.round().clip(0, 255).astype(np.uint8), BOARD)
    assert len(view.ids) >= 20, view.failure
    true = places_seen(view, H)
    return view.corners - true, true


@pytest.mark.parametrize("blur", [0.0, 0.5, 0.8])
def test_corners_are_where_the_edges_cross_and_not_in_the_middle_of_pixels(blur: float) -> None:
    """A search by gradients is off by 0.04 to 0.07 px (rms), drawn to pixels by as much."""
    off, true = (
        np.concatenate(some)
        for some in zip(*(_off(*seen_board(a, blur)) for a in (-0.9, -0.3, 0.0, 0.5)), strict=True)
    )
    assert np.sqrt(np.mean(off**2)) < 0.006
    assert np.sqrt(np.mean(off**2)) > 0.001, "pictures of whole grey levels cannot do better"
    drawn = 2 * np.mean(off * np.sin(2 * np.pi * true), axis=0)
    assert np.abs(drawn).max() < 0.005


def test_noise_moves_corners_by_no_more_than_it_must() -> None:
    """3 grey levels of noise, edges of 153 of them with a blur of 0.8 px: two edges that are seen
    over 2 · 4 px each say 0.009 px."""
    picture, H = seen_board(0.4, 0.8)
    noise = np.random.default_rng(2).normal(0.0, 3.0, picture.shape)
    off, _ = _off(picture + noise, H)
    assert 0.006 < np.sqrt(np.mean(off**2)) < 0.014
