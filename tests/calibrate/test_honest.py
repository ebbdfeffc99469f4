"""What a calibration claims of itself, against the scatter of many that saw other noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from tests.calibrate.world import World, true_rig
from turnscan.arrays import Floats
from turnscan.calibrate import LaserPicture, fit_sheet
from turnscan.calibrate._adjust import Fit, adjust
from turnscan.calibrate._board import Chessboard
from turnscan.calibrate._evidence import CalibrationSettings
from turnscan.calibrate._findings import strong_correlations
from turnscan.calibrate._layout import BoardLayout
from turnscan.calibrate._normal import Block
from turnscan.calibrate._observations import RigNetwork
from turnscan.calibrate._quality import measured_uncertainty
from turnscan.calibrate._rig import Calibration, _finished_rig
from turnscan.calibrate._state import State
from turnscan.rig import Pose, Rig, rotation_from_vector

VIEWS, EACH = 24, 8
SHARED = np.array([3.0, -2.0])
SEEDS = 80


@dataclass(frozen=True)
class Line:
    """Each view is a curve of its own height; slope and bend are those of all."""

    seen: tuple[Floats, ...]

    names = ("slope", "bend")
    own_sizes = (1,) * VIEWS

    def own_words(self, view: int) -> str:
        return f"height of curve {view}"

    def blocks(self, state: tuple[Floats, Floats]) -> list[Block]:
        shared, heights = state
        out = []
        for k, y in enumerate(self.seen):
            x = np.linspace(-1, 1, len(y)) + 0.1 * k / VIEWS
            A = np.stack([x, x * x], axis=1)
            residual = y - A @ shared - heights[k]
            out.append(Block(k, "points", residual, A, np.ones((len(y), 1))))
        return out

    def moved(
        self, state: tuple[Floats, Floats], common: Floats, own: Sequence[Floats]
    ) -> tuple[Floats, Floats]:
        return state[0] + common, state[1] + np.concatenate(own)


def fitted(seed: int, noise: float, common: float, each: int = EACH) -> Fit[tuple[Floats, Floats]]:
    """Views with noise of their points, and one slope each that is wrong for all its points."""
    dice = np.random.default_rng(seed)
    seen = []
    for k in range(VIEWS):
        x = np.linspace(-1, 1, each) + 0.1 * k / VIEWS
        slope, bend = SHARED + common * dice.standard_normal(2)
        seen.append(slope * x + bend * x * x + 5.0 + noise * dice.standard_normal(each))
    start = (np.zeros(2), np.zeros(VIEWS))
    return adjust(Line(tuple(seen)), start, np.ones(2, dtype=bool), robust=False)


@cache
def repeated(common: float, each: int = EACH) -> list[Fit[tuple[Floats, Floats]]]:
    return [fitted(seed, 0.1, common, each) for seed in range(SEEDS)]


def pulls(fits: list[Fit[tuple[Floats, Floats]]]) -> Floats:
    """(SEEDS, 2) errors of the shared parameters in what the fits claim."""
    return np.array([(f.state[0] - SHARED) / np.sqrt(np.diag(f.covariance)) for f in fits])


def test_errors_that_a_view_shares_widen_the_uncertainty() -> None:
    """300 pixels of a stripe on a bent board are not 300 measurements: the spread says so."""
    fits = repeated(0.3)
    # 160 pulls: their rms is known to 6 %; the spread over 24 views, and so the claim, to 15 %.
    assert 0.8 < np.sqrt(np.mean(pulls(fits) ** 2)) < 1.25
    assert np.median([f.view_factor for f in fits]) > 1.5


def test_independent_errors_do_not() -> None:
    fits = repeated(0.0)
    assert 0.75 < np.sqrt(np.mean(pulls(fits) ** 2)) < 1.1
    assert np.median([f.view_factor for f in fits]) < 1.15


@dataclass(frozen=True)
class Wave:
    """Many shared parameters, all of which each view sees."""

    seen: tuple[Floats, ...]

    names = tuple(f"wave {k}" for k in range(VIEWS - 6))
    own_sizes = (0,) * VIEWS

    def own_words(self, view: int) -> str:
        return f"nothing of curve {view}"

    def blocks(self, state: Floats) -> list[Block]:
        out = []
        for k, y in enumerate(self.seen):
            x = np.linspace(-0.9, 0.9, len(y)) + 0.1 * k / VIEWS
            A = np.polynomial.legendre.legvander(x, len(self.names) - 1)
            out.append(Block(k, "points", y - A @ state, A, np.zeros((len(y), 0))))
        return out

    def moved(self, state: Floats, common: Floats, own: Sequence[Floats]) -> Floats:
        return state + common


def test_independent_errors_do_not_where_parameters_are_nearly_as_many_as_views() -> None:
    """A view that sees them all is no single measurement: nothing is lost to their number."""
    factors = []
    for seed in range(10):
        dice = np.random.default_rng(seed)
        waves = Wave(tuple(0.1 * dice.standard_normal(60) for _ in range(VIEWS)))
        free = np.ones(len(waves.names), dtype=bool)
        fit = adjust(waves, np.zeros(len(free)), free, robust=False)
        factors.append(fit.view_factor)
    assert np.median(factors) < 1.15


def test_noise_is_found_as_large_as_it_is_however_many_parameters_it_pays_for() -> None:
    """Three points to a line of its own height: a third of the squares is gone with it."""
    fits = repeated(0.0, 3)
    free = VIEWS * 3 - VIEWS - 2
    variance = np.mean([f.scales["points"] ** 2 for f in fits])
    assert variance == pytest.approx(0.01, rel=4 * np.sqrt(2 / (free * SEEDS)))
    assert np.allclose([f.degrees_of_freedom["points"] for f in fits], free)
    assert np.mean([f.chi2 for f in fits]) == pytest.approx(free, rel=0.01)


def test_the_height_of_a_view_scatters_as_claimed() -> None:
    """What is a view's own is known by its own points and by what all say of the rest."""
    fits = repeated(0.0)
    off = np.array([f.state[1] - 5.0 for f in fits])
    said = np.array([[c[0, 0] ** 0.5 for c in f.own_covariance] for f in fits])
    alone = np.array([[c[0, 0] ** 0.5 for c in f.own_noise] for f in fits])
    assert np.sqrt(np.mean((off / said) ** 2)) == pytest.approx(1.0, abs=0.12)
    assert alone == pytest.approx(0.1 / np.sqrt(EACH), rel=0.3)


