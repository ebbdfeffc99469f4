"""A stripe that crosses the print of a board: where its light fell, not where it is seen."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter

from turnscan.arrays import Floats, Image
from turnscan.calibrate import BoardView, Chessboard, LaserPicture, stripe_light
from turnscan.calibrate._select import on_board, straighter
from turnscan.rig import Camera, Pose

SHAPE = (140, 160)
FINE = 4
"""Samples of a pixel, each way: squares end inside pixels."""
BLUR = 0.7
"""px: of the lens, which the print's edges and the stripe have alike."""
NOISE = 1.0
"""Grey levels rms."""


def pictures(
    square: float,
    turn: float,
    ink: float,
    width: float,
    seed: int,
    room: float = 90.0,
    light: float = 60.0,
    gain: float = 1.0,
) -> tuple[Image, Image, Floats]:
    """Lit and dark pictures of a chequered plane under a stripe, and its true place (lines,) px."""
    rows, columns = SHAPE
    v, u = (np.mgrid[0 : rows * FINE, 0 : columns * FINE] + 0.5) / FINE - 0.5
    x, y = np.cos(turn) * u + np.sin(turn) * v, np.cos(turn) * v - np.sin(turn) * u
    paper = np.where((np.floor(x / square) + np.floor(y / square)) % 2 > 0, 1.0, ink)
    true = 80.0 + 0.12 * (np.arange(rows) - rows / 2)
    at = 80.0 + 0.12 * (v - rows / 2)
    stripe = light * np.exp(-((u - at) ** 2) / (2 * width**2))
    dice = np.random.default_rng(seed)

    def picture(shone: Floats) -> Image:
        seen = gaussian_filter(gain * paper * shone, BLUR * FINE)
        seen = seen.reshape(rows, FINE, columns, FINE).mean(axis=(1, 3))
        return np.clip(seen + dice.normal(0, NOISE, SHAPE), 0, 255).round().astype(np.uint8)

    return picture(room + stripe), picture(np.full_like(stripe, room)), true


def errors(places: Floats, true: Floats) -> Floats:
    """px of the candidate next to the stripe in each row that has one within 3 px."""
    off = places[:, 0] - np.interp(places[:, 1], np.arange(len(true)), true)
    near = np.abs(off) < 3.0
    return np.asarray(off[near & (places[:, 1] > 10) & (places[:, 1] < len(true) - 10)])


def least(width: float, light: float) -> float:
    """px rms: what the noise of both pictures leaves of a stripe's place at best (Cramér, Rao)."""
    return float(np.sqrt(2) * NOISE * np.sqrt(2 * width / np.sqrt(np.pi)) / light)


@pytest.mark.parametrize("width", [1.5, 3.0])
@pytest.mark.parametrize("turn", [0.05, 0.4, 0.8])
def test_a_stripe_is_where_its_light_fell_on_the_print(turn: float, width: float) -> None:
    """It is seen beside that place by what the print does; after the fit by the noise alone."""
    lit, dark, true = pictures(14.0, turn, 0.2, width, seed=3)
    light = stripe_light(lit, dark)
    assert light.on_print is not None
    seen, fell = errors(light.places, true), errors(light.on_print, true)
    white, black = least(width, 60.0), least(width, 0.2 * 60.0)
    assert np.std(seen) > 1.5 * np.std(fell)
    assert 0.9 * white < np.std(fell) < 2 * black
    assert abs(np.mean(fell)) < 3 * black / np.sqrt(len(fell))
    assert light.widths_on_print is not None
    wide = np.median(light.widths_on_print[np.abs(light.on_print[:, 0] - 80.0) < 20])
    assert abs(wide / np.hypot(width, BLUR) - 1) < 0.05


@settings(max_examples=12, deadline=None)
@given(
    square=st.floats(7.0, 40.0),
    turn=st.floats(0.0, 1.5),
    ink=st.floats(0.08, 1.0),
    width=st.floats(1.0, 5.0),
    seed=st.integers(0, 999),
)
def test_no_print_draws_a_stripe_aside(
    square: float, turn: float, ink: float, width: float, seed: int
) -> None:
    lit, dark, true = pictures(square, turn, ink, width, seed)
    light = stripe_light(lit, dark)
    assert light.on_print is not None
    seen, fell = errors(light.places, true), errors(light.on_print, true)
    assert len(fell) > 60
    noise = least(max(width, BLUR), max(ink, 0.1) * 60.0)
    assert np.sqrt(np.mean(fell**2)) < 1.05 * np.sqrt(np.mean(seen**2)) + noise


def test_a_dark_picture_without_light_says_nothing_of_the_print() -> None:
    lit, dark, _ = pictures(14.0, 0.4, 0.2, 2.0, seed=1, room=0.0)
    light = stripe_light(lit, dark)
    assert len(light.places) > 80
    assert light.on_print is not None
    assert np.array_equal(light.on_print, light.places)


