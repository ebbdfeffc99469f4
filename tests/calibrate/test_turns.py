"""One laser alone: what it saw in each turn, and in another pose, is held against each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.calibrate.bodies import both, doubted, eccentric, prism, ruled, sphere, two_lasers
from turnscan.arrays import Floats
from turnscan.calibrate import Balls, RefineSettings, Sweep, refine
from turnscan.calibrate._refine import _refuse_wild
from turnscan.calibrate._shape import shape_doubt
from turnscan.calibrate._sweeps import turns_of
from turnscan.errors import Degenerate, DidNotConverge
from turnscan.rig import Pose, Rig, TableMotion, rotation_from_vector, rotation_z

STEPS = np.radians(np.arange(0.0, 360.0, 9.0))
THERE_AND_BACK = np.concatenate([STEPS, STEPS[::-1]])
QUICK = RefineSettings(queries=700)


def steps_of(angles_deg: Floats) -> list[list[int]]:
    """The steps of each turn, of a sweep with one point a step."""
    n = len(angles_deg)
    sweep = Sweep("right", np.zeros((n, 2)), np.ones(n), np.arange(n, dtype=np.int32),
                  np.radians(angles_deg))  # fmt: skip
    parts = turns_of(sweep)
    assert all(np.array_equal(p.angles, sweep.angles) for p in parts)
    return [p.step.tolist() for p in parts]


def test_a_sweep_is_cut_where_a_turn_is_over_and_where_the_table_turns_back() -> None:
    once = np.arange(0.0, 360.0, 20.0)
    assert steps_of(once) == [list(range(18))]
    assert steps_of(np.arange(0.0, 720.0, 20.0)) == [list(range(18)), list(range(18, 36))]
    assert steps_of(np.concatenate([once, once])) == [list(range(18)), list(range(18, 36))]
    back = steps_of(np.concatenate([once, once[::-1]]))
    assert back == [list(range(18)), list(range(18, 36))]
    # The first picture once more at the end is no turn, and neither is a table that stands still.
    assert steps_of(np.arange(0.0, 361.0, 20.0)) == [list(range(19))]
    assert steps_of(np.zeros(30)) == [list(range(30))]


def test_play_shows_to_one_laser_there_and_back_and_waves_do_not() -> None:
    rig = two_lasers(lasers=1)
    told, true = THERE_AND_BACK, eccentric(0.0, 0.5)
    done = refine(
        rig, both(rig, prism((5.0, 2.0), 40.0), told, true.angle(told), 1, every=8), QUICK
    )
    assert set(done.estimated) == {"motion.backlash"}
    found = done.estimated["motion.backlash"]
    assert abs(found.value - np.radians(0.5)) < 3 * found.sigma < np.radians(0.15)
    assert {"motion.cos1", "motion.sin1"} <= set(done.held)


def test_an_eccentric_table_shows_to_one_laser_and_a_part_laid_down_again() -> None:
    """A hexagon, then shifted and turned by 40° on the table."""
    rig, told, true = two_lasers(lasers=1), STEPS, eccentric()
    upright = prism((5.0, 2.0), 40.0)
    moved = Pose(rotation_z(np.radians(40.0)), np.array([-4.0, 6.0, 0.0]))

    def again(p: Floats) -> Floats:
        return upright(moved.inverse().apply(p.reshape(-1, 3)).reshape(p.shape))

    first = both(rig, upright, told, true.angle(told), 1, every=12)
    second = both(rig, again, told, true.angle(told), 11, every=12)
    about = moved.inverse()
    about = Pose(rotation_from_vector([0, 0, 0.006]) @ about.rotation, about.translation + 0.15)
    done = refine(rig, [*first, *(replace(s, pose=1) for s in second)],
                  replace(QUICK, queries=400, rounds=4, poses=(about,)))  # fmt: skip
    for name, truth in (("motion.cos1", 0.0), ("motion.sin1", 1.0)):
        found = done.estimated[name]
        assert abs(found.value - np.radians(truth)) < 3 * found.sigma < np.radians(0.2), name
    assert done.gap_before > 1.5 * done.gap_noise
    assert done.gap_after < 0.5 * done.gap_before


def test_a_table_that_is_wildly_off_is_no_answer() -> None:
    _refuse_wild(eccentric(2.0, 0.5))
    with pytest.raises(DidNotConverge, match="91° off its angles"):
        _refuse_wild(TableMotion(np.radians([[-37.0, 90.6]])))


def test_a_body_that_leaves_the_rig_open_is_refused_by_what_is_open() -> None:
    """A ball a tenth of a millimetre beside the axis looks nearly the same whichever way that
    leans."""
    true = two_lasers(lasers=1)
    known = doubted(true)
    wrong = replace(ruled(true, 1, known), covariance=known.covariance)
    sweeps = both(true, sphere((0.11, 0.0, 22.0), 18.0), STEPS[::2], STEPS[::2], 3, every=12)
    settings = RefineSettings(queries=200, rounds=3, body=(Balls(), ((18.0, 0.005),)))
    with pytest.raises(
        Degenerate, match=r"says too little.* 11\.98 mm before; open are"
    ) as refused:
        refine(wrong, sweeps, settings)
    assert "tilted" in str(refused.value.hint)


def test_a_body_that_adds_little_to_a_good_rig_is_no_fault() -> None:
    true = two_lasers()
    known = doubted(true, 0.02, 0.003)
    some = STEPS[::4]
    sweeps = both(true, sphere((14.0, 3.0, 22.0), 18.0), some, some, 3, every=16)
    settings = RefineSettings(queries=200, rounds=2, body=(Balls(), ((18.0, 0.05),)))
    done = refine(known, sweeps, settings)
    assert done.shape_after <= done.shape_before < 0.1


def test_shapes_are_bent_by_as_much_as_draws_of_the_rig_bend_them() -> None:
    """What moves or enlarges all of a part is left aside, and the rest agrees with draws."""
    true = two_lasers()
    sweeps = both(true, sphere((9.0, 3.0, 22.0), 18.0), STEPS[::4], STEPS[::4], 3, every=16)
    known = doubted(true, 0.05, 0.02)
    assert shape_doubt(true, sweeps) == 0.0
    assert known.covariance is not None
    stated, dice = shape_doubt(known, sweeps), np.random.default_rng(2)
    seen = []
    for _ in range(60):
        rig = known.perturbed(dice.multivariate_normal(np.zeros(len(known.covariance)),
                                                       known.covariance))  # fmt: skip
        seen.append(_bent(true, rig, sweeps) ** 2)
    assert stated == pytest.approx(np.sqrt(np.mean(seen)), rel=0.3)
    # The table's own frame moves the part, and bends nothing.
    gauge = np.zeros_like(known.covariance)
    axis = true.T_camera_table.rotation[:, 2]
    gauge[-3:, -3:] = np.outer(axis, axis)
    assert shape_doubt(replace(known, covariance=gauge), sweeps) < 1e-6


def _bent(true: Rig, rig: Rig, sweeps: list[Sweep]) -> float:
    """mm rms between what two rigs make of the same pixels, best laid on each other and scaled."""
    from turnscan.calibrate._shape import places_of

    a, b = places_of(true, sweeps), places_of(rig, sweeps)
    p, q = a - a.mean(axis=0), b - b.mean(axis=0)
    u, s, vt = np.linalg.svd(p.T @ q)
    R = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    size = s.sum() / (q**2).sum()
    return float(np.sqrt(((p - size * q @ R.T) ** 2).sum(axis=1).mean()))
