"""The joint adjustment: derivatives, recovery of a known rig, honest uncertainty, refusals."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest

from tests.calibrate.world import SHAPE, World, problem, true_rig
from turnscan.calibrate import CalibrationSettings, calibrate_rig, figures
from turnscan.calibrate._adjust import Fit, adjust
from turnscan.calibrate._findings import _of_camera
from turnscan.calibrate._normal import Block, cost_of, weight
from turnscan.calibrate._observations import BOARD, RigNetwork
from turnscan.calibrate._procedure import Stages
from turnscan.calibrate._residuals import lens, stripe_term, trace
from turnscan.calibrate._rig import Calibration
from turnscan.calibrate._start_table import start_markers
from turnscan.calibrate._state import State
from turnscan.errors import Degenerate
from turnscan.rig import rotation_from_vector

RUNS = range(100, 112 if "TURNSCAN_EXPLORE" in os.environ else 108)
"""Seeds of repetitions; of eight the rms of three errors each is known to 15 %."""


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
    runs = [solved(seed) for seed in RUNS]
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


def test_a_stripe_in_a_bent_sheet_has_the_derivatives_of_its_residual() -> None:
    """Where pixels lie in the sheet exactly, so that their scale to pixels has no say."""
    world = World(true_rig(), np.random.default_rng(1), 0.0)
    camera = world.rig.camera
    sheet = replace(world.rig.sheets[0], bow=np.array([5e-5, -3e-5, 7e-5]))
    normal = rotation_from_vector([0.3, -0.2, 0.1])[:, 2]
    point = np.array([10.0, -5.0, 620.0])
    rows = np.arange(60.0, 420.0, 40.0)

    def off(u: np.ndarray) -> np.ndarray:
        rays = camera.rays(np.stack([u, rows], axis=1))
        return sheet.distance(rays * ((point @ normal) / (rays @ normal))[:, None])

    low, high = np.full(len(rows), 5.0), np.full(len(rows), 635.0)
    rises = off(high) > off(low)
    assert (np.sign(off(low)) != np.sign(off(high))).all()
    for _ in range(60):
        middle = (low + high) / 2
        above = (off(middle) > 0) == rises
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    seen = trace(camera, np.stack([low, rows], axis=1))
    direction = np.array([1.0, 0.0])
    term = stripe_term(sheet, seen, direction, normal, point)
    assert np.abs(term.residual).max() < 1e-9
    across = stripe_term(sheet, trace(camera, np.stack([low + 1e-4, rows], axis=1)),
                         direction, normal, point)  # fmt: skip
    assert across.residual == pytest.approx(1e-4, rel=1e-3), "px, along the direction"
    rig = replace(world.rig, sheets=(sheet,))
    for j, name in enumerate(n for n in rig.parameter_names if n.startswith("laser.")):
        step = np.zeros(len(rig.parameter_names))
        step[list(rig.parameter_names).index(name)] = h = 1e-9 if "bow" in name else 1e-6
        ends = [
            stripe_term(rig.perturbed(s * step).sheets[0], seen, direction, normal, point).residual
            for s in (-1, 1)
        ]
        # A turn takes the bow along, which is left out.
        near = 0.05 if "turn" in name else 1e-3
        assert (ends[0] - ends[1]) / (2 * h) == pytest.approx(term.by_sheet[:, j], rel=near), name
    for k in range(3):
        h = 1e-5 * np.eye(3)[k]
        ends = [
            stripe_term(sheet, seen, direction, normal, point + s * h).residual for s in (-1, 1)
        ]
        assert (ends[0] - ends[1]) / 2e-5 == pytest.approx(term.by_point[:, k], rel=1e-3, abs=1e-6)
        ends = [
            stripe_term(sheet, seen, direction, normal + s * h / 100, point).residual
            for s in (-1, 1)
        ]
        assert (ends[0] - ends[1]) / 2e-7 == pytest.approx(term.by_normal[:, k], rel=1e-3, abs=1e-4)


def test_a_strong_lens_is_as_steep_as_its_pixels_say() -> None:
    """All terms at once, far out, where none of them is small beside the others."""
    camera = replace(true_rig().camera, distortion=np.array([-0.2, 0.1, 0.02, -0.03, 0.05]))
    xy = np.random.default_rng(1).uniform(-0.6, 0.6, (40, 2))
    _, by_xy, _ = lens(camera, xy)
    for k in range(2):
        h = 1e-6 * np.eye(2)[k]
        ends = [lens(camera, xy + s * h)[0] for s in (-1, 1)]
        assert (ends[1] - ends[0]) / 2e-6 == pytest.approx(by_xy[:, :, k], rel=1e-5, abs=1e-3)


def test_a_residual_pulls_by_the_slope_of_its_cost() -> None:
    """Beyond the limit, too: else a step down by the pull would be a step up in cost."""
    huber, scales = 2.0, {"boards": 0.3}
    for residual in np.array([0.1, 0.5, 0.61, 2.0, -9.0]):

        def at(r: float) -> Block:
            return Block(0, "boards", np.array([r]), np.zeros((1, 1)), np.zeros((1, 0)))

        def cost(r: float) -> float:
            return cost_of([at(r)], scales, huber)

        slope = (cost(residual + 1e-6) - cost(residual - 1e-6)) / 2e-6
        pull = 2 * float(weight(at(residual), scales, huber)[0]) * residual
        assert slope == pytest.approx(pull, rel=1e-5)
    edge = 0.3 * huber
    assert cost_of([at(edge + 1e-9)], scales, huber) == pytest.approx(huber**2, rel=1e-6)


def test_a_bent_board_is_said_where_it_is_sure() -> None:
    fit, network, _ = solved(3)
    p = len(fit.state.rig.parameter_names)
    rig = replace(fit.state.rig, covariance=fit.covariance[:p, :p])
    names = tuple(str(k) for k in range(len(network.own_sizes)))
    flat = Calibration(
        rig, CalibrationSettings(), fit, network, (), names, None, (), Stages(("camera",))
    )
    told = _of_camera(flat, figures(flat))
    assert not [f for f in told if f.code == "calibrate.board-bent"]
    first = network.names.index("board.bend_xx")
    sigma = np.sqrt(np.diag(fit.covariance))[first : first + 3]
    # The pattern is 360 × 280 mm: its height over half the width is bend_xx · 180².
    for bend, said in (((5e-5, 0.0, 0.0), True), ((0.5 * sigma[0], 0.0, 0.0), False)):
        bent = replace(flat, fit=replace(fit, state=replace(fit.state, bend=np.array(bend))))
        told = [f for f in _of_camera(bent, figures(bent)) if f.code == "calibrate.board-bent"]
        assert bool(told) == said
        if said:
            height, error = 5e-5 * 180**2, sigma[0] * 180**2
            assert f"bulges by {height:.2f} ± {error:.2f} mm over half its width" in told[0].message
