"""The nearest point by cubes, and the compiled way of a trial, against plain ways to the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.poses.scenes import wavy
from turnscan.poses._near import cubes_of
from turnscan.poses._refine import approach, refine
from turnscan.poses._view import thinned
from turnscan.rig import Pose, rotation_from_vector


@pytest.mark.parametrize(("count", "spacing"), [(1, 0.7), (2, 0.7), (60, 0.7), (6000, 2.0)])
def test_the_nearest_point_is_that_of_a_tree(count, spacing):
    """On a ball, near it, far from it and outside of the box, at short and at long reach."""
    from scipy.spatial import cKDTree

    from turnscan.poses import _near_kernels as kernels

    draw = np.random.default_rng(count)
    points = draw.normal(size=(count, 3))
    points *= 80 / np.linalg.norm(points, axis=1, keepdims=True)
    beside = points[draw.integers(count, size=300)] + draw.normal(size=(300, 3)) * 2
    places = np.concatenate([points, beside, draw.normal(size=(300, 3)) * 150])
    tree, cubes = cKDTree(points), cubes_of(points, spacing)
    for reach in (0.5, 3.0, 8.0, 400.0):
        away, at = tree.query(places, distance_upper_bound=reach)
        mine, number = kernels.nearest(cubes, places, reach)
        met = np.isfinite(away)
        np.testing.assert_array_equal(np.isfinite(mine), met)
        np.testing.assert_allclose(mine[met], away[met], rtol=1e-9, atol=1e-12)
        np.testing.assert_array_equal(number[met], at[met])
        assert (number[~met] == -1).all()
        assert met.any()


def test_points_in_a_plane_of_the_axes_are_found():
    """The box round them has no thickness."""
    x, y = (a.ravel() for a in np.meshgrid(np.arange(10.0), np.arange(10.0)))
    flat = replace(
        wavy(1), points=np.stack([x, y, 0 * x], -1), normals=np.tile([0.0, 0, 1], (100, 1)),
        sigma=np.full(100, 0.01), eyes=np.zeros((100, 3)), inner=np.ones(100, bool), spacing=1.0,
    )  # fmt: skip
    away, at = flat.nearest(np.array([[3.1, 4.0, -2.0], [20.0, 4.0, 0.0]]), 5.0)
    assert away[0] == pytest.approx(np.hypot(0.1, 2.0))
    assert flat.points[at[0]].tolist() == [3.0, 4.0, 0.0]
    assert np.isinf(away[1])


@pytest.mark.parametrize("rounds", [1, 4, 40])
@pytest.mark.parametrize("thin", [False, True])
def test_a_trial_ends_where_the_general_refinement_does(rounds, thin):
    """Rounds, lengths of links and weights are the same; only sums differ, by their order."""
    other, mine = wavy(1), wavy(2)
    other = thinned(other, 1.2) if thin else other
    start = Pose(rotation_from_vector(np.array([0.05, -0.04, 0.06])), np.array([0.4, -0.3, 0.35]))
    some = np.arange(0, len(mine.points), 4, dtype=np.int32)
    reach, still = (2.5, 0.8), 1e-7
    asked = {(1, 0): some}
    wanted = refine([other, mine], [Pose(), start], asked, reach, rounds=rounds, still=still)[1]
    found = approach(mine, other, start, some, reach, rounds, still)
    assert np.abs(found.apply(mine.points) - wanted.apply(mine.points)).max() < 1e-8
    moved = np.abs(found.apply(mine.points) - start.apply(mine.points)).max()
    assert moved > 0.1
    if rounds == 40:
        assert np.abs(found.translation).max() < 0.03
        assert np.abs(found.rotation - np.eye(3)).max() < 0.01


def test_a_trial_that_meets_nothing_stays_where_it_is():
    away = Pose(np.eye(3), np.array([0.0, 0.0, 50.0]))
    some = np.arange(0, 1600, 4, dtype=np.int32)
    found = approach(wavy(2), wavy(1), away, some, (2.5, 0.8), 10, 1e-6)
    np.testing.assert_array_equal(found.translation, away.translation)
    np.testing.assert_array_equal(found.rotation, away.rotation)
