"""Two lasers on one part make its rig better, say what they tell, and hold what they do not."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.calibrate.bodies import (
    Body,
    bar,
    both,
    cone,
    cylinder,
    doubted,
    drawn,
    eccentric,
    prism,
    ruled,
    sphere,
    two_lasers,
)
from turnscan.arrays import Floats
from turnscan.calibrate import Balls, Part, Refined, RefineSettings, Round, Sweep, refine
from turnscan.calibrate._adjust import HUBER
from turnscan.calibrate._bodies import Body as FittedBody
from turnscan.calibrate._bodies import Form, Known
from turnscan.calibrate._bodies_found import refuse_ends
from turnscan.calibrate._normal import weight
from turnscan.calibrate._refine_advice import refine_advice
from turnscan.errors import Degenerate, DidNotConverge
from turnscan.mesh import Mesh
from turnscan.progress import Progress
from turnscan.rig import (
    Pose,
    Rig,
    TableMotion,
    Wobble,
    rig_from_json,
    rig_to_json,
    rotation_from_vector,
)
from turnscan.shapes.verification import step_block_body

STEPS = np.radians(np.arange(0.0, 360.0, 9.0))
QUICK = RefineSettings(queries=1000)


@cache
def there_and_back() -> tuple[Rig, Refined]:
    """A hexagon, there and back, on a table that is 1° eccentric and has 0.5° of play."""
    rig, told = two_lasers(), np.concatenate([STEPS, STEPS[::-1]])
    sweeps = both(rig, prism((5.0, 2.0), 40.0), told, eccentric(0.0, 0.5).angle(told), 1, every=6)
    return rig, refine(rig, sweeps, QUICK)


def test_eccentricity_and_play_are_found_without_markers() -> None:
    _, done = there_and_back()
    found = done.estimated
    assert set(found) == {"motion.cos1", "motion.sin1", "motion.backlash"}
    for name, truth in (("motion.cos1", 0.0), ("motion.sin1", 1.0), ("motion.backlash", 0.5)):
        off = abs(found[name].value - np.radians(truth))
        assert off < 3 * found[name].sigma < np.radians(0.1), name
    assert done.gap_before > 1.5 * done.gap_noise
    assert done.gap_after < 1.2 * done.gap_noise


def test_what_was_known_of_the_table_stays_where_a_scan_says_nothing_of_it() -> None:
    """Backlash, known from before, in a scan that turns one way."""
    known = replace(
        eccentric(0.0, 0.5), covariance=np.diag(np.radians([0.02, 0.02, 0.01, 0.03]) ** 2)
    )
    rig = replace(two_lasers(), motion=known)
    sweeps = both(rig, prism((5.0, 2.0), 40.0), STEPS, eccentric().angle(STEPS), 1, every=6)
    done = refine(rig, sweeps, QUICK)
    motion = done.rig.motion
    # What was known counts beside what the scan says: no less certain than before, and kept.
    assert abs(done.estimated["motion.sin1"].value - np.radians(1.0)) < np.radians(0.06)
    assert done.estimated["motion.sin1"].sigma < np.radians(0.0201)
    assert "motion.start" not in done.dropped
    assert motion is not None
    assert motion.covariance is not None
    place = motion.names.index("motion.backlash")
    assert motion.backlash == pytest.approx(np.radians(0.5))
    assert np.sqrt(motion.covariance[place, place]) == pytest.approx(np.radians(0.03))


def test_sides_of_the_hexagon_are_parallel_again() -> None:
    rig, done = there_and_back()
    told = np.concatenate([STEPS, STEPS[::-1]])
    sweeps = both(rig, prism((5.0, 2.0), 40.0), told, eccentric(0.0, 0.5).angle(told), 1, every=6)
    assert _off_parallel(rig, sweeps) > 0.8
    assert _off_parallel(done.rig, sweeps) < 0.1


def _off_parallel(rig: Rig, sweeps: list) -> float:  # type: ignore[type-arg]
    """Degrees by which opposite sides are off parallel, at most."""
    at = np.concatenate([s.points(rig, rig.camera.rays(s.pixels)) for s in sweeps])[:, :2]
    turn = np.degrees(np.arctan2(at[:, 1] - 2.0, at[:, 0] - 5.0))
    leans = []
    for k in range(6):
        middle = np.degrees(0.2) + 60 * k
        side = at[np.abs((turn - middle + 180) % 360 - 180) < 24]
        across = np.linalg.svd(side - side.mean(axis=0), full_matrices=False)[2][1]
        leans.append((np.degrees(np.arctan2(across[1], across[0])) - middle + 90) % 180 - 90)
    return float(np.abs(np.array(leans[:3]) - leans[3:]).max())


def test_a_good_table_gets_no_errors() -> None:
    rig = two_lasers()
    done = refine(rig, both(rig, prism((5.0, 2.0), 40.0), STEPS, STEPS, 2, every=6), QUICK)
    assert not done.estimated
    assert "motion.sin1" in done.dropped
    # In a scan that goes one way, play between the ways does not show.
    assert "motion.backlash" in done.held


def test_a_ruler_and_a_sphere_make_a_rig() -> None:
    true = two_lasers()
    known, wrong = doubted(true), ruled(true)
    assert known.covariance is not None
    sweeps = both(true, sphere((14.0, 3.0, 22.0), 18.0), STEPS, STEPS, 3, every=10)
    settings = replace(QUICK, body=(Balls(), ((18.0, 0.005),)))
    done = refine(wrong, sweeps, settings)
    assert done.gap_before > 2.0
    assert done.gap_after < 1.2 * done.gap_noise < 0.05
    assert "scale" not in done.held
    some = both(true, sphere((14.0, 3.0, 22.0), 18.0), STEPS[::2], STEPS[::2], 3, every=12)
    unknown = refine(
        wrong, some, RefineSettings(body=(Balls(), ((15.0, 7.5),)), rounds=3, queries=200)
    )
    assert "scale" in unknown.held
    # Another sphere, measured with the rig that came of it.
    other = both(true, sphere((-8.0, 10.0, 20.0), 12.0), STEPS, STEPS, 5, every=8)
    at = np.concatenate([s.points(done.rig, done.rig.camera.rays(s.pixels)) for s in other])
    radius, rms = _sphere(at)
    assert abs(radius - 12.0) < 0.03
    assert rms < 0.05
    # What turns or lifts the part in its frame shows in no surface: as uncertain as before.
    T = done.rig.T_camera_table.rotation[:, 2]
    assert done.rig.covariance is not None
    lift = T @ done.rig.covariance[-3:, -3:] @ T
    assert lift == pytest.approx(T @ known.covariance[-3:, -3:] @ T, rel=0.2)


def _sphere(points: Floats) -> tuple[float, float]:
    design = np.concatenate([2 * points, np.ones((len(points), 1))], axis=1)
    solved = np.linalg.lstsq(design, (points**2).sum(axis=1), rcond=None)[0]
    radius = float(np.sqrt(solved[3] + solved[:3] @ solved[:3]))
    off = np.linalg.norm(points - solved[:3], axis=1) - radius
    return radius, float(off.std())


def test_a_rig_that_is_further_off_than_was_known_is_refused() -> None:
    """Surfaces that agree are no proof: those of a prism do in rigs that are centimetres off."""
    true = two_lasers()
    known = doubted(true, 0.5, 0.2)
    assert known.covariance is not None
    wrong = replace(ruled(true, 0, known), covariance=known.covariance / 64)
    sweeps = both(true, prism((5.0, 2.0), 40.0), STEPS, STEPS, 2, every=6)
    with pytest.raises(DidNotConverge, match=r"strays from what is known of it, by \d+\.\d stand"):
        refine(wrong, sweeps, replace(QUICK, rounds=4))


def test_a_start_that_leads_astray_is_followed_by_others() -> None:
    """From this ruler's numbers the rig itself leads to a platter 50 mm off."""
    true, seen = two_lasers(), list[tuple[float, str]]()
    sweeps = both(true, sphere((14.0, 3.0, 22.0), 18.0), STEPS, STEPS, 1, every=12)
    settings = RefineSettings(body=(Balls(), ((18.0, 0.005),)), rounds=3, queries=200)
    progress = Progress(lambda done, text: seen.append((done, text)))
    done = refine(ruled(true, 1), sweeps, settings, progress)
    assert done.gap_after < 1.2 * done.gap_noise < 0.05
    assert [text for _, text in seen if "start 2" in text]
    assert np.all(np.diff([share for share, _ in seen]) >= 0)


