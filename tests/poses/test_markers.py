"""Marker spheres are found in a surface, and tell where a pose belongs."""

from __future__ import annotations

import numpy as np
import pytest

from tests.poses.scenes import BALLS, STANDS, grid, seen, truth
from turnscan.errors import InputError
from turnscan.poses import from_markers, marker_spheres
from turnscan.rig import Pose, rotation_from_vector

T = Pose(rotation_from_vector([0.4, -1.0, 0.3]), np.array([5.0, -3.0, 2.0]))
SPREAD = np.array([[0.0, 0, 0], [50, 0, 0], [0, 30, 0], [10, 10, 40], [-20, 5, 5]])


@pytest.mark.slow
def test_balls_on_a_part_are_found_in_both_poses_and_bring_them_together():
    views = [seen(n, grid(n, k)) for k, n in enumerate(("marked", "marked lying"))]
    found = [marker_spheres(v, 18.0) for v in views]
    for name, balls in zip(("marked", "marked lying"), found, strict=True):
        # The part's own rounded places may pass for a ball; the balls themselves are there.
        away = np.linalg.norm(balls[:, None] - STANDS[name].apply(BALLS), axis=2)
        assert (away.min(axis=0) < 0.3).sum() >= 3
        assert len(balls) <= 7
    poses = from_markers(["a", "b"], found, 18.0)
    true = truth("marked", "marked lying")
    assert (
        np.linalg.norm(poses[1].apply(views[1].points) - true.apply(views[1].points), axis=1).max()
        < 1.5
    )


def test_balls_that_are_not_seen_by_all_poses_and_a_stray():
    a, b = SPREAD[:4], T.inverse().apply(SPREAD[1:])
    stray = np.concatenate([b, [[200.0, 0, 0]]])
    found = from_markers(["a", "b"], [a, stray], 10.0)
    assert np.allclose(found[1].rotation, T.rotation)
    assert np.allclose(found[1].translation, T.translation)


def test_constellations_that_say_too_little_are_refused():
    with pytest.raises(InputError, match=r"^b: 2 marker spheres seen, and fewer than 3"):
        from_markers(["a", "b"], [SPREAD, SPREAD[:2]], 10.0)
    square = np.array([[0.0, 0, 0], [40, 0, 0], [40, 40, 0], [0, 40, 0]])
    with pytest.raises(InputError, match=r"^b: its 4 marker spheres fit in several ways"):
        from_markers(["a", "b"], [square, T.inverse().apply(square)], 10.0)
    line = np.outer([0.0, 1, 2.5, 4], [10.0, 0, 0])
    with pytest.raises(InputError, match=r"^b: 4 marker spheres seen, and fewer than 3"):
        from_markers(["a", "b"], [line, line], 10.0)