def uncertain(rig: Rig, size: int, seed: int, small: float) -> Floats:
    """A covariance (p, p) in which everything goes with everything; no tilt of the sensor."""
    dice = np.random.default_rng(seed)
    p = len(rig.parameter_names)
    steps = np.full(size, 1e-4)
    steps[:4] = 0.2  # focal lengths and principal point, px
    steps[9:11] = 0.0
    for k, name in enumerate(rig.parameter_names):
        if "offset" in name or "shift" in name:
            steps[k] = 0.05
        if "bow" in name:
            steps[k] = 0.0
    steps[p:] = small
    A = steps[:, None] * dice.standard_normal((size, 2))
    return np.asarray(A @ A.T)


def test_the_uncertainty_of_a_radius_is_the_scatter_of_rigs_drawn_from_the_covariance() -> None:
    """With all that the parameters have in common: much of it cancels in a radius."""
    rig = true_rig()
    cov = uncertain(rig, len(rig.parameter_names), 5, 0.0)
    rig = replace(rig, covariance=cov)
    radius, height = 60.0, 20.0
    said = measured_uncertainty(rig, "laser", radius, height)
    assert said is not None
    seen: list[Floats] = []
    point = place_of(rig, radius, height)
    pixel = rig.camera.project(rig.T_camera_table.apply(point))[None]
    dice = np.random.default_rng(1)
    for delta in dice.multivariate_normal(np.zeros(len(cov)), cov, 600, method="eigh"):
        r = rig.perturbed(delta)
        X = r.T_camera_table.inverse().apply(r.sheet("laser").intersect(r.camera.rays(pixel)))[0]
        seen.append(np.array([np.hypot(X[0], X[1]), X[2]]))
    # 600 rigs: a standard deviation is known to 3 %.
    assert np.std(seen, axis=0) == pytest.approx(said, rel=0.1)
    assert np.mean(seen, axis=0) == pytest.approx([radius, height], abs=max(said) / 5)


def place_of(rig: Rig, radius: float, height: float) -> Floats:
    """Where the sheet is ``radius`` mm from the axis, on the camera's side; table frame."""
    T = rig.T_camera_table
    turn = np.linspace(-np.pi, np.pi, 200_001)
    circle = np.stack([radius * np.cos(turn), radius * np.sin(turn), 0 * turn + height], axis=1)
    off = rig.sheet("laser").distance(T.apply(circle))
    cross = np.flatnonzero(np.signbit(off[1:]) != np.signbit(off[:-1]))
    return np.asarray(min(circle[cross], key=lambda x: float(np.linalg.norm(T.apply(x)))))