def test_lasers_that_are_little_known_want_a_body_of_known_form() -> None:
    """Surfaces of any shape agree in several rigs that are so far off."""
    true = two_lasers()
    sweeps = both(true, prism((5.0, 2.0), 40.0), STEPS[::4], STEPS[::4], 2, every=16)
    with pytest.raises(Degenerate, match=r"known of its lasers .* unknown shape agree in several"):
        refine(ruled(true, 1), sweeps, QUICK)


def test_a_table_anywhere_is_found_by_a_part_of_any_shape() -> None:
    """The axis is 5 mm and 2° off in every number; the lasers are known."""
    true = two_lasers()
    known = doubted(true)
    assert known.covariance is not None
    table = [n.startswith("table.") for n in true.parameter_names]
    known = replace(known, covariance=known.covariance * np.outer(table, table))
    wrong = replace(true, T_camera_table=ruled(true, 1).T_camera_table, covariance=known.covariance)
    seen = both(true, prism((5.0, 2.0), 40.0, 6, 5.0), STEPS, STEPS, 1, every=8)
    sweeps = [replace(sweep, moved=False) for sweep in seen]  # its angles were measured
    done = refine(wrong, sweeps, replace(QUICK, queries=700, rounds=7))
    assert done.gap_before > 20 * done.gap_noise
    assert done.gap_after < 1.2 * done.gap_noise
    assert "scale" not in done.held
    other = both(true, sphere((-8.0, 10.0, 20.0), 12.0), STEPS, STEPS, 5, noise=0.0, every=8)
    at = np.concatenate([s.points(done.rig, done.rig.camera.rays(s.pixels)) for s in other])
    radius, rms = _sphere(at)
    assert abs(radius - 12.0) < 0.02
    assert rms < 0.02


