"""The axis's own motion in a calibration: found where it is, with its uncertainty, and not else."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
import pytest
from bench._rigs import BOARD as PRINTED
from bench._rigs import PRINT
from bench.calibration._worlds import SMALL, USUAL, Pictures
from bench.calibration.wobble import BOX, off_box
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.analytic import full_turn, scan_shape, with_noise
from tests.calibrate.world import World, problem, true_layout, true_rig
from turnscan.arrays import Floats
from turnscan.calibrate import (
    BoardView,
    Calibration,
    CalibrationSettings,
    KnownRig,
    LaserPicture,
    MarkerView,
    TablePicture,
    calibrate_rig,
    detect_board,
    figures,
    findings_of,
)
from turnscan.calibrate._angle import table_angle
from turnscan.calibrate._board import Chessboard
from turnscan.calibrate._layout import BoardLayout
from turnscan.calibrate._observations import RigNetwork
from turnscan.calibrate._parameters import parameters_of
from turnscan.calibrate._state import RiderView, State
from turnscan.points import RangeGrid, build_grid, systematic_sigma
from turnscan.rig import Pose, Rig, Wobble, rotation_from_vector, rotation_z
from turnscan.simulate import Renderer, bench, seconds_of, spec_of

MOVES = Wobble(np.radians([0.05, -0.03]), np.array([0.08, 0.03]), np.array([0.03, -0.04]))
WILD = Wobble.of(3.0 * MOVES.values)
"""As a table of plywood has on a bearing for furniture."""
LYING = Chessboard(9, 7, 14.0)


def pictures(world: World, many: Pictures, turn: float = 2 * np.pi) -> tuple[list, dict, list]:  # type: ignore[type-arg]
    """Boards, boards under the laser, and stops of the table that are spread over a ``turn``."""
    free, under = world.board_poses(many.camera), world.board_poses(many.laser)
    camera = [world.board_view(T, name=f"c{k}") for k, T in enumerate(free)]
    laser = [
        LaserPicture(world.board_view(T, name=f"l{k}"), world.board_stripe(T).pixels)
        for k, T in enumerate(under)
    ]
    return camera, {"laser": laser}, stops(world, many.table, turn)


def stops(world: World, many: int, turn: float = 2 * np.pi) -> list[TablePicture]:
    layout, table = true_layout(), []
    for k, angle in enumerate(np.arange(many) * turn / many):
        seen = world.rider_view(layout, float(angle), every=1.0)
        markers = MarkerView(layout.numbers, seen.corners.reshape(-1, 4, 2))
        table.append(TablePicture(markers, {"laser": seen.stripes[0].pixels}, f"t{k}", k))
    return table


def calibrated(world: World, many: Pictures, turn: float = 2 * np.pi) -> Calibration:
    return calibrate_rig(*pictures(world, many, turn), CalibrationSettings())


@cache
def known(seed: int = 1) -> Calibration:
    """A rig whose axis moves as `MOVES` says, calibrated."""
    world = World(replace(true_rig(), wobble=MOVES), np.random.default_rng(seed), 0.1)
    return calibrated(world, USUAL)


def off(rig: Rig, truth: Wobble) -> tuple[Floats, Floats]:
    """(6,) errors of the parameters, and their covariance."""
    assert rig.wobble is not None
    assert rig.covariance is not None
    k = rig.parameter_names.index(Wobble.NAMES[0])
    return rig.wobble.values - truth.values, rig.covariance[k : k + 6, k : k + 6]


@pytest.mark.parametrize("board", [False, True])
def test_derivatives_are_those_of_the_residuals(board: bool) -> None:
    network, state, world = (on_board if board else partial(problem, 1, 1e-9, 4))()
    rig = replace(state.rig, wobble=Wobble.of(0.3 * MOVES.values))
    network, state = replace(network, wobble=True), replace(state, rig=rig)
    own = [np.zeros(q) for q in network.own_sizes]
    blocks = network.blocks(state)
    for name, size in zip(Wobble.NAMES, (1e-5, 1e-5, *[1e-3] * 4), strict=True):
        k = network.names.index(name)
        step = np.zeros(len(network.names))
        step[k] = size
        ends = [network.blocks(network.moved(state, s * step, own)) for s in (1.0, -1.0)]
        seen = 0.0
        for a, b, c in zip(*ends, blocks, strict=True):
            numeric = (b.residual - a.residual) / (2 * size)
            most = max(float(np.abs(numeric).max(initial=0)), 0.2)
            seen = max(seen, most)
            assert np.abs(numeric - c.common[:, k]).max(initial=0) < 3e-2 * most, (name, c.kind)
        assert seen > 0.5, f"{name} moves nothing"
    assert world.rig.wobble is None


def on_board() -> tuple[RigNetwork, State, World]:
    """A board that lies on the table, with the laser's stripe on it."""
    world = World(true_rig(), np.random.default_rng(2), 1e-9)
    layout = BoardLayout(LYING, LIES)
    angles = np.radians(np.arange(0, 360, 60.0))
    T = world.rig.T_camera_table
    views = []
    for a in angles:
        at = T @ Pose(rotation_z(a), np.zeros(3)) @ LIES
        px = world.rig.camera.project(at.apply(LYING.points))
        middle = at.apply(LYING.points.mean(axis=0))
        stripe = world.stripe(at.rotation[:, 2], at.translation, np.arange(0.0, 480), middle, 40)
        views.append(RiderView(np.arange(63, dtype=np.int32), px, (stripe,)))
    network = RigNetwork((), (), tuple(views), ("laser",), layout.names)
    return network, State(world.rig, layout, (), angles), world


