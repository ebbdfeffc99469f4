"""The joint adjustment: derivatives, recovery of a known rig, honest uncertainty, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.calibrate.world import SHAPE, World, true_layout, true_rig
from turnscan.calibrate import CalibrationSettings, calibrate_rig
from turnscan.calibrate._adjust import Fit, adjust
from turnscan.calibrate._network import BOARD, RigNetwork
from turnscan.calibrate._start_table import start_markers
from turnscan.calibrate._state import State
from turnscan.errors import Degenerate

TURN = np.arange(0, 360, 15) * np.pi / 180


def problem(seed: int, noise: float = 0.1, views: int = 14) -> tuple[RigNetwork, State, World]:
    world = World(true_rig(), np.random.default_rng(seed), noise)
    poses = world.board_poses(views)
    half = views // 2
    boards = tuple(world.board_view(T) for T in poses)
    stripes = tuple(() if i < half else (world.board_stripe(T),) for i, T in enumerate(poses))
    layout = true_layout()
    table = tuple(world.rider_view(layout, a) for a in TURN)
    network = RigNetwork(boards, stripes, table, ("laser",), layout.names)
    return network, State(world.rig, layout, tuple(poses), TURN.copy()), world


def away(state: State, network: RigNetwork) -> State:
    """A start some way off the truth."""
    names = network.names
    d = np.zeros(len(names))
    for name, by in {
        "camera.fx": 15,
        "camera.fy": 12,
        "camera.cx": 8,
        "camera.k1": 0.05,
        "laser.turn_along": 0.03,
        "laser.offset": 4,
        "table.turn_x": 0.02,
        "table.shift_z": 9,
        "marker5.side": 1.5,
    }.items():
        d[names.index(name)] = by
    own = [np.full(q, 0.004) for q in network.own_sizes]
    return replace(network.moved(state, d, own), bend=np.full(3, 2e-6))


def solved(seed: int, noise: float = 0.1) -> tuple[Fit[State], RigNetwork, State]:
    network, truth, _ = problem(seed, noise)
    fit = adjust(network, away(truth, network), network.free(truth, bend=True))
    return fit, network, truth


def values(state: State) -> dict[str, float]:
    rig, layout = state.rig, state.layout
    assert layout is not None
    sheet = rig.sheets[0]
    point = true_rig().T_camera_table.translation
    return {
        "camera.fx": rig.camera.fx,
        "camera.cy": rig.camera.cy,
        "camera.k1": float(rig.camera.distortion[0]),
        "side": float(layout.squares[:, 3].mean()),
        "x": float(layout.squares[0, 0]),
        "sheet": float(sheet.distance(point)),
    }


def test_derivatives_are_those_of_the_residuals() -> None:
    # To 3 %: the slope of a warped platter and the change of the scale to pixels are left out.
    network, state, _ = problem(1, noise=1e-9, views=4)
    names = network.names
    own0 = [np.zeros(q) for q in network.own_sizes]
    blocks = network.blocks(state)
    for j, name in enumerate(names):
        if "tilt" in name:
            continue
        step = np.zeros(len(names))
        step[j] = 1e-8 if "bend" in name or "bow" in name else 1e-5
        plus = network.blocks(network.moved(state, step, own0))
        minus = network.blocks(network.moved(state, -step, own0))
        for a, b, c in zip(plus, minus, blocks, strict=True):
            numeric = (b.residual - a.residual) / (2 * step[j])
            size = max(float(np.abs(numeric).max(initial=0)), 1.0)
            assert np.abs(numeric - c.common[:, j]).max(initial=0) < 3e-2 * size, (name, c.kind)


def test_recovers_a_known_rig_within_its_uncertainty() -> None:
    fit, network, truth = solved(3)
    want, have = values(truth), values(fit.state)
    assert 0.09 < fit.scales[BOARD] < 0.11
    index = network.names.index
    for name in ("camera.fx", "camera.cy", "camera.k1"):
        k = index(name)
        assert abs(have[name] - want[name]) < 4 * np.sqrt(fit.covariance[k, k]), name
    assert abs(have["side"] - want["side"]) < 0.1
    assert fit.state.layout is not None
    sigma = np.sqrt(np.diag(fit.covariance))[index("platter.slope_x") : index("marker5.x")]
    assert (np.abs(fit.state.layout.shape - SHAPE) < 4.5 * sigma).all()
    off = np.angle(np.exp(1j * (fit.state.angles - truth.angles)))
    assert 1e-6 < np.degrees(off.std()) < 0.1


@pytest.mark.slow
def test_claimed_uncertainty_is_the_spread_of_repetitions() -> None:
    runs = [solved(seed) for seed in range(100, 112)]
    ratio = []
    for name in ("camera.fx", "camera.cy", "camera.k1"):
        k = runs[0][1].names.index(name)
        errors = np.array([values(f.state)[name] - values(t)[name] for f, _, t in runs])
        claimed = np.array([np.sqrt(f.covariance[k, k]) for f, _, _ in runs])
        ratio.append(float(np.sqrt(np.mean((errors / claimed) ** 2))))
    assert 0.5 < float(np.mean(ratio)) < 1.6, ratio


def test_a_gross_outlier_hardly_moves_the_result() -> None:
    network, truth, _ = problem(5)
    corners = network.boards[0].corners.copy()
    corners[7] += 25
    bad = replace(
        network, boards=(replace(network.boards[0], corners=corners), *network.boards[1:])
    )
    free = network.free(truth, bend=True)
    clean = values(adjust(network, truth, free).state)
    dirty = values(adjust(bad, truth, free).state)
    assert abs(clean["camera.fx"] - dirty["camera.fx"]) < 1.0


def test_boards_without_tilt_are_refused() -> None:
    world = World(true_rig(), np.random.default_rng(2), 0.1)
    views = [world.board_view(T, name=str(k)) for k, T in enumerate(world.board_poses(8, 0.0))]
    with pytest.raises(Degenerate, match="focal length"):
        calibrate_rig(views, {}, (), CalibrationSettings())


def test_nothing_observed_is_named() -> None:
    network, truth, _ = problem(4)
    blind = replace(network, board_stripes=((),) * len(network.boards))
    blind = replace(blind, table=tuple(replace(v, stripes=()) for v in network.table))
    free = network.free(truth)
    with pytest.raises(Degenerate, match="laser"):
        adjust(blind, truth, free)


def test_markers_start_near_the_truth_without_knowing_anything() -> None:
    network, truth, world = problem(6)
    layout, T, angles = start_markers(world.rig.camera, network.table, 27.5)
    want = truth.rig.T_camera_table
    assert np.degrees(np.arccos(T.rotation[:, 2] @ want.rotation[:, 2])) < 2.0
    assert np.linalg.norm(T.translation - want.translation) < 15
    assert np.degrees(np.abs(np.angle(np.exp(1j * (angles - truth.angles))))).max() < 2
    assert list(layout.numbers) == [5, 18, 27, 42]