def test_one_laser_says_nothing() -> None:
    rig = two_lasers(lasers=1)
    with pytest.raises(Degenerate, match="no two surfaces overlap"):
        refine(rig, both(rig, prism((5.0, 2.0), 40.0), STEPS, STEPS, 2, every=8), QUICK)


def in_two_poses(true: Rig, steps: Floats) -> tuple[list[Sweep], Pose]:
    """A block of three steps seen by one laser, then laid down anew; and second pose → first."""
    lies = [
        Pose(rotation_from_vector(turn), np.array(shift))
        for turn, shift in (
            ((0.3, 0.5, 1.1), (0.2, 7.6, 12.7)),
            ((1.0, -0.2, -0.5), (-1.0, 14.0, 17.0)),
        )
    ]
    sweeps = [
        replace(both(true, drawn(BLOCK, pose), steps, steps, 7 + k, every=4)[0], pose=k)
        for k, pose in enumerate(lies)
    ]
    return sweeps, lies[0] @ lies[1].inverse()


def test_one_laser_and_a_second_pose_make_a_rig_better() -> None:
    """Every number of the rig is wrong by 0.5 mm or 0.2°, and so is about where the part lay."""
    true = two_lasers(lasers=1)
    sweeps, moved = in_two_poses(true, STEPS)
    wrong = ruled(true, 1, doubted(true, 0.5, 0.2))
    about = Pose(
        rotation_from_vector([0.004, -0.003, 0.004]) @ moved.rotation,
        moved.translation + [0.4, -0.5, 0.3],
    )
    other = both(true, sphere((-8.0, 10.0, 20.0), 12.0), STEPS, STEPS, 5, noise=0.0, every=8)

    def roundness(rig: Rig) -> float:
        at = np.concatenate([s.points(rig, rig.camera.rays(s.pixels)) for s in other])
        return _sphere(at)[1]

    done = refine(wrong, sweeps, RefineSettings(poses=(about,), rounds=6, queries=400))
    assert done.gap_before > 4 * done.gap_noise
    assert done.gap_after < 1.2 * done.gap_noise
    assert "scale" in done.held
    assert not [name for name in done.estimated if name.startswith("pose")]
    assert roundness(wrong) > 4 * roundness(done.rig)
    assert roundness(done.rig) < 0.03
    found = done.fit.state.poses[0]
    middle = np.array([0.0, 5.0, 15.0])
    assert np.linalg.norm(found.apply(middle) - moved.apply(middle)) < 0.5