LIES = Pose(rotation_from_vector([0.1, -0.07, 0.4]), np.array([-62.0, -48.0, 4.0]))
"""Board → table: nearly flat, about the axis."""


@settings(max_examples=12)
@given(
    st.integers(0, 999),
    st.floats(0, 0.1),
    st.floats(0.06, 0.3),
    st.floats(0, 0.2),
    st.lists(st.floats(0, 2 * np.pi), min_size=3, max_size=3),
)
def test_drawn_motions_are_found_within_three_of_their_sigma(
    seed: int, tilt_deg: float, shift: float, rise: float, ways: list[float]
) -> None:
    sizes = (np.radians(tilt_deg), shift, rise)
    drawn = Wobble(
        *(s * np.array([np.cos(w), np.sin(w)]) for s, w in zip(sizes, ways, strict=True))
    )
    world = World(replace(true_rig(), wobble=drawn), np.random.default_rng(seed), 0.1)
    rig = calibrated(world, SMALL).rig
    error, C = off(rig, drawn)
    z = np.abs(error) / np.sqrt(np.diag(C))
    assert 0.05 < z.max() < 3.5, "3 of one parameter, of six that were drawn"


def test_what_is_stated_is_how_far_it_is_off() -> None:
    pulls = []
    for seed in range(12):
        world = World(replace(true_rig(), wobble=MOVES), np.random.default_rng(seed), 0.1)
        error, C = off(calibrated(world, SMALL).rig, MOVES)
        pulls.append(error / np.sqrt(np.diag(C)))
        assert (np.diag(C) > 0).all(), seed
        assert 0.003 < np.sqrt(C[2, 2]) < 0.02, "mm: 0.1 px of noise, 1 px is 1 mm, 12 stops"
    # 72 numbers: their rms is known to 8 %.
    assert 0.75 < float(np.sqrt(np.mean(np.square(pulls)))) < 1.3


@pytest.mark.parametrize("seed", range(8))
def test_where_the_axis_stands_still_nothing_is_adopted(seed: int) -> None:
    """The platter leans and is warped, and its markers lie beside their places."""
    rig = calibrated(World(true_rig(), np.random.default_rng(seed), 0.1), SMALL).rig
    assert rig.wobble is None


