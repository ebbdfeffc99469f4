"""Links between two views, and what they add to the normal equations."""

from __future__ import annotations

import numpy as np
import pytest

from tests.poses.scenes import wavy
from turnscan.poses._links import Links, link, rows
from turnscan.poses._refine import all_links, both_ways, equations, middles_of, near_ones
from turnscan.poses._view import View, thinned
from turnscan.rig import Pose, rotation_from_vector


@pytest.fixture(scope="module")
def two() -> tuple[list[View], list[Pose]]:
    moved = Pose(rotation_from_vector(np.array([0.01, -0.02, 0.015])), np.array([0.1, 0.05, 0.03]))
    return [wavy(1), wavy(2)], [Pose(), moved]


def test_a_link_joins_a_point_to_the_nearest_inner_one_that_faces_the_same_way(two):
    (a, b), poses = two
    some = np.arange(0, len(a.points), 7, dtype=np.int32)
    found, which = link([a, b], poses, 0, 1, some, 1.0)
    assert len(which) > 150
    there = poses[1].apply(b.points)
    for k, s in enumerate(some[which]):
        nearest = int(np.argmin(np.linalg.norm(there - a.points[s], axis=1)))
        assert b.inner[nearest]
        np.testing.assert_allclose(found.q[k], there[nearest], atol=1e-12)
        np.testing.assert_allclose(found.p[k], a.points[s], atol=1e-12)
        np.testing.assert_allclose(found.n_q[k], poses[1].turn(b.normals[nearest]), atol=1e-12)
        assert found.sigma[k] == pytest.approx(np.hypot(a.sigma[s], b.sigma[nearest]))
    over = Pose(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
    assert not len(link([a, b], [Pose(), over], 0, 1, some, 1.0)[1])


def test_the_sums_are_those_of_weighted_least_squares(two):
    """Against the rows of the equations written out, and the motion itself."""
    views, poses = two
    samples = [np.arange(0, len(v.points), 5, dtype=np.int32) for v in views]
    links = all_links(views, poses, both_ways(samples), 1.0)
    middles = middles_of(views, poses)
    e = equations(links, middles)
    H, g, motion = np.zeros((12, 12)), np.zeros(12), np.zeros((12, 12))
    for k, w in zip(e.links, e.weights, strict=True):
        J = np.zeros((len(w), 12))
        for v, x, sign in ((k.i, k.p, 1), (k.j, k.q, -1)):
            J[:, 6 * v : 6 * v + 6] = sign * rows(x, k.normals, middles[v])
            for axis in np.eye(3):  # the motion of a place along each axis
                A = rows(x, np.tile(axis, (len(x), 1)), middles[v])
                motion[6 * v : 6 * v + 6, 6 * v : 6 * v + 6] += A.T @ (A * w[:, None])
        H += J.T @ (J * w[:, None])
        g -= J.T @ (w * k.offsets)
    for mine, plain in ((e.H, H), (e.g, g), (e.motion, motion)):
        np.testing.assert_allclose(mine, plain, atol=1e-9 * np.abs(plain).max())
    assert max(float(w.max()) for w in e.weights) > 0


def test_a_link_beyond_the_scatter_weighs_nothing():
    x = np.zeros((5, 3))
    up = np.tile([0.0, 0.0, 1.0], (5, 1))
    off = np.array([0.1, -0.1, 0.1, -0.1, 5.0])[:, None] * up
    (weights,) = equations([Links(0, 1, off, x, up, up, np.full(5, 0.1))], np.zeros((2, 3))).weights
    assert (weights[:4] > 0).all()
    assert weights[4] == 0


def test_points_that_have_none_near_are_asked_no_more(two):
    views, poses = two
    asked = both_ways([np.arange(len(v.points), dtype=np.int32) for v in views])
    assert set(asked) == {(0, 1), (1, 0)}
    beside = [poses[0], Pose(np.eye(3), np.array([12.0, 0.0, 0.0]))]
    near = near_ones(views, beside, asked, 1.0)
    kept = views[0].points[near[0, 1]]
    assert 0.2 < len(kept) / len(views[0].points) < 0.5
    assert kept[:, 0].min() > 0.9
    assert [len(k.p) for k in all_links(views, beside, asked, 1.0)] == [
        len(k.p) for k in all_links(views, beside, near, 1.0)
    ]


def test_a_thinned_view_keeps_its_rim_and_says_its_own_spacing(two):
    v = two[0][0]
    few = thinned(v, 2.0)
    assert 80 < len(few.points) < 160
    assert few.spacing == v.spacing
    assert 0 < (~few.inner).sum() < len(few.points) / 2
    assert {tuple(p) for p in few.points} <= {tuple(p) for p in v.points}