def test_sweeps_of_a_pose_that_is_not_known_are_refused() -> None:
    true = two_lasers(lasers=1)
    sweeps = both(true, prism((5.0, 2.0), 40.0), STEPS[::4], STEPS[::4], 2, every=16)
    with pytest.raises(ValueError, match="pose"):
        refine(true, [*sweeps, replace(sweeps[0], pose=1)], QUICK)
    with pytest.raises(ValueError, match="pose"):
        refine(true, sweeps, replace(QUICK, poses=(Pose(),)))


def test_a_sphere_of_another_size_is_refused() -> None:
    rig = two_lasers()
    sweeps = both(rig, prism((5.0, 2.0), 40.0), STEPS, STEPS, 2, every=8)
    with pytest.raises(Degenerate, match="no sphere of 80 mm"):
        refine(rig, sweeps, replace(QUICK, body=(Balls(), ((40.0, 0.01),))))
    # A band of a hexagon is not far from a sphere of this size, and is none.
    with pytest.raises(Degenerate, match="the surfaces stay"):
        refine(rig, sweeps, replace(QUICK, body=(Balls(), ((29.0, 0.01),)), rounds=2))


def test_a_round_part_about_the_axis_tells_nothing_of_the_table() -> None:
    rig = two_lasers()
    told = np.radians(np.arange(0.0, 360.0, 4.0))
    sweeps = both(rig, cylinder((0.0, 0.0), 15.0), told, eccentric().angle(told), 2, every=8)
    done = refine(rig, sweeps, QUICK)
    assert "motion.sin1" not in done.estimated


def test_an_axis_that_moves_is_undone_and_kept() -> None:
    """Two lasers see a hexagon beside the axis; the rig knows how its axis moves to 0.02 mm."""
    moves = Wobble.of([4e-3, -2e-3, 0.4, 0.2, 0.2, -0.3])
    true = replace(two_lasers(), wobble=moves)
    sweeps = both(true, prism((5.0, 2.0), 40.0), STEPS, STEPS, 1, every=8)
    sigma = np.zeros(len(true.parameter_names))
    for name, s in zip(Wobble.NAMES, [3e-4, 3e-4, 0.02, 0.02, 0.02, 0.02], strict=True):
        sigma[true.parameter_names.index(name)] = s
    sigma[true.parameter_names.index("left.offset")] = 0.05
    begin = true.perturbed(sigma * np.random.default_rng(3).choice([-1.0, 1.0], len(sigma)))
    done = refine(replace(begin, covariance=np.diag(sigma**2)), sweeps, QUICK)
    assert done.gap_before > 1.1 * done.gap_after
    assert 0.8 < done.gap_after / done.gap_noise < 1.1
    assert done.rig.wobble is not None
    assert done.rig.covariance is not None
    left = np.sqrt(np.diag(done.rig.covariance))
    first = true.parameter_names.index(Wobble.NAMES[0])
    mine = slice(first, first + 6)
    assert (left[mine] <= 1.01 * sigma[mine]).all()
    assert left[mine].min() < 0.5 * sigma[mine].max()
    assert (np.abs(done.rig.wobble.values - moves.values) < 3.5 * left[mine]).all()
    # A rig that does not know of it: a table of other angles is no explanation.
    still = replace(
        two_lasers(), covariance=np.diag(np.delete(sigma, np.arange(first, first + 6)) ** 2)
    )
    with pytest.raises(Degenerate, match="no rig near this one explains the scan"):
        refine(still, sweeps, QUICK)


def test_motion_stays_in_the_rig_file() -> None:
    rig, done = there_and_back()
    again = rig_from_json(rig_to_json(done.rig))
    assert again.motion is not None
    assert done.rig.motion is not None
    assert np.array_equal(again.motion.values, done.rig.motion.values)
    assert '"motion"' not in rig_to_json(rig)


