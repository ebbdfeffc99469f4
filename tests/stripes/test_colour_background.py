"""Colour and background."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.stripes.pictures import light
from turnscan.errors import InputError
from turnscan.stripes import (
    Candidates,
    StripeSettings,
    background_beside,
    detect,
    find_candidates,
    learn_colour,
    project_colour,
    temporal_background,
    without_lines,
)


def coloured(colour: tuple[float, float, float], peak: float = 150.0, seed: int = 0) -> Any:
    """Lit and dark (H, W, 3) of a stripe of this colour on a grey, textured wall."""
    rng = np.random.default_rng(seed)
    rows, width = 150, 200
    centre = 100 + 15 * np.sin(np.arange(rows) / 40)
    wall = 60 + 40.0 * (np.add.outer(np.arange(rows) // 25, np.arange(width) // 25) % 2)
    stripe = light(centre, 1.8, peak, width)
    shown = []
    for lamp in (1.0, 0.0):
        grey = np.repeat(wall[:, :, None], 3, axis=2) + lamp * stripe[:, :, None] * colour
        shown.append(np.clip(grey + rng.normal(0, 2, grey.shape), 0, 255).round().astype(np.uint8))
    return shown[0], shown[1], centre


@pytest.mark.parametrize(
    "colour", [(1.0, 0.1, 0.1), (0.15, 1.0, 0.2), (0.1, 0.2, 1.0), (0.7, 0.7, 0.1)]
)
def test_the_learned_colour_beats_plain_grey(colour: tuple[float, float, float]) -> None:
    lit, dark, centre = coloured(colour, peak=60.0)
    weights = learn_colour(lit, dark)
    assert weights[weights > 0].sum() == pytest.approx(1.0)
    assert (weights >= 0).all()
    assert int(np.argmax(weights)) in np.flatnonzero(np.array(colour) > 0.6)
    learned = detect(project_colour(lit, weights), project_colour(dark, weights))
    grey = detect(project_colour(lit, "grey"), project_colour(dark, "grey"))
    assert learned.found.mean() > 0.99
    e_learned = np.nanstd(learned.position - centre)
    e_grey = np.nanstd(grey.position - centre) if grey.found.sum() > 20 else np.inf
    assert e_learned < e_grey


@pytest.mark.parametrize("colour", [(1.0, 0.05, 0.05), (0.05, 1.0, 0.2)])
def test_without_a_laser_off_picture_the_grey_is_taken_away(
    colour: tuple[float, float, float],
) -> None:
    lit, _, centre = coloured(colour, peak=100.0)
    weights = learn_colour(lit)
    assert int(np.argmax(weights)) == int(np.argmax(colour))
    assert abs(weights.sum()) < 0.25  # grey, weighed, nearly vanishes
    stripe = detect(project_colour(lit, weights, np.uint16))
    assert stripe.found.mean() > 0.95
    assert np.nanmedian(np.abs(stripe.position - centre)) < 0.1


def test_a_clipped_channel_counts_less() -> None:
    lit, dark, _ = coloured((1.0, 0.3, 0.02), peak=500.0)
    assert (lit[:, :, 0] == 255).any(axis=1).all()
    weights = learn_colour(lit, dark)
    assert weights[1] > weights[0]


def test_projection_by_name_and_by_weights() -> None:
    rgb = np.arange(24, dtype=np.uint8).reshape(2, 4, 3) * 10
    np.testing.assert_array_equal(project_colour(rgb, "green"), rgb[:, :, 1])
    wide = project_colour(rgb, "green", np.uint16)
    np.testing.assert_array_equal(wide, project_colour(rgb, (0.0, 2.0, 0.0), np.uint16))
    np.testing.assert_array_equal(
        project_colour(rgb, (0.5, 0.5, 0.0), np.uint16),
        (rgb[:, :, :2].astype(int).sum(axis=2) * 32).astype(np.uint16),
    )
    white = np.full((1, 1, 3), 255, np.uint8)
    black = np.zeros((1, 1, 3), np.uint8)
    weights = (1.0, -0.5, -0.5)
    assert project_colour(white, weights)[0, 0] == project_colour(black, weights)[0, 0] == 128
    red = np.array([[[255, 0, 0]]], np.uint8)
    cyan = np.array([[[0, 255, 255]]], np.uint8)
    assert project_colour(red, weights)[0, 0] == 255
    assert project_colour(cyan, weights)[0, 0] == 0


def test_colours_that_cannot_be_used_are_refused() -> None:
    rgb = np.zeros((30, 30, 3), np.uint8)
    with pytest.raises(InputError, match="no laser line"):
        learn_colour(rgb, rgb)
    with pytest.raises(InputError, match="infrared"):
        project_colour(rgb, "infrared")
    with pytest.raises(InputError, match="weights"):
        project_colour(rgb, (0.0, 0.0, -1.0))
    with pytest.raises(InputError, match="colour picture"):
        learn_colour(np.zeros((30, 30), np.uint8))
    with pytest.raises(InputError, match="laser off"):
        learn_colour(rgb, np.zeros((30, 31, 3), np.uint8))


def test_the_median_keeps_the_wall_and_forgets_the_moving_stripe() -> None:
    rng = np.random.default_rng(1)
    wall = np.tile(40 + 30 * (np.arange(120) // 20 % 2), (50, 1)).astype(float)
    still = light(np.full(50, 20.0), 1.5, 120.0, 120)  # a laser line on the wall
    frames, centres = [], []
    for k in range(40):
        centre = np.full(50, 70 + 25 * np.sin(k / 3))
        centres.append(centre)
        seen = wall + still + light(centre, 1.5, 120.0, 120) + rng.normal(0, 1.5, wall.shape)
        frames.append(seen.round().astype(np.uint8))
    background = temporal_background(np.array(frames))
    assert background.dtype == np.uint8
    assert np.abs(background - (wall + still)).mean() < 1.0
    for k in (0, 7, 21):
        stripe = detect(frames[k], background)
        np.testing.assert_allclose(stripe.position, centres[k], atol=0.3)


def room(k: int, colour: bool, shape: tuple[int, int] = (48, 480)) -> np.ndarray:
    """A bright wall, and before it a dark part that covers more of it or less, at most 15 %."""
    u = np.arange(shape[1])
    level = np.where(np.abs(u - 150) < 22 + 15 * np.sin(k / 5), 6.0, 60.0)
    grey = np.tile(level, (shape[0], 1))
    return grey[..., None] * (1.0, 0.9, 0.9) if colour else grey


@pytest.mark.parametrize("colour", [False, True])
@pytest.mark.parametrize("orientation", ["vertical", "horizontal"])
def test_a_dark_part_before_a_bright_wall(colour: bool, orientation: str) -> None:
    """The stripe hardly moves on the part. The wall behind it must not be taken for laser light.

    The median of all would take the stripe away, the darkest of all leaves the wall where the part
    has passed.
    """
    rng = np.random.default_rng(3)
    frames, truth = [], []
    for k in range(40):
        centre = 150 + 2.0 * np.sin(k / 5) + np.zeros(48)
        line = light(centre, 1.5, 120.0, 480)
        seen = room(k, colour) + (line[..., None] * (0.3, 1.0, 0.3) if colour else line)
        seen += rng.normal(0, 1.0, seen.shape)
        frame = seen.round().clip(0, 255).astype(np.uint8)
        frames.append(np.swapaxes(frame, 0, 1) if orientation == "horizontal" else frame)
        truth.append(centre)
    opened = [without_lines(f, orientation) for f in frames]
    grey = frames if not colour else [project_colour(f, "green") for f in frames]
    under = opened if not colour else [project_colour(f, "green") for f in opened]
    settings = StripeSettings(orientation=orientation, max_candidates=5)
    seen = [find_candidates(a, b, settings) for a, b in zip(grey, under, strict=True)]
    background = background_beside(frames, seen)
    assert background.dtype == np.uint8
    assert background.shape == frames[0].shape
    laid = np.swapaxes(background, 0, 1) if orientation == "horizontal" else background
    # Away from the stripe: the wall, up to the rounding and the median of 40 pictures' noise.
    wall = room(0, colour)[:, :80]
    assert np.abs(laid[:, :80] - wall).max() < 2.0
    # Under the stripe, from its both sides; nothing of its 120 grey levels.
    assert laid[:, 140:160].max() < 62
    dark = background if not colour else project_colour(background, "green")
    for k in (0, 8, 24):
        stripe = detect(grey[k], dark, settings)
        np.testing.assert_allclose(stripe.position, truth[k], atol=0.3)
        assert np.isfinite(stripe.position).all()


def test_lines_that_are_all_stripe_take_the_darkest() -> None:
    frames = np.full((5, 4, 30), 50, np.uint8)
    frames[2, 1] = 20
    everywhere = [
        Candidates(*np.full((4, 4, 1), v), np.zeros((4, 1), np.uint16)) for v in (15.0,) * 5
    ]
    assert (background_beside(frames, everywhere) == frames.min(axis=0)).all()


def test_what_a_background_refuses() -> None:
    frames = np.arange(5, dtype=np.uint16)[:, None, None] * np.ones((5, 2, 3), np.uint16)
    assert (temporal_background(frames) == 2).all()
    assert (temporal_background(frames, 0.25) == 1).all()
    with pytest.raises(InputError, match="3 pictures"):
        temporal_background(frames[:2])
    with pytest.raises(InputError, match="quantile"):
        temporal_background(frames, 1.5)
    with pytest.raises(InputError, match="picture 1"):
        temporal_background([frames[0], frames[1][:1], frames[2]])
