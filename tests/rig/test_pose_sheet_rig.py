"""Poses compose, sheets are hit where they are, and a rig moves along its parameters."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from turnscan.rig import (
    LaserSheet,
    Pose,
    Rig,
    TableMotion,
    Wobble,
    design_preset,
    rotation_about,
    rotation_from_vector,
    rotation_z,
)

vectors = hnp.arrays(float, 3, elements=st.floats(-3, 3))
poses = st.builds(lambda r, t: Pose(rotation_from_vector(r), 100 * t), vectors, vectors)


@given(poses, poses, poses)
@settings(max_examples=60)
def test_pose_algebra(T_ab: Pose, T_bc: Pose, T_cd: Pose) -> None:
    x = np.array([[1.0, -2.0, 3.0], [40.0, 0.0, -7.0]])
    np.testing.assert_allclose((T_ab @ T_bc).apply(x), T_ab.apply(T_bc.apply(x)), atol=1e-9)
    left, right = (T_ab @ T_bc) @ T_cd, T_ab @ (T_bc @ T_cd)
    np.testing.assert_allclose(left.rotation, right.rotation, atol=1e-12)
    np.testing.assert_allclose(left.translation, right.translation, atol=1e-9)
    np.testing.assert_allclose(T_ab.inverse().apply(T_ab.apply(x)), x, atol=1e-9)
    np.testing.assert_allclose(T_ab.turn(x), T_ab.apply(x) - T_ab.translation, atol=1e-9)
    assert np.linalg.det(T_ab.rotation) == pytest.approx(1.0)


@given(vectors)
def test_rotation_vector(r: np.ndarray) -> None:
    R = rotation_from_vector(r)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(R @ r, r, atol=1e-12)
    assert np.trace(R) == pytest.approx(1 + 2 * np.cos(np.linalg.norm(r)))


def test_rotations_turn_counter_clockwise() -> None:
    np.testing.assert_allclose(rotation_z(np.pi / 2) @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(rotation_about([0, 0, 2.0], 0.3), rotation_z(0.3), atol=1e-15)
    assert rotation_z(np.zeros((4, 5))).shape == (4, 5, 3, 3)


@pytest.mark.parametrize("axis", [[0.0, 0.0, 0.0], [np.nan, 0.0, 1.0], [1.0, 2.0]])
def test_an_axis_without_direction_is_refused(axis: list[float]) -> None:
    with pytest.raises(ValueError, match="axis"):
        rotation_about(axis, 1.0)


@pytest.mark.parametrize("R", [np.diag([1.0, 1.0, -1.0]), 2 * np.eye(3), np.zeros((3, 3))])
def test_improper_rotations_are_refused(R: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"Pose\.rotation"):
        Pose(R)


bows = hnp.arrays(float, 3, elements=st.floats(-2e-4, 2e-4))


@given(bows, st.floats(-0.8, 0.8), st.floats(-0.3, 0.3))
@settings(max_examples=80)
def test_rays_meet_the_bent_sheet(bow: np.ndarray, turn: float, lean: float) -> None:
    normal = rotation_from_vector([lean, turn, 0.0]) @ [1.0, 0.0, 0.0]
    sheet = LaserSheet("red", normal, [5.0, -3.0, 420.0], bow)
    e1, e2 = sheet.axes
    np.testing.assert_allclose(np.stack([sheet.normal, e1, e2]) @ e1, [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(np.cross(sheet.normal, e1), e2, atol=1e-12)
    # Truth made forwards: points on the bent surface, then the rays through them.
    a, b = (g.ravel() for g in np.meshgrid(np.linspace(-80, 80, 9), np.linspace(-60, 60, 7)))
    away = bow[0] * a * a + bow[1] * a * b + bow[2] * b * b
    points = sheet.centre + np.outer(a, e1) + np.outer(b, e2) + np.outer(away, sheet.normal)
    np.testing.assert_allclose(sheet.distance(points), 0.0, atol=1e-9)
    rays = points / points[:, 2:]
    # A grazing ray can meet a bent sheet twice; keep those that come clearly from one side.
    clear = np.abs(np.einsum("ij,ij->i", sheet.gradient(points), rays)) > 0.25
    hit = sheet.intersect(rays)
    np.testing.assert_allclose(hit[clear], points[clear], atol=1e-7)


def test_gradient_is_the_derivative_of_distance() -> None:
    sheet = LaserSheet("red", [0.8, 0.1, 0.6], [5, -3, 420.0], [1e-4, -5e-5, 2e-4])
    X, h = np.array([[10.0, 20.0, 400.0], [-30.0, 5.0, 450.0]]), 1e-4
    for i in range(3):
        step = h * np.eye(3)[i]
        slope = (sheet.distance(X + step) - sheet.distance(X - step)) / (2 * h)
        np.testing.assert_allclose(sheet.gradient(X)[:, i], slope, atol=1e-8)


def test_rays_that_miss() -> None:
    flat = LaserSheet("red", [1.0, 0.0, 0.0], [10.0, 0.0, 400.0])
    hit = flat.intersect([[0.02, 0, 1], [0.0, 0, 1], [-0.02, 0, 1], [np.nan, 0, 1]])
    assert np.isfinite(hit).all(axis=-1).tolist() == [True, False, False, False]
    np.testing.assert_allclose(hit[0], [10.0, 0.0, 500.0])
    bent = LaserSheet("red", [0.0, 0.0, 1.0], [0.0, 0.0, 400.0], [0.1, 0.0, 0.0])
    up = bent.intersect([[0.0, 0.0, 1.0], [0.0, 1.0, 0.2], [0.2, 0.0, 1.0]])
    assert np.isfinite(up[0]).all()
    assert np.isnan(up[1]).all(), "this ray runs below the trough and never meets it"
    assert flat.intersect(np.empty((0, 3))).shape == (0, 3)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"name": ""}, "name"),
        ({"normal": [0.0, 0.0, 0.0]}, "normal"),
        ({"centre": [0.0, np.nan, 0.0]}, "centre"),
        ({"bow": [0.0]}, "bow"),
    ],
)
def test_impossible_sheets_are_refused_by_name(change: dict[str, Any], named: str) -> None:
    good = {"name": "red", "normal": [1.0, 0, 0], "centre": [0, 0, 1.0]}
    with pytest.raises(ValueError, match=named):
        LaserSheet(**good | change)


def _rig() -> Rig:
    d = design_preset("modern")
    return d.rig(height=60.0, both=True)


def test_perturbed_by_nothing_changes_nothing() -> None:
    rig = _rig()
    same = rig.perturbed(np.zeros(len(rig.parameter_names)))
    np.testing.assert_allclose(same.T_camera_table.rotation, rig.T_camera_table.rotation)
    assert same.camera.fx == rig.camera.fx
    np.testing.assert_array_equal(same.sheets[1].normal, rig.sheets[1].normal)


@pytest.mark.parametrize("name", _rig().parameter_names)
def test_each_parameter_moves_what_it_names(name: str) -> None:
    rig = _rig()
    names = rig.parameter_names
    size = 1e-3
    delta = np.where(np.array(names) == name, size, 0.0)
    assert delta.sum() == size
    moved = rig.perturbed(delta)
    part, _, which = name.partition(".")
    for was, now in zip(rig.sheets, moved.sheets, strict=True):
        changed = not (
            np.array_equal(was.normal, now.normal)
            and np.array_equal(was.centre, now.centre)
            and np.array_equal(was.bow, now.bow)
        )
        assert changed == (part == was.name)
        e1, e2 = was.axes
        if part == was.name and which == "offset":
            np.testing.assert_allclose(now.distance(was.centre), -size, rtol=1e-9)
        if part == was.name and which == "turn_along":
            np.testing.assert_allclose(
                (now.normal - was.normal) @ np.cross(e1, was.normal), size, rtol=1e-6
            )
        if part == was.name and which == "turn_across":
            np.testing.assert_allclose(
                (now.normal - was.normal) @ np.cross(e2, was.normal), size, rtol=1e-6
            )
    T, U = rig.T_camera_table, moved.T_camera_table
    if which.startswith("shift"):
        np.testing.assert_allclose(np.abs(U.translation - T.translation).sum(), size)
        np.testing.assert_array_equal(U.rotation, T.rotation)
    if part == "table" and which in ("turn_x", "turn_y", "turn_z"):
        angle = np.arccos((np.trace(U.rotation @ T.rotation.T) - 1) / 2)
        assert angle == pytest.approx(size, rel=1e-6)
    if part == "camera":
        row = {"fx": "fx", "fy": "fy", "cx": "cx", "cy": "cy"}.get(which)
        if row:
            assert getattr(moved.camera, row) - getattr(rig.camera, row) == pytest.approx(size)
        else:
            change = np.concatenate([moved.camera.distortion, moved.camera.tilt])
            assert np.count_nonzero(change) == 1


def test_perturbed_wants_every_parameter() -> None:
    with pytest.raises(ValueError, match="delta"):
        _rig().perturbed(np.zeros(3))


@pytest.mark.parametrize("name", ["paper", "modern", "ciclop"])
def test_light_comes_from_its_source_or_from_beside_the_camera(name: str) -> None:
    rig = design_preset(name).rig(height=60.0, look_down=0.2, both=True)
    table = rig.T_camera_table.inverse()
    eye = table.translation
    for sheet in rig.sheets:
        there = rig.light_source(sheet.name)
        assert abs(float(sheet.distance(there))) < 1e-9
        at = table.apply(there)
        assert at[2] == pytest.approx(eye[2])
        assert np.hypot(*at[:2]) == pytest.approx(np.hypot(*eye[:2]), rel=1e-6)
        assert at @ eye > 0  # on the camera's side of the axis
    told = replace(rig, sheets=tuple(replace(s, source=[1.0, 2.0, 3.0]) for s in rig.sheets))
    assert told.light_source("right").tolist() == [1.0, 2.0, 3.0]
    moved = told.perturbed(np.full(len(told.parameter_names), 1e-3))
    assert moved.light_source("left").tolist() == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("shift", [(0.0, 0.0), (40.0, 0.0), (-25.0, 10.0), (0.0, -60.0)])
def test_the_light_does_not_move_with_the_point_that_names_a_sheet(
    shift: tuple[float, float],
) -> None:
    """Any of its points describes a flat sheet as well as any other."""
    rig = design_preset("paper").rig(height=60.0, look_down=0.2, both=True)
    T = rig.T_camera_table
    for sheet in rig.sheets:
        e1, e2 = sheet.axes
        centre = sheet.centre + shift[0] * e1 + shift[1] * e2 + 3.0 * sheet.normal
        beside = replace(sheet, centre=sheet.centre + 3.0 * sheet.normal)
        moved = replace(sheet, centre=centre)
        there = replace(rig, sheets=(moved,)).light_source(sheet.name)
        assert there == pytest.approx(replace(rig, sheets=(beside,)).light_source(sheet.name))
        assert abs(float(moved.distance(there))) < 1e-9
        assert T.inverse().apply(there)[2] == pytest.approx(T.inverse().translation[2])


def test_a_rig_names_its_lasers() -> None:
    rig = _rig()
    assert rig.sheet("left").name == "left"
    with pytest.raises(KeyError, match=r"green.*right.*left"):
        rig.sheet("green")
    with pytest.raises(ValueError, match="same name"):
        Rig(rig.camera, (rig.sheets[0], rig.sheets[0]), rig.T_camera_table)
    with pytest.raises(ValueError, match="covariance"):
        Rig(rig.camera, rig.sheets, rig.T_camera_table, covariance=np.eye(3))


def test_what_a_notebook_shows_says_how_drive_and_axis_move() -> None:
    assert "drive" not in _rig().html()
    motion = TableMotion(np.radians([[0.0, 0.5]]), backlash=math.radians(0.25))
    wobble = Wobble(tilt=np.radians([0.1, 0.0]), shift=np.array([0.0, 0.2]))
    shown = replace(_rig(), motion=motion, wobble=wobble).html().replace("&nbsp;", " ")
    assert "off an even turn by -0.500° to +0.500°, backlash 0.250°" in shown
    # Across by 0.2 mm, and the rim up and down by 50 mm · 0.1°.
    assert f"tilts by 0.100° in a turn, moves by up to {math.hypot(0.2, 0.0873):.3f} mm" in shown