@pytest.mark.parametrize(("stops", "times"), [(8, 2.0), (9, 10.0), (24, 20.0)])
def test_a_motion_that_is_all_of_the_residual_is_no_noise(stops: int, times: float) -> None:
    """In a fit without it, it looks like noise that few pictures have in common."""
    drawn = Wobble.of(times * MOVES.values)
    world = World(replace(true_rig(), wobble=drawn), np.random.default_rng(8), 0.1)
    c = calibrated(world, replace(SMALL, table=stops))
    error, C = off(c.rig, drawn)
    assert (np.abs(error) < 4.0 * np.sqrt(np.diag(C))).all()
    assert 0.08 < figures(c).table_rms_px < 0.12


@dataclass
class Rocking(World):
    """An axis that rocks to and fro in one direction of the room, rises, and has a platter that
    leans: half of the rocking goes round with the table, and half against it."""

    rock: float = 2e-3
    slide: float = 0.16
    lift: float = 0.05

    def stand(self, angle: float) -> tuple[Floats, Floats]:
        c = np.cos(angle)
        turn = rotation_from_vector([self.rock * c, 0.0, 0.0]) @ rotation_z(angle)
        return turn, np.array([self.slide * c, 0.0, self.lift * c])


def test_of_an_axis_that_rocks_in_the_room_the_half_is_found_that_goes_against_the_turn() -> None:
    rig = calibrated(Rocking(true_rig(), np.random.default_rng(5), 0.1), USUAL).rig
    error, C = off(rig, Wobble.of([1e-3, 0.0, 0.08, 0.0, 0.05, 0.0]))
    assert (np.diag(C) > 0).all()
    assert (np.abs(error) < 3.5 * np.sqrt(np.diag(C))).all()


def test_a_rise_alone_is_found_and_the_others_are_zero_within_their_uncertainty() -> None:
    rises = Wobble(rise=np.array([0.08, 0.05]))
    world = World(replace(true_rig(), wobble=rises), np.random.default_rng(3), 0.1)
    error, C = off(calibrated(world, SMALL).rig, rises)
    assert (np.abs(error) < 3.5 * np.sqrt(np.diag(C))).all()
    assert np.sqrt(np.diag(C))[2:].max() < 0.02


@pytest.mark.parametrize(("many", "turn"), [(SMALL, np.pi), (replace(SMALL, table=7), 2 * np.pi)])
def test_pictures_that_do_not_go_round_are_not_asked(many: Pictures, turn: float) -> None:
    world = World(replace(true_rig(), wobble=MOVES), np.random.default_rng(4), 0.1)
    assert calibrated(world, many, turn).rig.wobble is None


def test_a_board_on_the_table_tells_it_too() -> None:
    """The lowest corner is where a person has measured it, not at the frame's height in the fit."""
    world = World(replace(true_rig(), wobble=MOVES), np.random.default_rng(6), 0.1)
    camera, laser, _ = pictures(world, USUAL)
    T, table = world.rig.T_camera_table, []
    for k, a in enumerate(full_turn(24)):
        turn, shift = world.stand(a)
        px = world.noisy(
            world.rig.camera.project(T.apply(LIES.apply(LYING.points) @ turn.T + shift))
        )
        view = BoardView(LYING, px, np.arange(63, dtype=np.int32), (640, 480), f"t{k}")
        table.append(TablePicture(view, {}, f"t{k}", float(k)))
    low = float(LIES.apply(LYING.points)[:, 2].min())
    settings = CalibrationSettings(table_board=LYING, lowest=low)
    rig = calibrate_rig(camera, laser, table, settings).rig
    # Its x axis passes through the first corner.
    first = LIES.apply(LYING.points[0])
    lead = np.arctan2(first[1], first[0])
    back = rotation_z(-lead)[:2, :2]
    told = Wobble(back @ MOVES.tilt, back @ MOVES.shift, MOVES.rise)
    error, C = off(rig, told)
    sigma = np.sqrt(np.diag(C))
    assert (np.abs(error) < 3.5 * sigma).all()
    assert sigma[0] < np.radians(0.01)
    # Along the line of sight a board without a stripe says little, and that is what is stated.
    assert 0.02 < sigma[2:].max() < 0.08


