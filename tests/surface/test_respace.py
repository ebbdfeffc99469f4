"""Profiles at a spacing of the user's choice: where they lie, what they know, what stays open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from turnscan.errors import InputError, LimitExceeded
from turnscan.points import Between, RangeGrid, goes_round
from turnscan.surface.fusion import respace

RADIUS, NOISE = 30.0, 0.05


def tube(angles: np.ndarray, lines: int = 9, noise: float = 0.0) -> RangeGrid:
    """A tube in the object's frame, scanned at these table angles by a camera that stands still."""
    rng = np.random.default_rng(4)
    out = np.stack([np.cos(angles), -np.sin(angles), 0 * angles], axis=-1)
    r = RADIUS + rng.normal(0, noise, (len(angles), lines)) if noise else RADIUS
    z = np.outer(0.5 * np.arange(lines), [0.0, 0.0, 1.0])
    points = np.broadcast_to(np.asarray(r), (len(angles), lines))[..., None] * out[:, None] + z
    shape = points.shape[:2]
    return RangeGrid(
        "L0", np.arange(len(angles)) + 5, angles, points, np.full(shape, NOISE), np.ones(shape),
        np.zeros(shape, np.uint16), goes_round(angles), 400.0 * out + [0.0, 0.0, 50.0],
    )  # fmt: skip


TURN = np.arange(90) * np.deg2rad(4.0)


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize(
    ("between", "count"),
    [
        (Between(np.deg2rad(2.0), "rad"), 180),
        (Between(np.deg2rad(10.0), "rad"), 36),
        (Between(np.deg2rad(7.0), "rad"), 52),
        (Between(RADIUS * np.deg2rad(5.0), "mm"), 72),
    ],
)
def test_profiles_lie_at_even_angles_on_the_surface(between, count, way) -> None:
    grid = tube(way * TURN)
    out = respace(grid, between)
    assert len(out.steps) == count
    assert out.closed
    assert np.allclose(np.diff(out.angles), way * between.angle(grid))
    assert out.found.all()
    r = np.hypot(out.points[..., 0], out.points[..., 1])
    # A chord lies inside its arc by its sagitta of 0.018 mm; it is made up for, but for a fifth.
    assert np.abs(RADIUS - r).max() < 0.2 * RADIUS * (1 - np.cos(np.deg2rad(2.0)))
    # Even where they are, and seen from where the camera stood then.
    seen = np.arctan2(out.eyes[:, 1], out.eyes[:, 0]) + out.angles
    assert np.abs(np.exp(1j * seen) - 1).max() < 1e-9
    place = np.unwrap(np.arctan2(out.points[:, 0, 1], out.points[:, 0, 0]))
    assert np.abs(place + out.angles).max() < 1e-4 * np.pi


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_an_open_turn_keeps_its_last_profile(way) -> None:
    grid = tube(way * TURN[:41], noise=NOISE)
    for pitch in (3.0, 4.0, 7.0, 100.0):
        out = respace(grid, Between(np.deg2rad(pitch), "rad"))
        assert np.array_equal(out.points[[0, -1]], grid.points[[0, -1]]), pitch
        assert len(out.steps) == int(np.ceil(160 / pitch - 1e-9)) + 1


def test_the_angles_that_were_measured_keep_their_profiles() -> None:
    grid = tube(TURN, noise=NOISE)
    out = respace(grid, Between(np.deg2rad(2.0), "rad"))
    assert np.array_equal(out.points[::2], grid.points)
    assert np.array_equal(out.sigma[::2], grid.sigma)


def test_sigma_is_that_of_the_noise_it_has() -> None:
    """The middle of two points has 1/√2 of their noise, and says so where nothing bends."""
    grid = tube(np.arange(1440) * np.deg2rad(0.25), noise=NOISE)
    out = respace(grid, Between(np.deg2rad(0.125), "rad"))
    off = np.hypot(out.points[1::2, :, 0], out.points[1::2, :, 1]) - RADIUS
    assert out.sigma[1::2].min() == pytest.approx(NOISE / np.sqrt(2))
    assert np.median(out.sigma[1::2]) < 1.05 * NOISE / np.sqrt(2)
    assert off.std() == pytest.approx(NOISE / np.sqrt(2), rel=0.04)
    half = replace(grid, noise=np.full(grid.sigma.shape, NOISE / 2, np.float32))
    out = respace(half, Between(np.deg2rad(0.125), "rad"))
    assert out.noise[1::2] == pytest.approx(NOISE / 2 / np.sqrt(2))
    assert out.sigma[1::2].min() == pytest.approx(NOISE * np.sqrt(1 / 8 + 3 / 4)), "common"


def prism(steps: int, noise: float, seed: int) -> RangeGrid:
    """A hexagonal prism, 40 mm across its flats, in so many steps."""
    grid = tube(np.arange(steps) * (2 * np.pi / steps), lines=60)
    direction = grid.points[..., :2] / RADIUS
    wanted = np.arctan2(direction[..., 1], direction[..., 0])
    radius = 20.0 / np.cos((wanted + np.pi / 6) % (np.pi / 3) - np.pi / 6)
    radius += np.random.default_rng(seed).normal(0, noise, radius.shape)
    points = np.concatenate([radius[..., None] * direction, grid.points[..., 2:]], axis=-1)
    return replace(grid, points=points)