def test_play_is_taken_up_once_and_again_on_the_way_back() -> None:
    told = np.radians([0.0, 10.0, 20.0, 10.0, 0.0])
    play = TableMotion(np.zeros((0, 2)), np.radians(3.0), np.radians(0.5))
    assert np.degrees(play.angle(told)) == pytest.approx([3.0, 10.0, 20.0, 10.5, 0.5])
    assert np.degrees(play.angle(-told)) == pytest.approx([-3.0, -10.0, -20.0, -10.5, -0.5])
    # A list that begins again after 360° goes on in the same sense.
    wrapped = np.radians([350.0, 355.0, 0.0, 5.0])
    assert np.degrees(play.angle(wrapped)) == pytest.approx([353.0, 355.0, 0.0, 5.0])
    waves = TableMotion(np.radians([[0.0, 1.0]]), covariance=np.diag([0, 1e-6, 0, 0]))
    assert np.degrees(waves.angle(np.radians([90.0]))) == pytest.approx([91.0])
    turn = np.linspace(0, 2 * np.pi, 100, endpoint=False)
    assert waves.sigma(turn).max() == pytest.approx(1e-3, rel=1e-2)


@pytest.mark.parametrize(
    ("body", "form", "known", "scale"),
    [
        (bar, Balls(2), ((10.0, 0.005), (10.0, 0.005), (38.0, 0.003)), True),
        (cylinder((9.0, 2.0), 14.0, 20.0), Round(), ((14.0, 0.005),), True),
        (cone, Round(conical=True), (None, (np.radians(12.0), 1e-4)), False),
    ],
    ids=["ball bar", "tilted cylinder", "cone"],
)
def test_a_ruler_and_a_body_anywhere_make_a_rig(
    body: Body, form: Form, known: tuple[Known | None, ...], scale: bool
) -> None:
    true = two_lasers()
    done = refine(ruled(true), both(true, body, STEPS, STEPS, 3, every=12),
                  replace(QUICK, queries=400, body=(form, known)))  # fmt: skip
    assert done.gap_after < 1.2 * done.gap_noise < 0.05
    other = both(true, sphere((-8.0, 10.0, 20.0), 12.0), STEPS, STEPS, 5, every=8)
    at = np.concatenate([s.points(done.rig, done.rig.camera.rays(s.pixels)) for s in other])
    radius, rms = _sphere(at)
    assert rms < 0.05
    # Lengths follow where a length is known; a cone has an angle and no length.
    assert (abs(radius - 12.0) < 0.03) == scale
    assert ("scale" in done.held) != scale


BLOCK = step_block_body((4.0, 9.0), width=9.0, tall=26.0, back=6.0)


def test_a_drawn_part_that_lies_anyhow_makes_a_rig() -> None:
    """A block of three steps, 27 mm long; the rig is 5 mm and 2° off in every number."""
    true = two_lasers()
    lies = Pose(rotation_from_vector([0.3, 0.5, 1.1]), np.array([0.2, 7.6, 12.7]))
    sweeps = both(true, drawn(BLOCK, lies), STEPS[::2], STEPS[::2], 2, every=6)
    seen: list[tuple[float, str]] = []
    done = refine(
        ruled(true, 2),
        sweeps,
        RefineSettings(body=(Part(BLOCK), ((1.0, 1e-4),)), rounds=4, queries=200),
        Progress(lambda share, text: seen.append((share, text))),
    )
    placing = [share for share, text in seen if text == "placing the drawn part"]
    assert len(set(placing)) > 100
    assert [share for share, _ in seen] == sorted(share for share, _ in seen)
    assert done.gap_before > 4.0
    assert done.gap_after < 1.2 * done.gap_noise < 0.05
    other = both(true, sphere((-8.0, 10.0, 20.0), 12.0), STEPS, STEPS, 5, every=8)
    at = np.concatenate([s.points(done.rig, done.rig.camera.rays(s.pixels)) for s in other])
    radius, rms = _sphere(at)
    assert abs(radius - 12.0) < 0.03
    assert rms < 0.05


@pytest.mark.parametrize("times", [1 / 1000, 1 / 25.4, 0.1, 25.4])
def test_a_part_drawn_in_another_unit_is_refused_at_once(times: float) -> None:
    rig = two_lasers()
    form = Part(Mesh(times * np.asarray(BLOCK.vertices), BLOCK.faces))
    sweeps = both(rig, sphere((2.0, 3.0, 12.0), 13.0), STEPS[::4], STEPS[::4], 1, every=12)
    known = replace(QUICK, body=(form, ((1.0, 1e-4),)))
    with pytest.raises(Degenerate, match=r"drawn part has a diagonal of .* mm"):
        refine(doubted(rig, 0.3, 0.1), sweeps, known)