def test_it_is_said_and_shown() -> None:
    c = known()
    (said,) = [f for f in findings_of(c, figures(c)) if f.code == "calibrate.axis-moves"]
    assert said.severity == "note"
    assert "tilts by 0.0" in said.message
    assert "77 mm from it up to 0.1" in said.message or "77 mm from it up to 0.2" in said.message
    shown = {name: (value, error) for name, value, error in parameters_of(c)}
    assert shown["axis in a turn: shift along the table's x, against the turn"][0].startswith("0.0")
    assert shown["axis in a turn: tilt about the table's y, against the turn"][0].endswith("°")
    assert figures(c).table_rms_px < 0.15
    still = calibrated(World(true_rig(), np.random.default_rng(1), 0.1), SMALL)
    assert "calibrate.axis-moves" not in [f.code for f in findings_of(still, figures(still))]


def test_more_than_once_in_a_turn_stays_a_residual() -> None:
    """A motion that no parameter has is not explained away."""

    class Limping(World):
        def stand(self, angle: float) -> tuple[Floats, Floats]:
            slide = 3.0 * np.array([np.cos(3 * angle), np.sin(5 * angle), 0.0])
            return rotation_z(angle), slide

    c = calibrated(Limping(true_rig(), np.random.default_rng(7), 0.1), SMALL)
    assert "calibrate.table-residual" in [f.code for f in findings_of(c, figures(c))]


def test_a_stage_anew_keeps_it_or_starts_it_again() -> None:
    before = known().rig
    world = World(replace(true_rig(), wobble=MOVES), np.random.default_rng(31), 0.1)
    _, laser, _ = pictures(world, SMALL)
    after = calibrate_rig([], laser, [], CalibrationSettings(), known=KnownRig(before)).rig
    error, C = off(after, MOVES)
    _, was = off(before, MOVES)
    assert (np.abs(error) < 4 * np.sqrt(np.diag(was))).all()
    assert np.diag(C) == pytest.approx(np.diag(was), rel=0.3)
    # Another first picture: angle zero is elsewhere, and so is what counts from it.
    shifted = Wobble(rotation_z(-2.0)[:2, :2] @ MOVES.tilt, MOVES.shift, MOVES.rise)
    other = World(replace(true_rig(), wobble=shifted), np.random.default_rng(32), 0.1)
    for counts in (False, True):
        told = KnownRig(before, counts=counts)
        again = calibrate_rig([], {}, stops(other, 24), CalibrationSettings(), known=told).rig
        error, C = off(again, shifted)
        assert (np.abs(error) < 4 * np.sqrt(np.diag(C))).all()


def test_a_marker_tells_the_angle_of_a_table_whose_axis_moves() -> None:
    wild = Wobble.of(5.0 * MOVES.values)
    rig, layout = replace(true_rig(), wobble=wild), true_layout()
    world = World(rig, np.random.default_rng(1), 0.0)
    corners, _ = layout.points(layout.numbers)
    for a in np.arange(-3.0, 3.0, 0.7):
        seen = world.rider_view(layout, a).corners.reshape(-1, 4, 2)
        markers = zip(layout.numbers, corners.reshape(-1, 4, 3), seen, strict=True)
        told = [(int(n), mm, px) for n, mm, px in markers]
        have, without = table_angle(rig, told), table_angle(true_rig(), told)
        assert have is not None
        assert without is not None
        assert have.angle == pytest.approx(a, abs=1e-6)
        assert have.residual_px < 1e-6 < 0.02 < without.residual_px