def test_a_standing_boards_lowest_corner_carries_its_uncertainty_to_the_table() -> None:
    """The platter lies as far below that corner as was measured, wherever the fit puts both."""
    rig = true_rig()
    board = Chessboard(4, 3, 12.0)
    pose = Pose(rotation_from_vector([-1.5, 0.1, 0.2]), np.array([-30.0, 12.0, 70.0]))
    layout = BoardLayout(board, pose)
    network = RigNetwork((), (), (), ("laser",), layout.names)
    state = State(rig, layout, (), np.zeros(0))
    size = len(network.names)
    cov = uncertain(rig, size, 7, 0.02)
    cov[-3:] = cov[:, -3:] = 0.0
    settings = CalibrationSettings(table_board=board, lowest=22.0)

    def finished(delta: Floats) -> Rig:
        moved = network.moved(state, delta, [])
        return _finished_rig(Fit(moved, (), cov, (), (), {}, {}, 0.0, 1.0), network, settings)

    whole = finished(np.zeros(size))
    assert whole.covariance is not None
    assert lowest_of(layout, whole, rig) == pytest.approx(22.0)
    dice = np.random.default_rng(2)
    drawn = dice.multivariate_normal(np.zeros(size), cov, 1500, method="eigh")
    places = np.array([finished(d).T_camera_table.translation for d in drawn])
    claimed = whole.covariance[-3:, -3:]
    assert np.cov(places.T) == pytest.approx(claimed, rel=0.12, abs=0.06 * np.trace(claimed) / 3)


def lowest_of(layout: BoardLayout, finished: Rig, before: Rig) -> float:
    """Height of the board's lowest corner above the platter of the finished rig."""
    corners = before.T_camera_table.apply(layout.pose.apply(layout.board.points))
    return float(finished.T_camera_table.inverse().apply(corners)[:, 2].min())


def test_parameters_that_go_together_are_named() -> None:
    """Three of them, the first two nearly as one; what was held fixed has no say."""
    rig = true_rig()
    p = len(rig.parameter_names)
    sigma = np.zeros(p)
    sigma[[0, 2, 5]] = 2.0, 0.1, 1e-3
    r = np.eye(p)
    r[0, 2] = r[2, 0] = -0.97
    r[0, 5] = r[5, 0] = 0.9
    rig = replace(rig, covariance=r * np.outer(sigma, sigma))
    fit = Fit(State(rig, None, (), np.zeros(0)), (), np.zeros((p, p)), (), (), {}, {}, 0.0, 1.0)
    network = RigNetwork((), (), (), ("laser",))
    c = Calibration(rig, CalibrationSettings(), fit, network, (), (), None)
    names = rig.parameter_names
    assert strong_correlations(c) == [(names[0], names[2], pytest.approx(-0.97))]
    assert strong_correlations(replace(c, rig=replace(rig, covariance=None))) == []


@pytest.mark.parametrize("seed", [1, 2])
def test_a_sheet_alone_is_found_by_boards_in_front_of_a_known_camera(seed: int) -> None:
    world = World(true_rig(), np.random.default_rng(seed), 0.1)
    poses = world.board_poses(10)
    seen = [LaserPicture(world.board_view(T), world.board_stripe(T).pixels) for T in poses]
    stray = LaserPicture(world.board_view(poses[0]), np.zeros((0, 2)))
    found = fit_sheet(world.rig.camera, [*seen, stray])
    true = world.rig.sheets[0]
    assert len(found.points) >= 4
    assert abs(found.sheet.normal @ true.normal) > np.cos(np.radians(0.2))
    on_boards = np.array([T.apply(np.array([140.0, 100.0, 0.0])) for T in poses])
    on_sheet = on_boards - true.distance(on_boards)[:, None] * true.normal
    assert np.abs(found.sheet.distance(on_sheet)).max() < 0.3
    assert found.rms_px == pytest.approx(0.1, rel=0.15)
    assert found.corner_rms_px == pytest.approx(0.1, rel=0.15)
    # A pixel is about a millimetre there, seen from 35° beside the sheet.
    assert 0.05 < found.rms_mm < 0.3