def test_a_part_of_which_most_points_know_nothing_is_refused() -> None:
    form = Part(BLOCK)
    body = FittedBody(form, Pose(), np.ones(1), ((1.0, 1e-4),), (np.arange(40),))
    with pytest.raises(Degenerate, match="only 40% of the points lie on the drawn part"):
        refuse_ends(body, 100)
    refuse_ends(body, 60)


@given(st.integers(0, 1000))
@settings(max_examples=20, deadline=None)
def test_points_are_as_far_from_a_drawn_box_as_from_its_formula(seed: int) -> None:
    dice = np.random.default_rng(seed)
    half = dice.uniform(3.0, 30.0, 3)
    signs = np.array([[i & 1, i >> 1 & 1, i >> 2] for i in range(8)]) * 2.0 - 1.0
    faces = [(0, 2, 1), (1, 2, 3), (4, 5, 6), (5, 7, 6), (0, 1, 4), (1, 5, 4),
             (2, 6, 3), (3, 6, 7), (0, 4, 2), (2, 4, 6), (1, 3, 5), (3, 7, 5)]  # fmt: skip
    box, scale = Part(Mesh(signs * half, np.array(faces))), float(dice.uniform(0.9, 1.1))
    points = dice.normal(0, 25, (60, 3))
    away, unit, by = box.nearest(points, np.array([scale]))
    q = np.abs(points) - scale * half
    true = np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)
    assert away == pytest.approx(true, abs=1e-9)
    turned = Part(Mesh(box.mesh.vertices, box.mesh.faces[:, ::-1]))
    assert turned.nearest(points, np.array([scale]))[0] == pytest.approx(away, abs=1e-9)
    h = 1e-6
    smooth = np.abs(np.diff(np.sort(q, axis=1)[:, 1:], axis=1)[:, 0]) > 0.01  # of one face
    ends = [box.nearest(points, np.array([scale + s * h]))[0] for s in (1.0, -1.0)]
    assert ((ends[0] - ends[1]) / (2 * h))[smooth] == pytest.approx(by[smooth, 0], abs=1e-4)
    moved = box.nearest(points + h * unit, np.array([scale]))[0]
    assert ((moved - away) / h)[smooth] == pytest.approx(1.0, abs=1e-4)


@given(st.integers(0, 3), st.integers(0, 1000))
@settings(max_examples=30, deadline=None)
def test_distances_from_bodies_change_as_they_say(kind: int, seed: int) -> None:
    dice = np.random.default_rng(seed)
    form: Form = (Balls(), Balls(2), Round(), Round(conical=True))[kind]
    sizes = {
        0: [10.0], 1: [10.0, 8.0, 40.0], 2: [12.0], 3: [12.0, 0.2],
    }[kind]  # fmt: skip
    pose = Pose(rotation_from_vector(dice.normal(0, 1, 3)), dice.normal(0, 20, 3))
    one = FittedBody(form, pose, np.array(sizes), (None,) * len(sizes))
    points = dice.normal(0, 25, (40, 3))
    away, unit, by = one.distance(points)
    h = 1e-6
    for k in range(by.shape[1]):
        step = np.zeros(by.shape[1])
        step[k] = h
        ends = [one.moved(s * step).distance(points)[0] for s in (1.0, -1.0)]
        smooth = np.abs(ends[0] - away) < 1e-3  # not between two balls
        assert ((ends[0] - ends[1]) / (2 * h))[smooth] == pytest.approx(by[smooth, k], abs=2e-4)
    for axis in np.eye(3):
        ends = [one.distance(points + s * h * axis)[0] for s in (1.0, -1.0)]
        assert (ends[0] - ends[1]) / (2 * h) == pytest.approx(unit @ axis, abs=2e-4)