def off_prism(points: np.ndarray) -> np.ndarray:
    """mm of points from the nearest face, inside below 0."""
    at = np.arange(6) * (np.pi / 3)
    return (points[..., 0, None] * np.cos(at) + points[..., 1, None] * np.sin(at)).max(-1) - 20.0


@pytest.mark.parametrize("steps", [25, 40, 70])
@pytest.mark.parametrize("pitch", [0.5, 2.0, 7.0])
def test_points_between_profiles_say_how_far_an_edge_may_stand_off(steps, pitch) -> None:
    """Chords cut edges off by up to 1.5 mm; each of their points had stated 0.05 and less."""
    grid = prism(steps, NOISE, seed=steps)
    out = respace(grid, Between(np.deg2rad(pitch), "rad"))
    off = np.abs(off_prism(out.points))
    within = off / out.sigma
    assert off.max() > 6 * NOISE, "there are edges between profiles"
    assert (within > 3).mean() < 0.005
    assert (within > 6).sum() == 0
    # The chords beside one that cuts an edge off are doubted as well: most, in coarse steps.
    assert 0.5 < np.sqrt((within**2).mean()) < 1.2
    if steps == 70:
        assert 0.6 * NOISE < np.median(out.sigma) < 1.2 * NOISE, "on the flats as its points are"


def test_gaps_and_jumps_stay_open() -> None:
    grid = tube(TURN)
    points, flags = grid.points.copy(), grid.flags.copy()
    points[10, 3] = np.nan
    flags[10, 3] = 4
    points[40:, 5:, :2] *= 2.0
    holed = replace(grid, points=points, flags=flags)
    out = respace(holed, Between(np.deg2rad(1.0), "rad"))
    assert np.isnan(out.points[37:44, 3, 0]).all()
    assert (out.flags[38:44, 3] == 4).all()
    assert out.found[36, 3]
    assert out.found[44, 3]
    r = np.hypot(out.points[..., 0], out.points[..., 1])[out.found]
    assert (np.minimum(np.abs(r - 30), np.abs(r - 60)) < 0.1).all(), "nothing between the two"


@pytest.mark.parametrize("step", [2.0, 4.0, 6.0])
def test_a_handle_beside_a_body_is_not_tied_to_it(step: float) -> None:
    """Ten millimetres in front of what the next profile shows, a few steps wide."""
    grid = tube(np.arange(int(360 / step)) * np.deg2rad(step), lines=40)
    points = grid.points.copy()
    points[10:14, :, :2] *= (RADIUS + 10.0) / RADIUS
    out = respace(replace(grid, points=points), Between(np.deg2rad(step / 4), "rad"))
    r = np.hypot(out.points[..., 0], out.points[..., 1])[out.found]
    assert (np.minimum(np.abs(r - RADIUS), np.abs(r - RADIUS - 10)) < 0.1).all()
    assert np.isnan(out.points[37:40, 5:-5, 0]).all(), "before the handle"


@settings(max_examples=50)
@given(
    pitch=st.floats(0.5, 30.0),
    missing=st.floats(0.0, 0.9),
    part=st.integers(2, 90),
    seed=st.integers(0, 99),
)
def test_any_spacing_of_any_part_of_a_turn_gives_a_sound_grid(pitch, missing, part, seed) -> None:
    grid = tube(TURN[:part])
    gone = np.random.default_rng(seed).random(grid.flags.shape) < missing
    grid = replace(grid, points=np.where(gone[..., None], np.nan, grid.points))
    out = respace(grid, Between(np.deg2rad(pitch), "rad"))
    r = np.hypot(out.points[..., 0], out.points[..., 1])[out.found]
    assert (np.abs(r - RADIUS) < 0.1).all()
    assert np.array_equal(out.found, ~np.isnan(out.sigma))
    if grid.found.any():
        assert abs(out.angles[-1] - out.angles[0]) <= (2 * np.pi if grid.closed else TURN[part - 1])


def test_spacings_that_cannot_be_are_refused() -> None:
    with pytest.raises(InputError, match="between profiles"):
        Between(0.0, "mm")
    with pytest.raises(LimitExceeded, match="profiles"):
        respace(tube(TURN), Between(1e-5, "rad"))
    with pytest.raises(InputError, match="not monotonic"):
        respace(tube(np.array([0.0, 0.2, 0.1])), Between(0.1, "rad"))


def test_a_surface_of_the_first_and_the_last_profile_alone_spans_the_seam() -> None:
    """What the sheet meets beyond the axis there is tied to nothing in front of it."""
    grid = tube(TURN)
    points, behind = grid.points.copy(), np.zeros(grid.found.shape, dtype=np.bool_)
    points[[0, -1], :, :2] *= -0.6
    behind[[0, -1]] = True
    out = respace(replace(grid, points=points, behind=behind), Between(np.deg2rad(1.0), "rad"))
    r = np.hypot(out.points[..., 0], out.points[..., 1])
    assert np.isnan(r[1:4]).all(), "from beyond the axis to before it"
    assert r[-3:] == pytest.approx(0.6 * RADIUS, abs=0.02), "from the last profile to the first"
    assert np.isnan(out.sigma[~out.found]).all()
    assert (out.flags[~out.found] != 0).all()