def test_clipped_rows_stay_as_they_were_found() -> None:
    lit, dark, _ = pictures(14.0, 0.4, 0.2, 2.0, seed=1, gain=4.0)
    light = stripe_light(lit, dark)
    assert light.on_print is not None
    changed = np.abs(light.on_print - light.places).max(axis=1) > 0
    row, near = light.places[:, 1].astype(int), light.places[:, 0].astype(int)
    clipped = np.array([lit[v, max(u - 3, 0) : u + 4].max() == 255
                        for v, u in zip(row, near, strict=True)])  # fmt: skip
    assert clipped.any()
    assert (~clipped).any()
    assert not changed[clipped].any()


@pytest.mark.parametrize("orientation", ["vertical", "horizontal"])
def test_lying_stripes_are_found_as_standing_ones(orientation: str) -> None:
    lit, dark, _ = pictures(14.0, 0.4, 0.2, 2.0, seed=5)
    standing = stripe_light(lit, dark)
    lying = stripe_light(lit.T.copy(), dark.T.copy(), orientation="horizontal")
    assert standing.on_print is not None
    assert lying.on_print is not None
    assert np.allclose(standing.on_print, lying.on_print[:, ::-1])


CAMERA, CHESSBOARD = Camera(*SHAPE[::-1], 400.0, 400.0, 79.5, 69.5), Chessboard(9, 8, 14.0)
AHEAD = Pose(np.eye(3), [13.5 - CAMERA.cx, 13.5 - CAMERA.cy, CAMERA.fx])
"""A chessboard straight before the camera, a pixel to the millimetre."""


def taken(places: Floats, on_print: Floats | None) -> Floats:
    """The stripe of a picture with light at these places, found and on the print."""
    view = BoardView(CHESSBOARD, np.zeros((0, 2)), np.zeros(0, np.int32), SHAPE[::-1])
    picture = LaserPicture(view, places, on_print=on_print)
    return straighter(CAMERA, picture, AHEAD, 10.0)[1]


@pytest.mark.parametrize("seed", range(8))
def test_a_stripe_on_print_may_lose_an_end_when_it_is_far_straighter(seed: int) -> None:
    """A stripe as it was found keeps more of the clutter about it: it is longer, not better."""
    rng = np.random.default_rng(seed)
    v = np.arange(5.0, 130.0)
    line = 80.0 + 0.2 * v
    found = np.stack([line + 0.6 * rng.standard_normal(len(v)), v], axis=1)
    fell = np.stack([line + 0.1 * rng.standard_normal(len(v)), v], axis=1)
    gone = fell + np.where(v < 30, 40.0, 0.0)[:, None] * (1.0, 0.0)
    stripe = taken(found, gone)
    assert stripe[:, 1].min() == 30.0
    assert np.std(stripe[:, 0] - 80.0 - 0.2 * stripe[:, 1]) < 0.15
    # Half as uneven, of a quarter of its length, tells less of the line.
    short = np.stack([line + 0.3 * rng.standard_normal(len(v)), v], axis=1)
    short[v > 36, 0] += 1000.0
    assert len(on_board(CAMERA, short, CHESSBOARD, AHEAD, 10.0)) == 32
    assert np.ptp(taken(found, short)[:, 1]) > 100


def test_a_short_stripe_is_found_among_eighteen_times_as_much_clutter() -> None:
    """As on a board seen flat, where noise in the dark is taken for light."""
    lost = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        v = np.arange(45.0, 95.0)
        stripe = np.stack([60.0 + 0.2 * v + 0.3 * rng.standard_normal(len(v)), v], axis=1)
        clutter = rng.uniform((5.0, 5.0), (125.0, 125.0), (900, 2)).round()
        both = np.concatenate([stripe, clutter])
        lines = both[np.argsort(both[:, 1], kind="stable")]
        found = on_board(CAMERA, lines, CHESSBOARD, AHEAD, 10.0)
        off = np.abs(found[:, 0] - 60.0 - 0.2 * found[:, 1])
        if len(found) < 30 or np.median(off) > 1.0:
            lost.append(seed)
    assert len(lost) <= 2, lost


def test_the_straighter_stripe_is_taken() -> None:
    lit, dark, true = pictures(14.0, 0.0, 0.2, 2.0, seed=7)
    light = stripe_light(lit, dark)

    def stripe(on_print: Floats | None) -> Floats:
        return taken(light.places, on_print)

    assert light.on_print is not None
    seen, fell = stripe(None), stripe(light.on_print)
    assert len(fell) > 100
    assert np.std(errors(fell, true)) < 0.7 * np.std(errors(seen, true))
    # As where grey values do not go with the light, and the fit bends what was straight.
    bent = light.on_print + np.array([1.2, 0.0]) * (light.on_print[:, 1:] % 8 > 3)
    assert np.array_equal(stripe(bent), seen)
