"""What live pictures and a calibration in the making say."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from turnscan.calibrate import Charuco, Chessboard
from turnscan.errors import InputError
from turnscan.workflows import picture_quality, seen_stripe
from turnscan.workflows._calibration._live_calibration import printed_board

BOARD = Charuco(9, 6, 24.0, 18.0, "DICT_5X5_100")


@given(st.floats(95.1, 104.9), st.floats(-0.2, 0.2))
def test_a_board_is_as_large_as_its_rulers_say(ruler: float, apart: float) -> None:
    printed = printed_board(BOARD, (ruler + apart / 2, ruler - apart / 2))
    assert printed.square == pytest.approx(24.0 * ruler / 100)
    assert isinstance(printed, Charuco)
    assert printed.marker / printed.square == pytest.approx(18 / 24)
    assert printed_board(Chessboard(8, 6, 20.0), (ruler, ruler)).square == pytest.approx(ruler / 5)


@pytest.mark.parametrize("rulers", [(100.0, 99.4), (94.0, 94.0), (106.0, 106.0)])
def test_a_print_that_does_not_fit_is_refused(rulers: tuple[float, float]) -> None:
    with pytest.raises(InputError, match=f"{rulers[0]:g}"):
        printed_board(BOARD, rulers)


def test_focus_is_told_by_the_sharper_picture_whatever_its_exposure() -> None:
    rng = np.random.default_rng(3)
    sharp = rng.uniform(20, 120, (60, 80)).astype(np.uint8)
    soft = cv2.GaussianBlur(sharp, (0, 0), 1.5)
    ratio = picture_quality(sharp).sharpness / picture_quality(soft).sharpness
    assert ratio > 5
    brighter = picture_quality((2 * sharp.astype(int)).astype(np.uint8)).sharpness
    assert brighter == pytest.approx(picture_quality(sharp).sharpness, rel=0.05)


@pytest.mark.parametrize(("kind", "top"), [(np.uint8, 255), (np.uint16, 65535)])
def test_clipped_pixels_are_counted_in_the_last_bin(kind: type, top: int) -> None:
    picture = np.zeros((10, 10, 3), kind)
    picture[:2, :, 1] = top
    seen = picture_quality(picture)
    assert seen.clipped == pytest.approx(0.2)
    assert seen.histogram[0] == 80
    assert seen.histogram[-1] == 20
    assert seen.histogram.sum() == 100


def test_width_and_signal_of_a_stripe_are_those_of_its_light() -> None:
    u = np.arange(120)
    line = 150 * np.exp(-((u - 60.3) ** 2) / (2 * 1.8**2))
    seen = seen_stripe(np.tile(10 + line, (40, 1)).round().astype(np.uint8), None)
    there = ~np.isnan(seen.position)
    assert there.mean() > 0.9
    assert np.abs(seen.width[there] - 1.8).max() < 0.3
    assert np.abs(seen.signal[there] - 150).max() < 15