def test_a_start_off_by_play_is_as_uncertain_as_it_says() -> None:
    """Gaps share their points' noise, and every point counts once."""
    rig, motion = two_lasers(), eccentric(1.5)
    pulls = []
    for seed in (1, 2):
        sweeps = both(rig, prism((5.0, 2.0), 40.0), STEPS, motion.angle(STEPS), seed, every=8)
        done = refine(rig, sweeps, replace(QUICK, queries=600))
        for name, truth in (("motion.start", 1.5), ("motion.sin1", 1.0)):
            found = done.estimated[name]
            pulls.append((found.value - np.radians(truth)) / found.sigma)
        # If each gap had noise of its own, they would tell more than their points do.
        fit = done.fit
        free = np.diag(fit.covariance) > 0
        own = [(b.common[:, free], weight(b, fit.scales, HUBER)) for b in fit.blocks]
        as_if = np.linalg.inv(sum((A.T * w) @ A for A, w in own))
        more = np.sqrt(np.diag(fit.covariance)[free] / np.diag(as_if)) / fit.view_factor
        assert (more > 1.1).all()
        assert (more < 1.6).all()
    # Four numbers: their rms is known to a third.
    assert 0.3 < np.sqrt(np.mean(np.square(pulls))) < 2.0


def test_a_cylinder_whose_ends_are_seen_is_refused() -> None:
    """The end of a leaning cylinder is no wall."""
    rig = two_lasers()
    wall = cylinder((9.0, 2.0), 14.0, 20.0)
    axis = np.array([np.sin(np.radians(20.0)), 0.0, np.cos(np.radians(20.0))])

    def ended(points: Floats) -> Floats:
        along = (points - [9.0, 2.0, 0.0]) @ axis
        return np.asarray(np.maximum(wall(points), along - 24.0))

    sweeps = both(rig, ended, STEPS, STEPS, 3, every=10)
    with pytest.raises(Degenerate, match="its ends or other things were seen") as refused:
        refine(rig, sweeps, replace(QUICK, queries=300, body=(Round(), ((14.0, 0.005),))))
    assert "ends out of sight" in str(refused.value.hint)


def test_a_second_scan_makes_a_rig_as_much_better_as_was_said() -> None:
    """The table's angles were measured, and the bar gives the scale: only noise is left."""
    true, some = two_lasers(), STEPS[::2]
    scans = [
        [replace(s, moved=False) for s in both(true, bar, some, some, seed, every=12)]
        for seed in (3, 4)
    ]
    known = ((10.0, 0.005), (10.0, 0.005), (38.0, 0.003))
    settings = replace(QUICK, queries=300, rounds=3, body=(Balls(2), known))
    one, two = (refine(doubted(true, 0.3, 0.1), sweeps, settings)
                for sweeps in (scans[0], [*scans[0], *scans[1]]))  # fmt: skip
    assert one.advice.stage == "again"
    assert not one.advice.undetermined
    said = re.search(r"from (0\.\d+) to (0\.\d+) mm", one.advice.text)
    assert said is not None
    before, after = map(float, said.groups())
    assert before == pytest.approx(one.shape_after, abs=1e-3)
    assert after == pytest.approx(two.shape_after, rel=0.2)
    assert after < 0.85 * before


def test_what_one_turn_of_the_table_leaves_open_is_asked_for() -> None:
    true, some = two_lasers(), STEPS[::2]
    known = ((10.0, 0.005), (10.0, 0.005), (38.0, 0.003))
    settings = replace(QUICK, queries=300, rounds=2, body=(Balls(2), known))
    sweeps = both(true, bar, some, some, 3, every=12)
    done = refine(doubted(true, 0.3, 0.1), sweeps, settings)
    assert done.advice.undetermined == ("table: play between the two ways of turning",)
    assert done.advice.stage == "table"
    assert "there and back" in done.advice.text
    # Where play at the start alone is open, a scan that sees its first steps again tells it.
    free = np.diag(done.fit.covariance) > 0
    start = refine_advice(done.rig, done.fit, free, ["motion.start"], sweeps, done.shape_after)
    assert start.stage == "table"
    assert "past a whole turn" in start.text


def test_what_no_surface_shows_bends_no_shape() -> None:
    """A ruler's rig is turned by 2° about and shifted by 5 mm along its axis; neither is measured,
    and neither bends anything: what the rest leaves is some hundredths of a millimetre."""
    true, some = two_lasers(), STEPS[::2]
    settings = replace(QUICK, queries=300, body=(Balls(), ((18.0, 0.005),)))
    sweeps = both(true, sphere((14.0, 3.0, 22.0), 18.0), some, some, 3, every=12)
    done = refine(ruled(true), sweeps, settings)
    assert done.shape_after < 0.05 < 2.0 < done.shape_before
