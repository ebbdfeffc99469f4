"""Poses find each other by their shape, or are refused."""

from __future__ import annotations

import numpy as np
import pytest

from tests.poses.scenes import STANDS, WALL, apart, grid, seen, truth
from turnscan.errors import InputError
from turnscan.poses import align, alignment_findings, check, place


@pytest.fixture(scope="module")
def knob():
    return [seen("up", grid("knob", 1)), seen("down", grid("knob lying", 2))]


@pytest.fixture(scope="module")
def cup():
    return [seen("up", grid("cup", 1)), seen("side", grid("cup lying", 2))]


@pytest.fixture(scope="module")
def cup_joined(cup):
    return align(cup, place(cup))


@pytest.mark.slow
def test_a_part_tipped_over_is_found_and_refined_as_well_as_its_noise_allows(knob):
    starts = place(knob)
    true = truth("knob", "knob lying")
    assert starts[0].rotation.trace() == 3.0
    assert apart(starts[1], true, knob[1]) < 0.5
    found = align(knob, starts)
    check(found)
    assert found.freedoms == ()
    off = found.poses[1] @ true.inverse()
    sigma = np.sqrt(np.diagonal(found.covariance[1]))
    moved = off.apply(found.middles[1]) - found.middles[1]
    # Its middle lies within three sigma of the truth, and sigma is no excuse.
    assert (np.abs(moved) < 3 * sigma[3:] + 1e-3).all()
    assert 0.001 < sigma[3:].max() < 0.03
    assert found.meetings[0].rms == pytest.approx(0.15, abs=0.08)
    assert 0.5 < found.meetings[0].sigmas < 1.5


def test_from_a_rough_start_all_poses_come_back(knob):
    from turnscan.rig import Pose, rotation_from_vector

    true = truth("knob", "knob lying")
    middle = knob[1].points.mean(axis=0)
    turn = rotation_from_vector(np.deg2rad(3.0) * np.array([0.6, -0.64, 0.48]))
    nudge = Pose(turn, middle - turn @ middle + [1.2, -1.0, 1.2])
    found = align(knob, [Pose(), true @ nudge])
    assert apart(true @ nudge, true, knob[1]) > 2.0
    assert apart(found.poses[1], true, knob[1]) < 0.08


@pytest.mark.slow
def test_a_round_cup_may_turn_about_its_axis_and_that_is_said(cup_joined):
    (free,) = cup_joined.freedoms
    axis = free.turn / np.linalg.norm(free.turn)
    assert abs(axis[2]) > 0.99
    finding = next(f for f in alignment_findings(cup_joined) if f.code == "poses.free")
    assert finding.severity == "warning"
    assert finding.message.startswith("turning about the axis along (")
    # All else is determined: where the cup's axis lies, and its foot.
    lying = STANDS["cup lying"]
    up = cup_joined.poses[1].turn(lying.turn([0.0, 0.0, 1.0]))
    middle = cup_joined.poses[1].apply(lying.apply([0.0, 0.0, 30.0]))
    assert np.abs(up[:2]).max() < 2e-3
    assert np.linalg.norm(middle - [0, 0, 30]) < 0.1


def test_the_wall_of_the_cup_is_as_thick_as_it_is(cup, cup_joined):
    """The outside from the standing pose, the inside from the lying one."""
    from scipy.spatial import cKDTree

    out, lying = cup
    x, n = cup_joined.poses[1].apply(lying.points), cup_joined.poses[1].turn(lying.normals)
    hollow = lying.inner & (np.einsum("ij,ij->i", n[:, :2], x[:, :2]) < 0) & (np.abs(n[:, 2]) < 0.5)
    assert hollow.sum() > 40
    x, n, sigma = x[hollow], n[hollow], lying.sigma[hollow]
    thick, total = [], []
    for k, near in enumerate(cKDTree(out.points).query_ball_point(x - WALL * n, 2.0)):
        if len(near) >= 5:
            m = out.normals[near]
            thick.append(np.einsum("ij,ij->i", m, out.points[near] - x[k]).mean())
            outer = out.sigma[near].mean() / np.sqrt(len(near))
            pose = cup_joined.sigma(1, x[k : k + 1], n[k : k + 1])[0]
            total.append(np.sqrt(sigma[k] ** 2 + outer**2 + pose**2))
    off = (np.array(thick) - WALL) / np.array(total)
    assert len(off) > 30
    assert (np.abs(off) < 3).mean() > 0.98
    assert abs(np.median(off)) < 0.5
    assert 0.2 < off.std() < 1.5


@pytest.mark.slow
def test_poses_that_cannot_be_told_apart_are_refused():
    prism = [seen("up", grid("prism", 1)), seen("side", grid("prism lying", 2))]
    with pytest.raises(InputError, match=r"^side: fits up in several ways → .*points"):
        place(prism)


def test_another_part_is_refused(knob, cup):
    with pytest.raises(InputError, match=r"^side: no place where its surface agrees with up"):
        place([knob[0], cup[1]])


def test_poses_without_an_overlap_are_refused():
    low, high = grid("knob", 1, high=18.0), grid("knob", 2, low=22.0)
    views = [seen("foot", low), seen("top", high)]
    with pytest.raises(
        InputError, match=r"^top: (no place|fits|its overlap .* too little relief: shifting)"
    ):
        check(align(views, place(views)), by_shape=True)


def test_a_wrong_start_is_seen_after_the_refinement(knob):
    from turnscan.rig import Pose

    away = Pose(np.eye(3), np.array([0.0, 0.0, 300.0]))
    with pytest.raises(InputError, match=r"lies on the other poses, at least 10% must"):
        check(align(knob, [Pose(), away]))
    upside = truth("knob", "knob lying") @ Pose(np.diag([1.0, -1.0, -1.0]), np.array([0, 50, 50.0]))
    with pytest.raises(InputError, match=r"overlap agrees|saw empty space|lies on the other"):
        check(align(knob, [Pose(), upside]))


@pytest.mark.slow
def test_range_scans_of_another_scanner_find_each_other(shared_data):
    """Three views of the bunny, 45° apart, from no placement at all."""
    from turnscan.rig import Pose
    from turnscan.settings import Settings
    from turnscan.workflows._importing._range_scans import placed_scans, read_range_scan

    known = placed_scans(shared_data / "bunny-range" / "bun.conf", "m")
    paths = [p for p in known if p.stem in ("bun000", "bun045", "bun090")]
    views = [seen(p.stem, read_range_scan(p, Pose(), "m", Settings())[0]) for p in paths]
    found = align(views, place(views))
    check(found, by_shape=True)
    for path, pose, v in zip(paths, found.poses, views, strict=True):
        assert apart(pose, known[paths[0]].inverse() @ known[path], v) < 0.5
    assert max(m.rms for m in found.meetings) < 0.3
