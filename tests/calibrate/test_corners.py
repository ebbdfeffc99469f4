"""Corners of boards in drawn pictures whose truth is known: no pixel draws them to its middle."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from turnscan.arrays import Floats
from turnscan.calibrate import Charuco, detect_board

BOARD = Charuco(9, 6, 12.0, 9.0, "DICT_5X5_100")
FINE = 8
"""Samples of a drawn pixel in each direction."""


def _print() -> Floats:
    """The board (720, 1080), 10 px for each mm."""
    kind = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_100)
    made = cv2.aruco.CharucoBoard((9, 6), 12.0, 9.0, kind)
    return np.asarray(made.generateImage((1080, 720)), dtype=np.float64)


def _seen(angle: float, blur: float) -> tuple[Floats, Floats]:
    """A picture (360, 480) of the board turned by ``angle`` rad about the vertical, leaning a
    little, and the matrix that takes mm on its print to px."""
    c, s = np.cos(angle), np.sin(angle)
    turned = np.array([[c, 0.02, 0.0], [0.03, 1.0, 0.0], [s, 0.1, 420.0]])
    middle = np.array([[1.0, 0.0, -54.0], [0.0, 1.0, -36.0], [0.0, 0.0, 1.0]])
    camera = np.array([[1136.0, 0.0, 240.3], [0.0, 1136.0, 179.6], [0.0, 0.0, 1.0]])
    H = camera @ turned @ middle
    u, v = np.meshgrid(*((np.arange(n * FINE) + 0.5) / FINE - 0.5 for n in (480, 360)))
    at = np.stack([u.ravel(), v.ravel(), np.ones(u.size)], axis=-1) @ np.linalg.inv(H).T
    x, y = (at[:, :2] / at[:, 2:] * 10).T
    paper = _print()
    inside = (x >= 0) & (x < 1080) & (y >= 0) & (y < 720)
    value = np.full(u.size, 255.0)
    value[inside] = paper[y[inside].astype(int), x[inside].astype(int)]
    fine = value.reshape(360 * FINE, 480 * FINE)
    if blur:
        # The lens blurs what then falls on pixels.
        fine = cv2.GaussianBlur(fine, (0, 0), blur * FINE)
    return fine.reshape(360, FINE, 480, FINE).mean(axis=(1, 3)) * 0.6 + 30.0, H


def _off(picture: Floats, H: Floats) -> tuple[Floats, Floats]:
    """(n, 2) px that the corners are off, and (n, 2) px where they are."""
    view = detect_board(picture.round().clip(0, 255).astype(np.uint8), BOARD)
    assert len(view.ids) >= 20, view.failure
    # The inner corners are counted from the first one, a square into the print.
    at = np.column_stack([BOARD.points[view.ids, :2] + 12.0, np.ones(len(view.ids))]) @ H.T
    true = at[:, :2] / at[:, 2:]
    return view.corners - true, true


@pytest.mark.parametrize("blur", [0.0, 0.5, 0.8])
def test_corners_are_where_the_edges_cross_and_not_in_the_middle_of_pixels(blur: float) -> None:
    """A search by gradients is off by 0.04 to 0.07 px (rms), drawn to pixels by as much."""
    off, true = (
        np.concatenate(some)
        for some in zip(*(_off(*_seen(a, blur)) for a in (-0.9, -0.3, 0.0, 0.5)), strict=True)
    )
    assert np.sqrt(np.mean(off**2)) < 0.006
    assert np.sqrt(np.mean(off**2)) > 0.001, "pictures of whole grey levels cannot do better"
    drawn = 2 * np.mean(off * np.sin(2 * np.pi * true), axis=0)
    assert np.abs(drawn).max() < 0.005


def test_a_colour_filter_does_not_draw_corners_to_its_sites() -> None:
    """The eye's mix of the colours behind a Bayer filter is drawn by 0.06 px, with a period of two
    pixels: what is red is seen at every second one."""
    offs = []
    for angle in (-0.9, -0.3, 0.0, 0.5):
        picture, H = _seen(angle, 0.35)
        raw = np.zeros((360, 480), np.uint8)
        for (y, x), share in (((0, 0), 0.85), ((0, 1), 1.0), ((1, 0), 1.0), ((1, 1), 0.75)):
            raw[y::2, x::2] = (share * picture[y::2, x::2]).round().clip(0, 255)
        offs.append(_off(cv2.cvtColor(raw, cv2.COLOR_BayerBG2RGB), H))
    off, true = (np.concatenate(some) for some in zip(*offs, strict=True))
    assert 0.002 < np.sqrt(np.mean(off**2)) < 0.01
    drawn = 2 * np.mean(off * np.sin(np.pi * true), axis=0)
    assert np.abs(drawn).max() < 0.005


def test_noise_moves_corners_by_no_more_than_it_must() -> None:
    """3 grey levels of noise, edges of 153 of them with a blur of 0.8 px: two edges that are seen
    over 2 · 4 px each say 0.009 px."""
    picture, H = _seen(0.4, 0.8)
    noise = np.random.default_rng(2).normal(0.0, 3.0, picture.shape)
    off, _ = _off(picture + noise, H)
    assert 0.006 < np.sqrt(np.mean(off**2)) < 0.014
