"""Corners that a colour filter draws: by how much is found from boards, and taken back."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.calibrate.drawn import BOARD, places_seen, seen_board
from tests.calibrate.world import World, true_rig
from turnscan.arrays import Floats
from turnscan.calibrate import BoardView, detect_board
from turnscan.calibrate._corners import edge_normals, window_of
from turnscan.calibrate._filter_sites import site_pattern

NOISE = 0.02
"""px of a corner."""


def _leans(view: BoardView) -> tuple[Floats, float]:
    """(n, 2) slopes of the board's edges against columns and rows, and the window, px."""
    places = view.points[:, :2] / view.board.square
    H, _ = cv2.findHomography(places, view.corners, 0)
    normals, near = edge_normals(places, np.asarray(H))
    slopes = np.stack([np.tan(normals), 1 / np.tan(normals)], axis=-1)
    return np.abs(slopes).min(axis=1), window_of(near)


def _drawn(view: BoardView, by: float) -> BoardView:
    """Every edge's pixels are drawn by ``by`` px with a period of two; a corner by the mean of 101
    places along its edge, in the window's bell."""
    lean, sigma = _leans(view)
    along = np.linspace(-3 * sigma, 3 * sigma, 101)
    bell = np.exp(-0.5 * (along / sigma) ** 2)
    bell /= bell.sum()
    at = view.corners[..., None] + lean[..., None] * along
    return replace(view, corners=view.corners + by * np.sin(np.pi * at) @ bell)


def _views(seed: int, count: int) -> list[BoardView]:
    world = World(true_rig(), np.random.default_rng(seed), NOISE)
    return [world.board_view(T, name=f"c{k}") for k, T in enumerate(world.board_poses(count))]


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_the_filter_draws_is_found_and_taken_back(seed: int) -> None:
    plain = _views(seed, 48)
    drawn = [_drawn(v, 0.05) for v in plain]
    pattern = site_pattern(drawn)
    assert pattern is not None
    for axis in (0, 4):
        # Boards are tilted at random: edges that lean little tell 0.005 px.
        assert pattern.amplitudes[axis] == pytest.approx(0.05, abs=0.02)
    others = np.delete(pattern.amplitudes, [0, 4])
    assert np.abs(others).max() < 0.03

    def moved(views: list[BoardView]) -> float:
        off = [v.corners - p.corners for v, p in zip(views, plain, strict=True)]
        return float(np.sqrt(np.mean(np.concatenate(off) ** 2)))

    left = moved([pattern.without(v) for v in drawn])
    assert left < 0.4 * moved(drawn)


@pytest.mark.parametrize("seed", range(6))
def test_corners_that_nothing_draws_stay_to_the_bit(seed: int) -> None:
    assert site_pattern(_views(seed, 16)) is None


def test_behind_a_bayer_filter() -> None:
    """The eye's mix of what is interpolated between sites is drawn by 0.057 px in warm light."""
    views, true = [], []
    for angle in np.linspace(-0.9, 0.9, 9):
        picture, H = seen_board(float(angle), 0.35)
        raw = np.zeros((360, 480), np.uint8)
        for (y, x), share in (((0, 0), 0.85), ((0, 1), 1.0), ((1, 0), 1.0), ((1, 1), 0.75)):
            raw[y::2, x::2] = (share * picture[y::2, x::2]).round().clip(0, 255)
        views.append(detect_board(cv2.cvtColor(raw, cv2.COLOR_BayerBG2RGB), BOARD))
        true.append(places_seen(views[-1], H))
    pattern = site_pattern(views)
    assert pattern is not None

    def rms(some: list[BoardView]) -> float:
        off = [v.corners - at for v, at in zip(some, true, strict=True)]
        return float(np.sqrt(np.mean(np.concatenate(off) ** 2)))

    assert rms(views) > 0.03
    assert 0.003 < rms([pattern.without(v) for v in views]) < 0.012


def test_no_boards_have_no_pattern() -> None:
    assert site_pattern([]) is None
    assert (
        site_pattern([replace(v, corners=v.corners[:6], ids=v.ids[:6]) for v in _views(1, 3)])
        is None
    )
