"""What of its pictures a calibration uses: lens parameters that they ask for, all of a stripe."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bench._drawn import Drawn, bench_board
from bench._held import LARGE, Held

from turnscan.calibrate._procedure import _gathered
from turnscan.rig import Rig
from turnscan.simulate import SimulationSpec, bench

SPEC = SimulationSpec("ball-bar", "modern", lasers=1)
WAY = Held("20 + 12 of a large board", LARGE, 20, (0.6, 1.0))
MORE, STOPS = Held("40 + 24 of it", LARGE, 40, (0.6, 1.0), 24), 24
P1, P2 = 3e-4, -2e-4
"""The edge of the picture is a pixel off by these."""
CHANCE = 44
"""Of 48 draws the one in which the noise alone makes a tangential parameter three of its sigma."""


def _calibrated(true: Rig, way: Held, stops: int, seed: int) -> Rig:
    drawn = Drawn(true, np.random.default_rng(seed))
    return drawn.calibrated(*way.poses(true, drawn.dice), bench_board(SPEC), stops, way.board)


def test_a_tangential_distortion_that_is_there_is_kept() -> None:
    true = bench(SPEC).rig
    lens = true.camera.distortion + np.array([0, 0, P1, P2, 0])
    found = _calibrated(replace(true, camera=replace(true.camera, distortion=lens)), WAY, 8, seed=1)
    off = found.camera.distortion[2:4] - (P1, P2)
    k = [found.parameter_names.index(f"camera.{name}") for name in ("p1", "p2")]
    sigma = np.sqrt(np.diag(found.covariance)[k])
    assert (np.abs(off) < 4 * sigma).all()
    assert (sigma < 0.25 * np.abs((P1, P2))).all()


def test_one_that_is_there_by_chance_is_not() -> None:
    found = _calibrated(bench(SPEC).rig, MORE, STOPS, CHANCE)
    assert found.camera.distortion[2:4] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_all_of_a_stripe_counts_and_every_mean_is_known_as_well() -> None:
    dice, noise = np.random.default_rng(5), 0.6
    stripes = [
        np.column_stack([300.0 + 0.2 * v + noise * dice.standard_normal(len(v)), v])
        for v in (np.arange(100.0, 100.0 + n) for n in (1000, 400, 60, 13, 1))
    ]
    means = _gathered(stripes)
    assert [len(m) for m in means] == [40, 16, 2, 2, 1]
    for m, px in zip(means[:3], stripes, strict=False):
        off = m[:, 0] - (300.0 + 0.2 * m[:, 1])
        assert np.sqrt(np.mean(off**2)) < 2 * noise / 5, "25 rows in each"
        assert m.mean(axis=0) == pytest.approx(px.mean(axis=0)), "no row is left out"
    assert not _gathered([])
    assert len(_gathered([np.zeros((0, 2))])[0]) == 0
