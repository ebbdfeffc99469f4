"""Each stage by itself, in any order, gives what all give together, and says what is open."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from tests.calibrate.world import World, true_layout, true_rig
from turnscan.arrays import Floats
from turnscan.calibrate import (
    BoardView,
    Calibration,
    CalibrationSettings,
    KnownRig,
    LaserPicture,
    MarkerView,
    TablePicture,
    advice_of,
    calibrate_rig,
    figures,
    findings_of,
    measured_uncertainty,
)
from turnscan.calibrate._advice import _fills, _wanted
from turnscan.calibrate._prior import like, moved_by, prior_of
from turnscan.calibrate._procedure import Stages
from turnscan.calibrate._rig import _evidence
from turnscan.errors import Degenerate, InputError
from turnscan.rig import LaserSheet, Rig, rig_from_json, rig_to_json

SETTINGS = CalibrationSettings(marker_side=27.5)
PLACE = (40.0, 40.0)
SEEDS = range(2, 14 if "TURNSCAN_EXPLORE" in os.environ else 10)


@dataclass(frozen=True)
class Pictures:
    """What the pictures of a rig show."""

    camera: Sequence[BoardView]
    laser: Sequence[LaserPicture]
    table: Sequence[TablePicture]


def pictures(seed: int, boards: int = 12, stops: int = 16) -> Pictures:
    world = World(true_rig(), np.random.default_rng(seed), 0.1)
    camera = [world.board_view(T, name=f"c{k}") for k, T in enumerate(world.board_poses(boards))]
    laser = [
        LaserPicture(world.board_view(T, name=f"l{k}"), world.board_stripe(T).pixels)
        for k, T in enumerate(world.board_poses(boards))
    ]
    layout, table = true_layout(), []
    for k, angle in enumerate(np.arange(stops) * 2 * np.pi / stops):
        seen = world.rider_view(layout, float(angle), 1.0)
        markers = MarkerView(seen.numbers, seen.corners.reshape(-1, 4, 2))
        table.append(TablePicture(markers, {"laser": seen.stripes[0].pixels}, f"t{k}", float(k)))
    return Pictures(camera, laser, table)


@cache
def together(seed: int) -> Calibration:
    p = pictures(seed)
    return calibrate_rig(p.camera, {"laser": p.laser}, p.table, SETTINGS)


@cache
def one_by_one(
    seed: int, boards: int = 12, stops: int = 16
) -> tuple[Calibration, Calibration, Calibration]:
    """Camera alone; the laser added to its file; the table added to that."""
    p = pictures(seed, boards, stops)
    camera = calibrate_rig(p.camera, {}, [], SETTINGS)
    known = KnownRig(rig_from_json(rig_to_json(camera.rig)))
    laser = calibrate_rig([], {"laser": p.laser}, [], SETTINGS, known=known)
    known = KnownRig(rig_from_json(rig_to_json(laser.rig)))
    return camera, laser, calibrate_rig([], {}, p.table, SETTINGS, known=known)


def pixel_at(radius: float, height: float) -> Floats:
    rig = true_rig()
    T, sheet = rig.T_camera_table, rig.sheets[0]
    n = T.inverse().turn(sheet.normal)
    level = n @ T.inverse().apply(sheet.centre) - n[2] * height
    lead = np.arctan2(n[1], n[0])
    both = lead + np.array([1, -1]) * np.arccos(level / (np.hypot(n[0], n[1]) * radius))
    points = np.stack([radius * np.cos(both), radius * np.sin(both), np.full(2, height)], axis=1)
    return rig.camera.project(T.apply(points[np.argmin(T.apply(points)[:, 2])]))


def measured(rig: Rig) -> Floats:
    """Radius and height of the pixel that shows the place (40, 40) in truth, mm."""
    rays = rig.camera.rays(pixel_at(*PLACE)[None])
    X = rig.T_camera_table.inverse().apply(rig.sheets[0].intersect(rays))[0]
    return np.array([np.hypot(X[0], X[1]), X[2]])


def test_stages_one_by_one_give_what_all_give_together() -> None:
    camera, laser, table = one_by_one(1)
    assert (camera.rig.lacking, laser.rig.lacking) == (
        ("a laser sheet", "the rotation axis"), ("the rotation axis",),
    )  # fmt: skip
    assert table.rig.lacking == ()
    assert table.rig.markers
    whole = together(1)
    mine, all_at_once = (measured_uncertainty(r, "laser", *PLACE) for r in (table.rig, whole.rig))
    assert mine is not None
    assert all_at_once is not None
    apart = np.abs(measured(table.rig) - measured(whole.rig))
    assert (apart < 2 * np.array(mine)).all(), apart
    # What is known before is as uncertain as it was: held, and not taken for exact.
    assert 0.8 < mine[0] / all_at_once[0] < 2.0
    assert table.stages.held == ("camera", "laser")


@pytest.mark.slow
def test_what_stages_claim_is_what_they_miss_by() -> None:
    pulls = []
    for seed in SEEDS:
        rig = one_by_one(seed, 7, 8)[2].rig
        u = measured_uncertainty(rig, "laser", *PLACE)
        assert u is not None
        pulls.append((measured(rig) - PLACE) / u)
    # 16 numbers: their rms is known to 18 %, of the 24 to 15 %.
    assert 0.4 < np.sqrt(np.mean(np.square(pulls))) < 1.45


def test_one_stage_anew_leaves_the_others() -> None:
    before = together(1).rig
    p = pictures(30)
    after = calibrate_rig([], {"laser": p.laser}, [], SETTINGS, known=KnownRig(before)).rig
    assert after.covariance is not None
    assert before.covariance is not None
    sigma = np.sqrt(np.diag(before.covariance))
    off = np.abs(moved_by(replace(before, sheets=after.sheets), after))
    k = before.parameter_names.index("laser.turn_along")
    assert (off[:k] <= 1.5 * sigma[:k] + 1e-12).all(), "camera"
    assert (off[-6:] <= 1.5 * sigma[-6:] + 1e-9).all(), "table"
    assert after.markers == before.markers
    assert not np.array_equal(after.sheets[0].normal, before.sheets[0].normal)
    # A second laser beside the first one.
    both = calibrate_rig([], {"other": p.laser}, [], SETTINGS, known=KnownRig(before)).rig
    assert [s.name for s in both.sheets] == ["laser", "other"]
    assert abs(both.sheets[0].normal @ before.sheets[0].normal) > np.cos(1e-4)


def test_scans_that_refined_a_rig_are_forgotten_with_what_they_refined() -> None:
    """They may count again when sheets and axis owe them nothing any more."""
    refined = replace(true_rig(), evidence=("a scan",))
    for given, kept in (
        (("laser",), ("a scan",)),
        (("table",), ("a scan",)),
        (("laser", "table"), ()),
        (("camera", "laser", "table"), ()),
    ):
        assert _evidence(Stages(given, KnownRig(refined))) == kept
    assert _evidence(Stages(("laser", "table"), KnownRig(refined, counts=True))) == ("a scan",)
    assert _evidence(Stages(("camera",))) == ()


def test_a_rig_without_uncertainty_is_held_exactly() -> None:
    before = replace(together(1).rig, covariance=None)
    p = pictures(30)
    c = calibrate_rig([], {"laser": p.laser}, [], SETTINGS, known=KnownRig(before))
    assert np.array_equal(c.rig.camera.distortion, before.camera.distortion)
    assert c.rig.camera.fx == before.camera.fx
    assert "calibrate.held-exactly" in [f.code for f in findings_of(c, figures(c))]


def test_another_camera_is_refused() -> None:
    before, p = together(1).rig, pictures(30)
    wide = replace(before, camera=replace(before.camera, fx=300.0, fy=620.0))
    with pytest.raises(Degenerate, match="focus"):
        calibrate_rig([], {"laser": p.laser}, [], SETTINGS, known=KnownRig(wide))
    larger = replace(before, camera=replace(before.camera, width=1280))
    for camera, laser in (([], {"laser": p.laser}), (p.camera, {})):
        with pytest.raises(InputError, match="1280"):
            calibrate_rig(camera, laser, [], SETTINGS, known=KnownRig(larger))


def test_the_way_from_one_rig_to_another_is_that_of_perturbed() -> None:
    rig = together(1).rig
    delta = np.random.default_rng(1).normal(0, 1e-4, len(rig.parameter_names))
    delta[rig.parameter_names.index("laser.bow_aa")] *= 1e-3
    assert moved_by(rig, rig.perturbed(delta)) == pytest.approx(delta, abs=3e-7)
    assert rig.covariance is not None
    prior = prior_of(rig, rig, ["laser"])
    assert prior is not None
    names = [rig.parameter_names[k] for k in prior.index]
    assert names == ["laser.turn_along", "laser.turn_across", "laser.offset"]
    mine = rig.covariance[np.ix_(prior.index, prior.index)]
    assert prior.root @ mine @ prior.root.T == pytest.approx(np.eye(3), abs=1e-6)
    assert prior_of(replace(rig, covariance=None), rig, ["laser"]) is None
    assert prior_of(rig, rig, ["none"]) is None


def test_a_plane_stays_when_it_is_written_like_another() -> None:
    a = LaserSheet("a", np.array([0.6, 0.0, 0.8]), np.array([10.0, 0.0, 300.0]))
    b = LaserSheet("b", np.array([-0.61, 0.02, -0.79]), np.array([-40.0, 50.0, 350.0]))
    same = like(b, a)
    assert same.normal @ a.normal > 0.99
    points = np.random.default_rng(0).normal(0, 100, (5, 3))
    assert same.distance(points) == pytest.approx(-b.distance(points))
    assert np.linalg.norm(same.centre - a.centre) == pytest.approx(abs(float(b.distance(a.centre))))


@pytest.mark.parametrize("camera", [True, False])
def test_a_corner_under_the_stripe_costs_no_picture(camera: bool) -> None:
    p = pictures(1)
    corners = p.laser[0].view.corners.copy()
    corners[20:23] += (6.0, 0.3)
    odd = LaserPicture(replace(p.laser[0].view, corners=corners), p.laser[0].candidates)
    known = None if camera else KnownRig(together(1).rig)
    boards = p.camera if camera else []
    c = calibrate_rig(boards, {"laser": [odd, *p.laser[1:]]}, [], SETTINGS, known=known)
    assert not c.rejected
    assert len(c.network.boards[len(boards)].ids) == 45
    # Where many corners are off, it is the picture that is wrong.
    corners[::4] += (8.0, 0.0)
    odd = LaserPicture(replace(p.laser[0].view, corners=corners), p.laser[0].candidates)
    c = calibrate_rig(boards, {"laser": [odd, *p.laser[1:]]}, [], SETTINGS, known=known)
    assert [r.name for r in c.rejected] == ["l0"]


def test_a_board_that_is_small_in_the_picture_is_said() -> None:
    world = World(true_rig(), np.random.default_rng(1), 0.1)
    views = [world.board_view(T, name=f"c{k}") for k, T in enumerate(world.board_poses(8))]
    text = _wanted(calibrate_rig(views, {}, [], SETTINGS), "camera")
    said = re.search(r"larger than the (\d+)% of its width that the board fills now", text)
    assert said is not None
    fills = np.median([_fills(v.corners, world.rig.camera) for v in views])
    assert float(said[1]) == pytest.approx(100 * fills, abs=0.6)
    assert _fills(np.array([[10.0, 10.0], [490.0, 200.0]]), world.rig.camera) == 0.75


def test_it_says_which_pictures_would_help_most() -> None:
    camera, laser, table = one_by_one(1)
    assert advice_of(camera.rig, camera).stage == "laser"
    assert advice_of(laser.rig, laser).stage == "table"
    assert advice_of(table.rig, table).undetermined == ()
    p = pictures(1)
    few = calibrate_rig(p.camera, {"laser": p.laser}, p.table[::3], SETTINGS)
    told = advice_of(few.rig, few)
    assert told.stage == "table"
    before, after = (float(part.split()[0]) for part in told.text.split("± ")[1:])
    # Had there been twice as many, they would indeed be worth about what was said.
    more = calibrate_rig(p.camera, {"laser": p.laser}, p.table[::3] + p.table[1::3], SETTINGS)
    u = [
        2 * np.hypot(*(measured_uncertainty(c.rig, "laser", 80.0, 80.0) or ())) for c in (few, more)
    ]
    assert before == pytest.approx(u[0], abs=2e-3)
    assert 0.5 * before < after < before
    assert u[1] == pytest.approx(after, rel=0.3)
