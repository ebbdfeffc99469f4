"""Test values of artefacts from points with known noise: truth, coverage, and what is refused."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from tests.analytic import full_turn, make_rig, scan_shape, sphere, union, with_noise
from turnscan.arrays import Floats
from turnscan.errors import FormatError, InputError
from turnscan.points import build_grid
from turnscan.rig import Rig
from turnscan.shapes import fit_sphere
from turnscan.shapes.verification import (
    Artefact,
    Kind,
    Length,
    Survey,
    TestValue,
    artefact_from_text,
    ball_at,
    ball_values,
    drift,
    face_of,
    joint,
    level_values,
    repeatability,
    survey_of_grids,
    values_of,
)
from turnscan.shapes.verification._balls import ball_moves
from turnscan.stripes import Stripe

NOISE = 0.02
STEPS = 12
RUNS = 200
KNOWN = 0.004
"""mm: standard uncertainty of each dimension of the artefacts."""
SCALE, SKEW = 1e-4, 2e-4
"""Standard deviations of two directions of a calibration: everything larger, x sheared by z."""


def ball_points(dice: np.random.Generator, centre: Floats, radius: float, count: int) -> Floats:
    """Points (n, 3) on the upper nine tenths of a ball, without noise."""
    z = dice.uniform(-0.8, 1.0, count)
    turn = dice.uniform(0, 2 * math.pi, count)
    r = np.sqrt(1 - z * z)
    return centre + radius * np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)


def face_points(dice: np.random.Generator, height: float, count: int) -> Floats:
    """Points (n, 3) on a face of 30 × 40 that looks along x."""
    flat = dice.uniform(-1, 1, (count, 2)) * (15.0, 20.0)
    return np.column_stack([np.full(count, height), flat[:, 0] + 4 * height, flat[:, 1] + 30])


def moves_of(points: Floats) -> Floats:
    """(2, n, 3) mm: what one standard deviation of the calibration does."""
    skew = np.zeros_like(points)
    skew[:, 0] = SKEW * points[:, 2]
    return np.stack([SCALE * points, skew])


def surveyed(dice: np.random.Generator, points: Floats, normal: Floats) -> Survey:
    """The points as a scanner sees them whose calibration is off as it says, with noise."""
    off = np.einsum("m,mki->ki", dice.standard_normal(2), moves_of(points))
    noisy = points + off + NOISE * dice.standard_normal((len(points), 1)) * normal
    return Survey(noisy, None, lambda index: moves_of(noisy[index]))


def known(dice: np.random.Generator, truth: float) -> Length:
    """A dimension as a laboratory that is as uncertain as it says would give it."""
    return Length(truth + KNOWN * float(dice.standard_normal()), KNOWN)


def bar(dice: np.random.Generator) -> list[TestValue]:
    centres = np.array([[20.0, 0.0, 20.0], [-20.0, 10.0, 110.0]])
    parts = [ball_points(dice, c, 15.0, 1500) for c in centres]
    out = [(p - c) / 15.0 for p, c in zip(parts, centres, strict=True)]
    survey = surveyed(dice, np.concatenate(parts), np.concatenate(out))
    apart = float(np.linalg.norm(centres[1] - centres[0]))
    artefact = Artefact(
        "ball-bar", "bar", (known(dice, 30.0), known(dice, 30.0)), known(dice, apart)
    )
    return ball_values(artefact, survey, [ball_at(survey, c, 15.0) for c in centres])


def block(dice: np.random.Generator) -> list[TestValue]:
    heights = (0.0, 5.0, 15.0)
    parts = [face_points(dice, h, 1500) for h in heights]
    points = np.concatenate(parts)
    survey = surveyed(dice, points, np.broadcast_to([1.0, 0.0, 0.0], points.shape))
    artefact = Artefact("step-block", "block", heights=(known(dice, 5.0), known(dice, 15.0)))
    faces = [face_of(survey, np.arange(1500 * k, 1500 * (k + 1)), 0.5) for k in range(3)]
    levels = joint(survey, [f for f in faces if f is not None])
    return level_values(artefact, survey, levels, artefact.heights)


@pytest.mark.slow
@pytest.mark.parametrize("made", [bar, block])
def test_the_stated_uncertainty_covers_95_per_cent(
    made: Callable[[np.random.Generator], list[TestValue]],
) -> None:
    """200 scans with noise, a calibration and an artefact that are off as they say."""
    dice = np.random.default_rng(4)
    runs = [made(dice) for _ in range(RUNS)]
    for k, first in enumerate(runs[0]):
        value = np.array([r[k].value for r in runs])
        U = np.array([r[k].expanded for r in runs])
        # Errors are 0 in truth; the range of noise is what it is on average.
        truth = 0.0 if first.test in ("size", "distance", "height") else value.mean()
        inside = float(np.mean(np.abs(value - truth) <= U))
        print(f"{first.name}: {inside:.1%} of {RUNS} within U, mean U {1e3 * U.mean():.1f} µm")
        assert 0.93 <= inside <= 0.975, first.name


def test_points_that_scatter_more_at_one_end_are_not_all_counted_alike() -> None:
    """A ball seen far away at its top: its height and size are stated as they scatter."""
    dice = np.random.default_rng(11)
    z, plain = [], []
    for _ in range(150):
        out = ball_points(dice, np.zeros(3), 1.0, 600)
        noise = np.where(out[:, 2] > 0.5, 0.08, 0.02) * dice.standard_normal(len(out))
        points = (20.0 + noise[:, None]) * out
        found = ball_at(Survey(points), np.zeros(3), 20.0).sphere
        error = np.array([found.centre[2], found.radius - 20.0])
        z.append(error / np.sqrt(np.diag(found.covariance)[2:]))
        plain.append(error / np.sqrt(np.diag(fit_sphere(points).covariance)[2:]))
    off = [np.abs(np.sqrt(np.mean(np.square(one), axis=0)) - 1.0) for one in (z, plain)]
    assert off[0].max() < 0.15
    assert off[1].max() > 0.2, "as if all scattered alike"


@pytest.mark.parametrize(("count", "turns"), [(48, 10), (120, 30)])
def test_of_lines_that_repeat_nothing_a_ball_is_as_certain_as_its_points(
    count: int, turns: int
) -> None:
    """Few lines, by chance, seem to repeat much: the uncertainty is not made larger for that."""
    dice = np.random.default_rng(31)
    up = np.repeat(np.arcsin(np.linspace(-0.8, 0.8, count)), turns)
    round_ = np.tile(np.arange(turns) * 2 * np.pi / turns, count)
    out = np.column_stack([np.cos(up) * np.cos(round_), np.cos(up) * np.sin(round_), np.sin(up)])
    lines = np.repeat(np.arange(count), turns)
    z = []
    for _ in range(200):
        points = (20.0 + dice.normal(0.0, 0.02, len(out)))[:, None] * out
        found = ball_at(Survey(points, lines=lines), np.zeros(3), 20.0).sphere
        error = np.array([*found.centre, found.radius - 20.0])
        z.append(error / np.sqrt(np.diag(found.covariance)))
    # 800 values know an rms to 2.5 %; what neighbours share is never said to be less than nothing.
    assert 0.85 < np.sqrt(np.mean(np.square(z))) < 1.08


def bowed(points: Floats) -> Floats:
    """(2, n, 3) mm: one standard deviation of a calibration that bends balls, along x and z."""
    wide, tall = np.zeros((2, *points.shape))
    wide[:, 0], tall[:, 2] = 0.002 * points[:, 0], 1e-4 * points[:, 2] ** 2
    return np.stack([wide, tall])


def test_what_the_calibration_bends_is_not_counted_as_noise_of_the_points_too() -> None:
    """A ball that a wrong rig bends, by as much as its calibration leaves open: its noise is that
    of a ball that is not bent, and its whole uncertainty what its centre and radius are off."""
    dice = np.random.default_rng(21)
    up = np.repeat(np.arcsin(np.linspace(-0.8, 0.8, 60)), 16)
    turn = np.tile(np.arange(16) * np.pi / 16, 60)  # seen from one side, so that it moves
    out = np.column_stack([np.cos(up) * np.cos(turn), np.cos(up) * np.sin(turn), np.sin(up)])
    lines = np.repeat(np.arange(60), 16)
    own, whole, twice = list[Floats](), list[Floats](), list[Floats]()
    for _ in range(200):
        by = dice.standard_normal(2)
        points = (20.0 + NOISE * dice.standard_normal((len(out), 1))) * out
        seen = points + np.einsum("m,mki->ki", by, bowed(points))
        seen_by = Survey(seen, None, partial(np.take, bowed(seen), axis=1), lines)
        ball = ball_at(seen_by, np.zeros(3), 20.0)
        moved = ball_moves(seen_by, ball, ball.index)[0]
        error = np.array([*ball.sphere.centre, ball.sphere.radius - 20.0])
        noisy = np.diag(ball.sphere.covariance)
        own.append((error - by @ moved) / np.sqrt(noisy))
        whole.append(error / np.sqrt(noisy + (moved**2).sum(axis=0)))
        alone = ball_at(Survey(seen, lines=lines), np.zeros(3), 20.0).sphere
        twice.append((error - by @ moved) / np.sqrt(np.diag(alone.covariance)))
    own_z, whole_z, before = (np.sqrt(np.mean(np.square(z), axis=0)) for z in (own, whole, twice))
    print(f"own {own_z.round(2)}, whole {whole_z.round(2)}, bends as noise {before.round(2)}")
    # 200 draws know an rms to 5 %; what neighbours share is never said to be less than nothing.
    assert 0.85 < own_z.min() <= own_z.max() < 1.15
    assert 0.85 < whole_z.min() <= whole_z.max() < 1.15
    assert before.max() < 0.8 * own_z.min()


def test_moves_of_many_points_are_taken_in_slices(monkeypatch: pytest.MonkeyPatch) -> None:
    points = ball_points(np.random.default_rng(23), np.zeros(3), 20.0, 700)
    survey = Survey(points, None, lambda index: bowed(points[index]))
    some, out = np.arange(3, 700, 2), points[3:700:2] / 20.0
    whole = np.einsum("mki,ki->mk", bowed(points[some]), out)
    monkeypatch.setattr("turnscan.shapes.verification._survey._AT_ONCE", 100)
    np.testing.assert_allclose(survey.pushed(some, out), whole, rtol=0, atol=1e-15)
    assert np.abs(whole).max() > 0.03
    assert Survey(points).pushed(some, out).shape == (0, len(some))


def test_a_face_that_the_calibration_bows_is_not_counted_as_one_of_clumps() -> None:
    """Of a face bowed by three times its noise, and of one whose neighbours do err alike."""
    dice = np.random.default_rng(22)
    clumps, real = list[float](), list[float]()
    for _ in range(60):
        flat = face_points(dice, 0.0, 1500)
        bow = np.zeros((1, *flat.shape))
        bow[0, :, 0] = 0.06 * (flat[:, 1] / 15.0) ** 2
        seen = flat + dice.standard_normal() * bow[0]
        seen[:, 0] += NOISE * dice.standard_normal(len(flat))
        tile = ((flat[:, 1:] - flat[:, 1:].min(axis=0)) / (5.0, 6.0)).astype(int) @ [7, 1]
        shared = seen.copy()
        shared[:, 0] += NOISE / 2 * dice.standard_normal(49)[tile]
        for points, into in ((seen, clumps), (shared, real)):
            face = face_of(
                Survey(points, None, partial(np.take, bow, axis=1)), np.arange(1500), 0.5
            )
            assert face is not None
            into.append(face.clumping)
    # Means of 40 cells scatter by 1 ± 0.22, and less than 1 counts as 1: 1.09 on the average. Of 30
    # points in a tile that have a quarter of their variance in common: some 1 + 30 / 4.
    assert 1.0 < np.mean(clumps) < 1.2
    assert 3.0 < np.mean(real) < 9.0


@pytest.mark.parametrize("block", [1, 4])
def test_what_a_line_repeats_in_all_profiles_does_not_average_out(block: int) -> None:
    """A ball on the axis, each line of which (or each four) is off alike at all 30 steps."""
    dice = np.random.default_rng(12)
    up = np.repeat(np.arcsin(np.linspace(-0.8, 0.8, 120)), 30)
    round_ = np.tile(np.arange(30) * np.pi / 15, 120)
    out = np.column_stack([np.cos(up) * np.cos(round_), np.cos(up) * np.sin(round_), np.sin(up)])
    lines = np.repeat(np.arange(120), 30)
    z, alone = list[Floats](), list[Floats]()
    for _ in range(200):
        off = np.repeat(dice.normal(0.0, 0.02, 120 // block), 30 * block)
        points = (20.0 + off + dice.normal(0.0, 0.02, len(out)))[:, None] * out
        for found, scores in (
            (ball_at(Survey(points, lines=lines), np.zeros(3), 20.0).sphere, z),
            (ball_at(Survey(points), np.zeros(3), 20.0).sphere, alone),
        ):
            error = np.array([found.centre[2], found.radius - 20.0])
            scores.append(error / np.sqrt(np.diag(found.covariance)[2:]))
    # 200 draws know an rms to 5 %; 120 / block errors know their own size to 7 % and 13 %.
    rms, before = (np.sqrt(np.mean(np.square(one), axis=0)) for one in (z, alone))
    assert 0.75 < rms.min() <= rms.max() < 1.25
    assert before.max() > 1.5, "as if all points scattered alone"


def modern_like() -> Rig:
    """A rig with a calibration that knows its sheet to 5 µm and its axis to 5 µm."""
    rig = make_rig(theta=np.deg2rad(30.0), size=(400, 500), focal=1500.0, lift=70.0)
    names = rig.parameter_names
    sigma = np.zeros(len(names))
    for name in ("L0.offset", "table.shift_x", "table.shift_z"):
        sigma[names.index(name)] = 0.005
    return replace(rig, covariance=np.diag(sigma**2))


BAR = union(sphere(15.0, (10.0, 0.0, 20.0)), sphere(15.0, (-5.0, 5.0, 119.0)))
APART = float(np.linalg.norm([15.0, -5.0, -99.0]))


@cache
def stripes_of(moved: float) -> tuple[Rig, list[Stripe]]:
    """The rig, and what it sees of the bar when its laser has moved by so many mm."""
    rig = modern_like()
    delta = np.zeros(len(rig.parameter_names))
    delta[rig.parameter_names.index("L0.offset")] = moved
    return rig, scan_shape(rig.perturbed(delta), BAR, full_turn(STEPS))


def scanned(moved: float, seed: int) -> list[TestValue]:
    """A ball bar with noise of 0.1 px, computed with the rig as it was calibrated."""
    believed, exact_stripes = stripes_of(moved)
    stripes = with_noise(exact_stripes, 0.1, seed)
    grid = build_grid(believed, "L0", stripes, np.arange(STEPS), full_turn(STEPS))
    exact = Length(30.0, 0.001)
    artefact = Artefact("ball-bar", "bar", (exact, exact), Length(APART, 0.001))
    return values_of(artefact, survey_of_grids([grid], believed))


@pytest.mark.slow
def test_a_rig_that_is_right_has_no_errors_and_a_moved_laser_shows() -> None:
    right = scanned(0.0, 1)
    for v in right:
        if v.test in ("size", "distance"):
            assert abs(v.value) < 1.5 * v.expanded < 0.06, v
            assert v.calibration > 0
        else:
            # 0.1 px are 33 µm on the sheet; a range of some thousand points is 5 to 9 of them.
            assert 0.03 < v.value < 0.4, v
    size = [v for v in scanned(0.05, 1) if v.test == "size"]
    assert all(abs(v.value) > 2 * v.expanded for v in size)


@pytest.mark.slow
def test_a_drift_of_50_micrometres_is_found_by_the_third_scan_and_not_before() -> None:
    runs = [scanned(moved, seed) for seed, moved in enumerate((0.0, 0.0, 0.05))]
    alarms = {
        first.name: drift([r[k].value for r in runs], [r[k].noise for r in runs]).alarm.tolist()
        for k, first in enumerate(runs[0])
    }
    assert not any(a[0] or a[1] for a in alarms.values())
    assert alarms["size of ball 1"][2]
    assert alarms["size of ball 2"][2]


def test_scores_of_a_drift_chart_are_standard_normal_and_alarms_are_rare() -> None:
    dice = np.random.default_rng(3)
    scores, rung = [], 0
    for _ in range(300):
        noise = dice.uniform(0.001, 0.003, 20)
        chart = drift(0.7 + noise * dice.standard_normal(20), noise, scatter=0.0)
        scores.append(chart.score[1:])
        rung += bool(chart.alarm.any())
    z = np.concatenate(scores)
    assert abs(z.mean()) < 4 / math.sqrt(z.size)
    assert z.std() == pytest.approx(1.0, abs=4 / math.sqrt(2 * z.size))
    # One in 450 values is 4 % of 20 values; three standard deviations of 300 are 3 % more.
    assert rung / 300 < 0.07


def test_a_jump_rings_at_once_and_a_slow_drift_by_its_sum() -> None:
    noise = np.full(3, 0.01)
    assert drift([0.0, 0.0, 0.055], noise, scatter=0.0).alarm.tolist() == [False, False, True]
    assert drift([0.0, 0.0, -0.055], noise, scatter=0.0).alarm[-1]
    assert not drift([0.0, 0.0, 0.045], noise, scatter=0.0).alarm.any()
    slow = drift(0.01 * np.arange(7.0), np.full(7, 0.01), scatter=0.0)
    assert np.abs(slow.score).max() < 4.0
    assert slow.alarm[-1]


def test_the_scatter_of_setting_up_is_learnt_from_five_values_and_not_from_a_step() -> None:
    dice = np.random.default_rng(5)
    rung = 0
    for _ in range(100):
        values = 0.01 * dice.standard_normal(20)
        chart = drift(values, np.full(20, 0.001))
        rung += bool(chart.alarm.any())
        assert drift([*values, 0.2], np.full(21, 0.001)).alarm[-1]
    assert rung < 25
    assert drift([0, 0, 0, 0, 0, 0.02, 0.02], np.full(7, 0.001)).scatter < 0.001


def test_plate_and_block_are_found_with_their_edges_and_judged() -> None:
    dice = np.random.default_rng(7)
    at = np.array([0.0, 5.0, 15.0])
    parts = [face_points(dice, h, 3000) for h in at]
    floor = np.column_stack([dice.uniform(-40, 40, (4000, 2)), np.zeros(4000)])
    points = np.concatenate([*parts, floor]) + 0.01 * dice.standard_normal((13000, 3))
    heights = (Length(5.02, 0.001), Length(15.0, 0.001))
    values = values_of(Artefact("step-block", "b", heights=heights), Survey(points))
    by = {v.name: v for v in values}
    assert by["height of level 2"].value == pytest.approx(-0.02, abs=0.003)
    assert by["height of level 3"].value == pytest.approx(0.0, abs=0.003)
    assert math.isnan(by["height of level 3"].calibration)
    # 3000 points of 10 µm: their range without 9 is 2 × 2.97 standard deviations.
    assert 0.05 < by["flatness of face 1"].value < 0.07
    plate = Artefact("plate", "p", thickness=Length(10.0, 0.001))
    faces = np.concatenate([parts[0], parts[0] + (10.0, 0, 0)])
    noisy = Survey(faces + 0.01 * dice.standard_normal(faces.shape))
    (thick,) = [v for v in values_of(plate, noisy) if v.test == "thickness"]
    assert thick.value == pytest.approx(0.0, abs=0.003)


@pytest.mark.parametrize("kind", ["sphere", "ball-bar", "step-block", "plate"])
def test_what_is_not_there_is_said(kind: Kind) -> None:
    dice = np.random.default_rng(1)
    ring = dice.uniform(0, 2 * math.pi, 8000)
    tube = np.column_stack([20 * np.cos(ring), 20 * np.sin(ring), dice.uniform(0, 80, 8000)])
    artefact: Artefact = {
        "sphere": Artefact("sphere", "s", (Length(40.0, 0.01),)),
        "ball-bar": Artefact("ball-bar", "b", (Length(30, 0.01),) * 2, Length(100, 0.01)),
        "step-block": Artefact("step-block", "x", heights=(Length(5, 0.01),)),
        "plate": Artefact("plate", "p", thickness=Length(8, 0.01)),
    }[kind]
    with pytest.raises(InputError, match=r"found|no parallel"):
        values_of(artefact, Survey(tube))


def test_of_two_about_equal_balls_the_first_is_the_lower() -> None:
    dice = np.random.default_rng(6)
    low = ball_points(dice, np.array([0.0, 0.0, 20.0]), 14.9, 1500)
    high = ball_points(dice, np.array([0.0, 0.0, 120.0]), 15.0, 3000)
    survey = Survey(np.concatenate([high, low]))
    sizes = (Length(29.8, 0.001), Length(30.0, 0.001))
    values = values_of(Artefact("ball-bar", "b", sizes, Length(100.0, 0.001)), survey)
    assert all(abs(v.value) < 1e-3 for v in values if v.test in ("size", "distance"))


def test_repeatability_is_the_standard_deviation_over_the_scans() -> None:
    dice = np.random.default_rng(2)
    scans = [bar(dice) for _ in range(4)]
    assert repeatability(scans[:1]) == []
    made = repeatability(scans, 0.0001)
    sizes = [s[2].value for s in scans]
    assert made[2].value == pytest.approx(np.std(sizes, ddof=1))
    assert made[2].exceeded


GOOD = """
format = "turnscan-artefact"
version = 1
kind = "ball-bar"
name = "bar"
measured = "J. Doe"
diameters_mm = [30.0, 29.9]
diameters_U_mm = 0.01
distance_mm = 100.0
distance_U_mm = 0.02
form_mm = 0.003
[limits_mm]
size = 0.05
[drift]
scatter_mm = 0.004
"""


def test_an_artefact_is_read_with_half_of_its_expanded_uncertainties() -> None:
    a = artefact_from_text(GOOD, "bar.toml")
    assert a.diameters == (Length(30.0, 0.005), Length(29.9, 0.005))
    assert artefact_from_text(json.dumps(tomllib.loads(GOOD)), "bar.json") == a
    assert a.distance == Length(100.0, 0.01)
    assert (a.form, a.limits, a.scatter) == (0.003, {"size": 0.05}, 0.004)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[30.0, 29.9]", "[-30.0, 29.9]", "diameters_mm = -30.0, expected mm above 0"),
        ("[30.0, 29.9]", "[30.0]", "diameters_mm: 1 values, expected 2"),
        ("[30.0, 29.9]", "nan", "diameters_mm = nan"),
        ("[30.0, 29.9]", '"30"', "diameters_mm = '30'"),
        ("distance_U_mm = 0.02", "", "distance_U_mm is missing"),
        ("distance_U_mm = 0.02", "distance_U_mm = 0", "distance_U_mm = 0"),
        ("distance_U_mm = 0.02", "distance_U_mm = 200", "not below the length"),
        ('"ball-bar"', '"teapot"', "kind 'teapot'"),
        ("version = 1", "version = 2", "version 2"),
        ('"turnscan-artefact"', '"other"', "not an artefact file"),
        ("size = 0.05", "size = 0", "limits_mm.size = 0"),
        ("size = 0.05", "flatness = 1", "no 'flatness'"),
        ("form_mm", "from_mm", "'from_mm' has no meaning"),
        ('name = "bar"', "", "name is missing"),
        ("[limits_mm]", "[limits_mm", "bar.toml"),
    ],
)
def test_a_wrong_artefact_file_is_one_line_that_names_the_value(
    old: str, new: str, said: str
) -> None:
    assert old in GOOD
    with pytest.raises(FormatError) as e:
        artefact_from_text(GOOD.replace(old, new, 1), "bar.toml")
    assert said in str(e.value)
    assert "\n" not in str(e.value)
