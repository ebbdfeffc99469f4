"""Set-ups that cannot give a rig are refused, each by its own name and soon."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from tests.calibrate.bodies import (
    Body,
    bar,
    both,
    cone,
    cylinder,
    doubted,
    prism,
    ruled,
    sphere,
    two_lasers,
)
from tests.calibrate.world import CAMERA, SHAPE, World, true_layout, true_rig
from turnscan.arrays import Floats
from turnscan.calibrate import (
    Balls,
    BoardView,
    Calibration,
    CalibrationSettings,
    KnownRig,
    LaserPicture,
    MarkerView,
    Refined,
    RefineSettings,
    Round,
    TablePicture,
    angle_model,
    calibrate_rig,
    figures,
    findings_of,
    refine,
)
from turnscan.calibrate._bodies import Form, Known
from turnscan.calibrate._layout import MarkerLayout
from turnscan.calibrate._steps import AngleModel
from turnscan.errors import CalibrationError
from turnscan.rig import LaserSheet, Pose, rotation_from_vector

SETTINGS = CalibrationSettings(marker_side=27.5)
TURN = np.arange(16) * np.pi / 8
STEPS = np.radians(np.arange(0.0, 360.0, 9.0))


def world(seed: int = 1) -> World:
    return World(true_rig(), np.random.default_rng(seed), 0.1)


@cache
def known() -> KnownRig:
    """A rig whose uncertainty is what two dozen pictures give."""
    rig = true_rig()
    sigma = dict.fromkeys(rig.parameter_names, 0.0)
    sigma |= {"camera.fx": 0.5, "camera.fy": 0.5, "camera.cx": 0.5, "camera.cy": 0.5}
    sigma |= {"laser.turn_along": 1e-3, "laser.turn_across": 1e-3, "laser.offset": 0.1}
    return KnownRig(replace(rig, covariance=np.diag(np.array(list(sigma.values())) ** 2)))


def boards(poses: Sequence[Pose]) -> list[BoardView]:
    w = world()
    return [w.board_view(T, name=f"c{k}") for k, T in enumerate(poses)]


def lit(poses: Sequence[Pose], w: World | None = None) -> list[LaserPicture]:
    w = w or world()
    return [
        LaserPicture(w.board_view(T, name=f"l{k}"), w.board_stripe(T).pixels)
        for k, T in enumerate(poses)
    ]


def table(
    angles: Floats,
    layout: MarkerLayout | None = None,
    seen: Callable[[int], slice] = lambda k: slice(None),
    w: World | None = None,
    first: int = 0,
) -> list[TablePicture]:
    w, out = w or world(), []
    for k, angle in enumerate(angles):
        v = w.rider_view(layout or true_layout(), float(angle), 3.0)
        markers = MarkerView(v.numbers[seen(k)], v.corners.reshape(-1, 4, 2)[seen(k)])
        lines = {"laser": v.stripes[0].pixels}
        out.append(TablePicture(markers, lines, f"t{first + k}", float(first + k)))
    return out


def camera_of(views: Sequence[BoardView]) -> Calibration:
    return calibrate_rig(views, {}, [], SETTINGS)


def laser_of(pictures: Sequence[LaserPicture]) -> Calibration:
    return calibrate_rig([], {"laser": pictures}, [], SETTINGS, known=known())


def table_of(pictures: Sequence[TablePicture]) -> Calibration:
    return calibrate_rig([], {}, pictures, SETTINGS, known=known())


def facing(count: int) -> list[Pose]:
    return [
        Pose(rotation_from_vector(np.array([0, 0, 0.2 * k - 1])), np.array([-100.0, -60, 700]))
        for k in range(count)
    ]


def in_one_plane(count: int) -> list[Pose]:
    return [Pose(np.eye(3), np.array([6.0 * k - 140, 4 * k - 120, 650])) for k in range(count)]


def two_lasers_mixed() -> list[LaserPicture]:
    other = true_rig()
    n = other.T_camera_table.turn(np.array([np.cos(0.5), np.sin(0.5), 0.0]))
    sheet = LaserSheet("laser", n, other.T_camera_table.translation)
    second = World(replace(other, sheets=(sheet,)), np.random.default_rng(2), 0.1)
    return lit(world().board_poses(6)) + lit(world(3).board_poses(6), second)


AXIS_MARKER = MarkerLayout(np.array([5], np.int32), np.array([[0.0, 0.0, 0.3, 27.4]]), SHAPE)
_LASER_SAME = "laser 'laser': the stripe was seen on .* always at nearly the same place"


def refined(lasers: int, radius: float | None = None) -> Refined:
    rig = two_lasers(lasers=lasers)
    sweeps = both(rig, prism((5.0, 2.0), 40.0), STEPS, STEPS, 1, every=12)
    size = None if radius is None else (Balls(), ((radius, 0.01),))
    return refine(rig, sweeps, RefineSettings(queries=500, body=size))


def ruled_body(body: Body, form: Form, known: tuple[Known | None, ...], lasers: int = 2) -> Refined:
    """A rig as a ruler knows it, by one body."""
    true, some = two_lasers(lasers=lasers), STEPS[::2]
    sweeps = both(true, body, some, some, 3, every=10)
    return refine(ruled(true, 1), sweeps, RefineSettings(queries=400, rounds=6, body=(form, known)))


def free_camera(size: float) -> Refined:
    """A ball by a rig of a ruler whose lens is known to so much of its focal length."""
    true = two_lasers()
    known = doubted(true)
    assert known.covariance is not None
    sigma = np.sqrt(np.diag(known.covariance))
    for k, name in enumerate(true.parameter_names):
        if name in ("camera.fx", "camera.fy", "camera.cx", "camera.cy"):
            sigma[k] = size * true.camera.fx
    rig = replace(ruled(true, 1, known), covariance=np.diag(sigma**2))
    sweeps = both(true, BESIDE, STEPS[::2], STEPS[::2], 3, every=10)
    body = (Balls(), ((18.0, 0.002),))
    return refine(rig, sweeps, RefineSettings(camera=True, queries=400, rounds=6, body=body))


def upright_cone(points: Floats) -> Floats:
    r = np.hypot(points[..., 0], points[..., 1])
    return np.asarray(r - (20.0 - points[..., 2] * np.tan(np.radians(12.0))))


def wall(points: Floats) -> Floats:
    """One plane."""
    return np.asarray(points @ [0.05, 0.9, 0.43] - 12.0)


def axis_by_a_plane() -> Refined:
    true = two_lasers()
    known = doubted(true)
    assert known.covariance is not None
    table = [n.startswith("table.") for n in true.parameter_names]
    known = replace(known, covariance=known.covariance * np.outer(table, table))
    sweeps = both(true, wall, STEPS, STEPS, 3, every=10)
    return refine(ruled(true, 1, known), sweeps, RefineSettings(queries=400, rounds=6))


def unlit() -> list[LaserPicture]:
    return [LaserPicture(p.view, np.zeros((0, 2))) for p in lit(world().board_poses(4))]


def alone(k: int) -> slice:
    return slice(k % 4, k % 4 + 1)


def disorder() -> AngleModel:
    return angle_model(np.random.default_rng(1).uniform(-3, 3, 40), np.full(40, 1e-3))


CENTRED, BESIDE = sphere((0.0, 0.0, 22.0), 18.0), sphere((14.0, 3.0, 22.0), 18.0)
_SAME = "camera: .* same direction"
_SET_UPS: list[tuple[str, Callable[[], object], str]] = [
    ("two boards", lambda: camera_of(boards(world().board_poses(2))), "camera: .* in 2 of 2"),
    ("copies", lambda: camera_of(boards(world().board_poses(1)) * 8), "camera: .* in 1 of 8"),
    ("held still", lambda: camera_of(boards(world().board_poses(1) * 8)), _SAME),
    ("parallel", lambda: camera_of(boards(world().board_poses(8, 0.0))), _SAME),
    ("hardly tilted", lambda: camera_of(boards(world().board_poses(8, 3.0))), _SAME),
    ("turned in itself", lambda: camera_of(boards(facing(8))), _SAME),
    ("one stripe", lambda: laser_of(lit(world().board_poses(1))), "laser 'laser': .* on 1 boards"),
    ("no stripe", lambda: laser_of(unlit()),
     "laser 'laser': .* on 0 boards"),
    ("laser, one pose", lambda: laser_of(lit(world().board_poses(1) * 6)), _LASER_SAME),
    ("laser, one plane", lambda: laser_of(lit(in_one_plane(6))), _LASER_SAME),
    ("mixed lasers", lambda: laser_of(two_lasers_mixed()), "pictures of two lasers are mixed"),
    ("table, three", lambda: table_of(table(TURN[:3])), "table: 3 of 3"),
    ("table at rest", lambda: table_of(table(np.zeros(8))), "table: it hardly turns"),
    ("table, 5°", lambda: table_of(table(np.radians(np.linspace(0, 5, 8)))), "table: it hardly"),
    ("no marker", lambda: table_of(table(TURN, None, lambda k: slice(0, 0))), "table: 0 of 16"),
    ("marker on the axis", lambda: table_of(table(TURN, AXIS_MARKER)),
     "table: all markers lie on the rotation axis"),
    ("one marker a picture", lambda: table_of(table(TURN, None, alone)),
     "cannot separate these: .*(platter|table)"),
    ("no order", disorder,
     "table angles: no uniform motion"),
    ("one step number", lambda: angle_model(np.zeros(8), np.full(8, 1e-3), np.zeros(8)),
     "table angles: all pictures have the same step"),
    ("four angles", lambda: angle_model(np.arange(4) / 10, np.full(4, 1e-3)), "angles: 4 of 4"),
    ("one laser, no body", lambda: refined(1),
     "no two surfaces overlap"),
    ("body of another size", lambda: refined(2, 40.0),
     "no sphere of 80 mm"),
    ("ball about the axis, one laser", lambda: ruled_body(CENTRED, Balls(), ((18.0, 0.002),), 1),
     "the sphere stands about the rotation axis"),
    ("ball about the axis", lambda: ruled_body(CENTRED, Balls(), ((18.0, 0.002),)),
     "the sphere stands about the rotation axis"),
    ("cylinder about the axis, one laser",
     lambda: ruled_body(cylinder((0.0, 0.0), 15.0), Round(), ((15.0, 0.002),), 1),
     "the cylinder stands about the rotation axis"),
    ("cylinder about the axis",
     lambda: ruled_body(cylinder((0.0, 0.0), 15.0), Round(), ((15.0, 0.002),)),
     "the cylinder stands about the rotation axis"),
    ("cone about the axis",
     lambda: ruled_body(upright_cone, Round(conical=True), ((20.0, 0.002), None)),
     "the cone stands about the rotation axis"),
    ("cone alone, one laser",
     lambda: ruled_body(cone, Round(conical=True), ((20.0, 0.002), None), 1),
     "alone, the cone says too little"),
    ("ball almost about the axis",
     lambda: ruled_body(sphere((0.5, -0.35, 22.0), 18.0), Balls(), ((18.0, 0.001),), 1),
     "the sphere stands so that it says too little"),
    ("free camera", lambda: free_camera(0.03), "camera its rays may be off by 2.4°"),
    ("wholly free camera", lambda: free_camera(1.0), "next to nothing of the lens"),
    ("plane alone", axis_by_a_plane, "no two surfaces overlap"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "attempt", "says"), _SET_UPS)
def test_refused_by_name(name: str, attempt: Callable[[], object], says: str) -> None:
    with pytest.raises(CalibrationError, match=says) as caught:
        attempt()
    assert caught.value.hint, name


@pytest.mark.parametrize(
    ("body", "form", "known", "scale"),
    [
        (BESIDE, Balls(), (None,), True),
        (BESIDE, Balls(), ((18.0, 0.001),), False),
        (bar, Balls(2), ((10.0, 0.005), (10.0, 0.005), (38.0, 0.002)), False),
        (cylinder((9.0, 2.0), 14.0, 20.0), Round(), (None,), True),
    ],
    ids=["ball", "ball of known size", "ball bar", "tilted cylinder"],
)
def test_what_is_no_fault_is_not_refused(
    body: Body, form: Form, known: tuple[Known | None, ...], scale: bool
) -> None:
    """One laser and a body beside the axis leave the scale open, where no size is known."""
    done = ruled_body(body, form, known, 1)
    assert ("scale" in done.held) == scale
    assert done.shape_after < 0.005 * done.shape_before


def test_there_are_twenty() -> None:
    assert len(_SET_UPS) >= 20


def test_a_camera_that_moved_in_between_is_said() -> None:
    T = true_rig().T_camera_table
    turned = rotation_from_vector(np.array([0, 0.02, 0])) @ T.rotation
    moved = replace(true_rig(), T_camera_table=Pose(turned, T.translation + [5.0, 0, 0]))
    second = World(moved, np.random.default_rng(3), 0.1)
    c = table_of(table(TURN[:8]) + table(TURN[8:], w=second, first=8))
    found = {f.code: f for f in findings_of(c, figures(c))}
    assert found["calibrate.table-residual"].severity == "warning"
    assert " px" in found["calibrate.table-residual"].where
    good = table_of(table(TURN))
    assert "calibrate.table-residual" not in [f.code for f in findings_of(good, figures(good))]


def test_another_focus_is_said() -> None:
    other = replace(true_rig(), camera=replace(CAMERA, fx=700.0, fy=698.0))
    w = World(other, np.random.default_rng(2), 0.1)
    c = laser_of(lit(w.board_poses(6), w))
    assert "calibrate.camera-residual" in [f.code for f in findings_of(c, figures(c))]