def test_a_part_that_such_a_table_bends_is_straight_again() -> None:
    """From the calibration to the scan: a box beside the axis, 72 steps."""
    true = replace(true_rig(), wobble=WILD)
    rig = calibrated(World(true, np.random.default_rng(1), 0.1), USUAL).rig
    exact = scan_shape(true, BOX, full_turn(72), "laser", sigma=0.1)

    def grid(rig: Rig, noise: float) -> RangeGrid:
        seen = with_noise(exact, noise, 4) if noise else exact
        return build_grid(rig, "laser", seen, np.arange(72), full_turn(72))

    def off_by(rig: Rig, noise: float = 0.0) -> float:
        scanned = grid(rig, noise)
        return float(np.sqrt(np.mean(off_box(scanned.points[scanned.found]) ** 2)))

    without = replace(rig, wobble=None, covariance=None)
    stated = float(np.median(systematic_sigma(rig, grid(rig, 0.0))))
    # Without noise: what the calibration is off by, against what it says; and what the table bends.
    assert 0.08 < off_by(without) < 0.3
    assert 0.02 * stated < off_by(rig) < stated
    assert off_by(rig) < 0.3 * off_by(without)
    # With noise the box is off by no more than that noise, as with the true rig.
    assert off_by(rig, 0.1) == pytest.approx(off_by(true, 0.1), rel=0.05)
    assert off_by(without, 0.1) > off_by(true, 0.1)


@pytest.mark.slow
def test_simulated_pictures_of_a_board_tell_what_their_table_did() -> None:
    """Ten pictures of a printed board that lies on a table of the simulator, seen from above."""
    spec, _ = spec_of(
        "sim:charuco?room=0.5&rig=ciclop&lasers=1&axis_tilt_deg=0.2&axis_shift=0.4&axial=0.3"
    )
    made, down = bench(spec), np.radians(40.0)
    up, x = np.array([0.0, -np.cos(down), -np.sin(down)]), np.array([1.0, 0.0, 0.0])
    away = float(np.linalg.norm(made.rig.T_camera_table.translation))
    T = Pose(np.stack([x, np.cross(up, x), up], axis=1), np.array([0.0, 0.0, away]))
    flat = rotation_from_vector([0.0, 0.05, 0.0]) @ rotation_from_vector([0.0, -np.pi / 2, 0.0])
    middle = (Pose(flat, np.zeros(3)) @ PRINT).apply(PRINTED.points.mean(axis=0))
    lies = Pose(flat, np.array([8.0, -5.0, 4.0]) - middle)
    body, *others = made.scene.bodies
    scene = replace(made.scene, bodies=(replace(body, T_table_part=lies), *others))
    rig = replace(made.rig, T_camera_table=T)
    camera, table = Renderer(replace(made, rig=rig, scene=scene)), []
    for k, a in enumerate(full_turn(10)):
        view = detect_board(camera.picture(float(a), (), seconds_of(spec)), PRINTED, f"t{k}")
        table.append(TablePicture(view, {}, f"t{k}", float(k)))
    told = CalibrationSettings(
        table_board=PRINTED, lowest=float((lies @ PRINT).apply(PRINTED.points)[:, 2].min())
    )
    known = KnownRig(replace(rig, table_known=False, covariance=None))
    found = calibrate_rig([], {}, table, told, known=known).rig
    first = (lies @ PRINT).apply(PRINTED.points[0])
    back = rotation_z(-np.arctan2(first[1], first[0]))[:2, 0]
    m = made.motion
    drawn = Wobble(m.axis_tilt * back, m.axis_shift * back, np.array([m.axial, 0.0]))
    error, C = off(found, drawn)
    sigma = np.sqrt(np.diag(C))
    assert (np.abs(error) < 4 * sigma).all()
    # Corners to 0.02 px and better, of 0.22 mm each; a few hundred of them.
    assert np.degrees(sigma[:2]).max() < 0.005
    assert 0.001 < sigma[2:].max() < 0.02
