"""The axis's own motion: what it is, what of it is harmless, and how it is told from elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.analytic import make_rig
from turnscan.detection import wobble_findings
from turnscan.points import pixels_of, rig_moves, to_object
from turnscan.rig import (
    Pose,
    Rig,
    Wobble,
    rotation_from_vector,
    rotation_z,
)

small = st.floats(-2e-3, 2e-3)
mm = st.floats(-0.3, 0.3)
wobbles = st.builds(
    lambda *v: Wobble.of(v), small, small, mm, mm, mm, mm,
)  # fmt: skip
angles = st.floats(-7.0, 7.0)
POINTS = np.array([[30.0, 5.0, 2.0], [-10.0, 25.0, 40.0], [4.0, -18.0, 70.0]])


@given(wobbles, angles)
def test_it_is_a_turn_and_a_shift_that_go_round_against_the_table(w: Wobble, a: float) -> None:
    turn, shift = replace(make_rig(), wobble=w).turning(a)
    back = rotation_z(-a)
    tilt = rotation_from_vector(back @ [*w.tilt, 0.0])
    assert turn == pytest.approx(tilt @ rotation_z(a), abs=1e-14)
    rise = w.rise @ [np.cos(a), np.sin(a)]
    assert shift == pytest.approx(back @ [*w.shift, 0.0] + [0.0, 0.0, rise], abs=1e-14)


@given(wobbles, angles)
def test_points_come_back_from_where_they_are_seen(w: Wobble, a: float) -> None:
    rig = replace(make_rig(elevation=0.4), wobble=w)
    turn, shift = rig.turning(a)
    seen = rig.T_camera_table.apply(POINTS @ turn.T + shift)
    assert to_object(rig, seen, a) == pytest.approx(POINTS, abs=1e-10)
    many = np.full(len(POINTS), a)
    assert pixels_of(rig, POINTS, many) == pytest.approx(rig.camera.project(seen), abs=1e-9)


@given(wobbles, angles)
def test_slopes_are_those_of_the_motion(w: Wobble, a: float) -> None:
    turns, shifts = Wobble.slopes(a)
    for k in range(6):
        h = 1e-6 * np.eye(6)[k]
        (R1, s1), (R0, s0) = (Wobble.of(w.values + x).motion(a) for x in (h, -h))
        assert (s1 - s0) / 2e-6 == pytest.approx(shifts[k], abs=1e-8)
        swing = (R1 - R0) @ R0.T / 2e-6
        vector = [swing[2, 1], swing[0, 2], swing[1, 0]]
        assert vector == pytest.approx(turns[k], abs=5e-3)


@given(wobbles, st.floats(-60.0, 60.0))
def test_from_another_height_it_is_the_same_motion(w: Wobble, height: float) -> None:
    """To first order: what is left is a product of two small angles."""
    rig, lower = make_rig(), make_rig()
    up = rig.T_camera_table.rotation[:, 2] * height
    T = rig.T_camera_table
    lower = replace(
        rig, T_camera_table=Pose(T.rotation, T.translation + up), wobble=w.lifted(height)
    )
    rig = replace(rig, wobble=w)
    seen = T.apply(POINTS)
    for a in np.arange(0.0, 6.0, 0.7):
        one, other = to_object(rig, seen, a), to_object(lower, seen, a) + [0.0, 0.0, height]
        assert one == pytest.approx(other, abs=60.0 * float(w.tilt @ w.tilt) + 1e-9)


def _places(rig: Rig, seen: np.ndarray, turned: np.ndarray) -> np.ndarray:
    return np.array([to_object(rig, p, a) for p, a in zip(seen, turned, strict=True)])


def test_it_bends_what_a_table_that_leans_and_runs_in_a_circle_does_not() -> None:
    """Points of a rigid part, each seen at another angle: are they still rigid?"""
    rig, dice = make_rig(elevation=0.4), np.random.default_rng(3)
    part, turned = dice.uniform(-30, 30, (60, 3)), np.arange(60) * 2 * np.pi / 60
    lean, circle = rotation_from_vector([4e-3, -2e-3, 0.0]), np.array([0.2, -0.1, 0.0])
    goes_round = [rotation_z(a) @ (lean @ p + circle) for p, a in zip(part, turned, strict=True)]
    tilt, shift = [2e-3, 1e-3], [0.1, -0.05]
    w = Wobble(np.array(tilt), np.array(shift), np.array([0.05, 0.08]))
    against = [
        w.motion(a)[0] @ rotation_z(a) @ p + w.motion(a)[1]
        for p, a in zip(part, turned, strict=True)
    ]
    # Of shift, rise and tilt 25 mm from the axis: √(0.11² + 0.09²/2 + 0.05²) mm.
    T = rig.T_camera_table
    for seen, bent in ((goes_round, 0.0), (against, 0.14)):
        at = _places(rig, T.apply(np.array(seen)), turned)
        middle, about = at - at.mean(axis=0), part - part.mean(axis=0)
        u, _, vt = np.linalg.svd(middle.T @ about)
        left = np.linalg.norm(middle - about @ (u @ vt).T, axis=1)
        assert np.sqrt(np.mean(left**2)) == pytest.approx(bent, abs=0.02 if bent else 1e-9)
    known = replace(rig, wobble=w)
    assert _places(known, T.apply(np.array(against)), turned) == pytest.approx(part, abs=1e-9)


def test_its_uncertainty_moves_points() -> None:
    rig = replace(make_rig(elevation=0.4), wobble=Wobble())
    sigma = np.zeros(len(rig.parameter_names))
    at = rig.parameter_names.index(Wobble.NAMES[2])
    sigma[at] = 0.02
    rig = replace(rig, covariance=np.diag(sigma**2))
    turned = np.radians([0.0, 90.0, 180.0])
    pixels = pixels_of(rig, POINTS, turned)
    (field,) = rig_moves(rig, "L0", pixels, turned)
    assert np.linalg.norm(field, axis=1) == pytest.approx(0.02, rel=1e-6)
    # Against the turn, told in the part that turns: twice round.
    along = field[:, :2] / field[0, 0]
    assert along == pytest.approx(np.array([[1, 0], [-1, 0], [1, 0]]), abs=1e-6)


def test_reach_is_the_farthest_that_a_place_on_a_rim_is_off() -> None:
    assert Wobble(rise=np.array([0.03, 0.04])).reach(50.0) == pytest.approx(0.05, rel=2e-3)
    assert Wobble(shift=np.array([0.03, 0.04])).reach(50.0) == pytest.approx(0.05)
    assert Wobble(tilt=np.array([1e-3, 0.0])).reach(50.0) == pytest.approx(0.05, rel=2e-3)
    assert Wobble().reach(50.0) == 0.0


def test_of_an_axis_that_moves_it_is_said_that_angles_must_count_from_where_they_did() -> None:
    rig = make_rig()
    moves = replace(rig, wobble=Wobble(rise=np.array([0.03, 0.04])))
    assert wobble_findings("L0", rig, 72, 72) == wobble_findings("L0", moves, 72, 0) == []
    (said,) = wobble_findings("L0", moves, 72, 70)
    assert (said.code, said.severity) == ("points.wobble-start", "note")
    assert "0.05 mm, 50 mm from it" in said.message
    assert "70 of 72 angles" in said.message
