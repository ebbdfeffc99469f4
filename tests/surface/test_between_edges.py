"""Points of a narrow face between two edges that run along it: what moves one moves all of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.surface.grids import turned
from turnscan.points import RangeGrid
from turnscan.surface.fusion import range_surfaces

STEPS, LINES, SIGMA = 40, 60, 0.1
TURN = np.arange(STEPS) * 2 * np.pi / STEPS


def grid(doubted: list[int], lines: slice = slice(None), angles: np.ndarray = TURN) -> RangeGrid:
    """A cylinder, of whose points on these profiles a quarter of the variance is noise."""
    made: RangeGrid = turned(angles, np.full(LINES, 20.0), sigma=SIGMA)
    noise = np.full(made.flags.shape, SIGMA, np.float32)
    noise[doubted, lines] = 0.5 * SIGMA
    return replace(made, noise=noise)


def random(of: RangeGrid) -> np.ndarray:
    """(steps, lines) what `RangeSurface.random` says of each point."""
    (surface,) = range_surfaces(of)
    p, out = surface.mesh.provenance, np.full(of.flags.shape, np.nan)
    assert p is not None
    assert surface.random is not None
    out[p.step, p.line] = surface.random
    return out


@pytest.mark.parametrize("width", [1, 2])
def test_a_face_of_one_or_two_profiles_errs_alike(width: int) -> None:
    told = random(grid([10, 10 + width + 1]))
    np.testing.assert_allclose(told[10 : 10 + width + 2], 0.25)
    np.testing.assert_allclose(np.delete(told, range(10, 10 + width + 2), axis=0), 1.0)


def test_of_three_profiles_the_middle_one_does_and_of_four_none() -> None:
    np.testing.assert_allclose(
        random(grid([10, 14]))[11:14].T, np.tile([1.0, 0.25, 1.0], (LINES, 1))
    )
    np.testing.assert_allclose(random(grid([10, 15]))[11:15], 1.0)


@pytest.mark.parametrize(("thickness", "least"), [(0.7, 1.0), (0.9, 0.25)])
def test_light_of_a_thin_sheet_reaches_over_no_edge(thickness: float, least: float) -> None:
    """The profiles are 3.1 mm apart."""
    told = random(replace(grid([10, 12]), thickness=thickness))
    np.testing.assert_allclose(told[11], least)


def test_beside_one_edge_alone_noise_averages_out() -> None:
    told = random(grid([10]))
    np.testing.assert_allclose(np.delete(told, 10, axis=0), 1.0)


def test_doubts_of_a_few_lines_are_no_edge_along_the_profile() -> None:
    """What is doubted here and there is each point's own."""
    few = random(grid([10, 12], slice(20, 30)))
    np.testing.assert_allclose(few[11], 1.0)
    many = random(grid([10, 12], slice(20, 50)))
    np.testing.assert_allclose(many[11, 26:44], 0.25)


def test_the_first_profile_is_beside_the_last_where_the_turn_is_closed() -> None:
    np.testing.assert_allclose(random(grid([1, STEPS - 1]))[0], 0.25)
    half = random(grid([1, STEPS - 1], angles=TURN / 2))
    np.testing.assert_allclose(half[0], 1.0)
    np.testing.assert_allclose(half[STEPS - 2], 1.0)


def test_missing_points_are_no_edge() -> None:
    made = grid([10, 12])
    points = made.points.copy()
    points[12] = np.nan
    np.testing.assert_allclose(random(replace(made, points=points))[11], 1.0)


def test_lines_of_the_sensor_on_which_nothing_is_seen_change_nothing() -> None:
    made = grid([10, 12], np.s_[:30])
    wide = np.full((STEPS, 3 * LINES, 3), np.nan)
    wide[:, LINES : 2 * LINES] = made.points
    more = {
        name: np.pad(getattr(made, name), ((0, 0), (LINES, LINES)), constant_values=empty)
        for name, empty in (
            ("sigma", np.nan),
            ("noise", np.nan),
            ("amplitude", np.nan),
            ("flags", 1),
        )
    }
    seen = random(replace(made, points=wide, **more))[:, LINES : 2 * LINES]
    np.testing.assert_array_equal(seen, random(made))
    assert (seen[11, :20] < 1.0).all()
    assert (seen[11, 45:] == 1.0).all()
