"""Gaps between surfaces: residuals that change as they say, and that favour no wrong rig."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.calibrate.bodies import both, doubted, prism, sphere, two_lasers
from turnscan.arrays import Floats
from turnscan.calibrate import Balls
from turnscan.calibrate._bodies_found import find_body
from turnscan.calibrate._gaps import network_of
from turnscan.calibrate._point_slopes import point_slopes, ray_slopes
from turnscan.calibrate._surfaces import SurfaceNetwork, Surfaces
from turnscan.rig import Pose, TableMotion, Wobble, rotation_from_vector

STEPS = np.radians(np.arange(0.0, 360.0, 9.0))


def network(seed: int, coarse: float = 0.0, noise: float = 0.3) -> SurfaceNetwork:
    """A leaning hexagon, or a ball that is known, in the true rig as a ruler knows it."""
    rig = two_lasers()
    body = prism((5.0, 2.0), 40.0, 6, 20.0) if seed % 2 else sphere((9.0, 3.0, 22.0), 18.0)
    sweeps = tuple(both(rig, body, STEPS, STEPS, seed, noise=noise, every=8))
    state = Surfaces(replace(rig, motion=TableMotion(np.zeros((1, 2)))))
    if not seed % 2:
        state = replace(state, bodies=(find_body(Balls(), (None,), sweeps, rig),))
    own = len(rig.parameter_names)
    count = len(SurfaceNetwork(sweeps, (), state, np.zeros(0, bool)).names)
    free = np.arange(count) >= 9
    free[:own] = np.diag(doubted(rig).covariance) > 0  # type: ignore[arg-type]
    return network_of(doubted(rig), state, sweeps, free, 4.0, 400, coarse)


def told(of: SurfaceNetwork, state: Surfaces) -> tuple[Floats, Floats]:
    """(m,) residuals of gaps, and how they change with each parameter, (m, p)."""
    seen = [b for b in of.blocks(state) if not b.kind.startswith("prior")]
    return np.concatenate([b.residual for b in seen]), np.concatenate([b.common for b in seen])


@pytest.mark.parametrize(("seed", "coarse"), [(1, 0.0), (2, 2.0)])
def test_residuals_change_as_they_say(seed: int, coarse: float) -> None:
    of = network(seed, coarse)
    by, h = told(of, of.state)[1], 1e-5
    for k in np.flatnonzero(of.active)[::4]:
        step = np.zeros(len(of.names))
        step[k] = h
        ends = [told(of, of.moved(of.state, s * step, ()))[0] for s in (1.0, -1.0)]
        change = -(ends[0] - ends[1]) / (2 * h)
        # A ball's direction turns a little as it is moved: a few points that slide along it differ.
        off = np.abs(change - by[:, k])
        assert np.quantile(off, 0.98) < 0.02 * np.abs(by[:, k]).max() + 1e-6


def test_noise_pulls_the_rig_nowhere() -> None:
    """In the true rig, noise alone must not lower the sum of squares along any direction.

    Weighed by the noise of another state, rigs would be better that turn noise out of the gaps, by
    30 standard deviations of this test along directions in which a hexagon says little.
    """
    known = doubted(two_lasers()).covariance
    assert known is not None
    pull, normal = np.zeros(12), np.zeros((12, 12))
    for seed in (1, 3, 5, 7):
        of = network(seed, noise=0.2)
        residual, by = told(of, of.state)
        rows = (by[:, : len(known)] * np.sqrt(np.diag(known)))[:, np.diag(known) > 0]
        pull += rows.T @ residual
        normal += rows.T @ rows
    value, direction = np.linalg.eigh(normal)
    says = value > 1e-3
    assert np.count_nonzero(says) >= 10
    assert value[says][0] < 1.0
    assert np.abs((direction.T @ pull)[says] / np.sqrt(value[says])).max() < 6.0


@pytest.mark.parametrize("wobble", [None, Wobble.of([1e-3, -8e-4, 0.1, 0.05, -0.07, 0.04])])
def test_points_move_as_their_slopes_say(wobble: Wobble | None) -> None:
    """A bent sheet, a table with errors of its own, a tilted second pose, a lens that moves."""
    rig, dice = two_lasers(), np.random.default_rng(4)
    camera = replace(rig.camera, distortion=np.array([-0.1, 0.05, 1e-3, -2e-3, 0.01]))
    sheets = tuple(replace(s, bow=1e-4 * dice.standard_normal(3)) for s in rig.sheets)
    motion = TableMotion(0.1 * dice.standard_normal((2, 2)), 0.3, -0.02)
    rig = replace(rig, camera=camera, sheets=sheets, motion=motion, wobble=wobble)
    lies = Pose(rotation_from_vector([0.4, -0.7, 0.2]), np.array([3.0, -8.0, 5.0]))
    told = np.concatenate([STEPS[:9], STEPS[:9][::-1]])
    sweep = both(rig, sphere((9.0, 3.0, 22.0), 18.0), told, told, 1, every=30)[1]
    sweep = replace(sweep, pose=1)
    p = len(rig.parameter_names)
    names = (*rig.parameter_names, *motion.names, *"abcxyz")
    columns = np.array([k for k in range(len(names)) if k % 7 != 3])

    def at(delta: Floats) -> Floats:
        values = motion.values + delta[p:-6]
        now = replace(rig.perturbed(delta[:p]), motion=TableMotion.of(values))
        turn = lies.rotation @ rotation_from_vector(delta[-6:-3])
        pose = Pose(turn, lies.translation + delta[-3:])
        return pose.apply(sweep.points(now, now.camera.rays(sweep.pixels)))

    rays, lens = rig.camera.rays(sweep.pixels), columns[columns < 11]
    slopes = point_slopes(
        sweep, rig, (lies,), rays, ray_slopes(rig.camera, sweep.pixels, lens), columns
    )
    assert len(sweep.pixels) > 50
    for j, k in enumerate(columns):
        h = np.zeros(len(names))
        h[k] = 0.1 if k < 4 else 1e-4 if k < 11 else 1e-6
        change = (at(h) - at(-h)) / (2 * h[k])
        # Slopes are of first order in how the axis itself moves.
        near = 1e-4 if wobble is None else 3e-3
        assert slopes[:, j] == pytest.approx(
            change, rel=near, abs=near * np.abs(change).max() + 1e-8
        )
