"""What is told twice counts once: a ball and boards in one adjustment, pictures lasers share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from bench.calibration._worlds import NOISE, SMALL, calibrated, place_error

from tests.calibrate.bodies import both, sphere
from tests.calibrate.world import World, true_rig
from turnscan.calibrate import (
    Balls,
    CalibrationSettings,
    LaserPicture,
    RefineSettings,
    calibrate_rig,
    refine,
)

TURN = np.radians(np.arange(0.0, 360.0, 18.0))


def test_a_ball_makes_a_rig_from_boards_better_and_its_uncertainty_stays_honest() -> None:
    """With the camera held, this ball contradicted the boards by 20 standard uncertainties."""
    true = true_rig()
    rig = calibrated(World(true, np.random.default_rng(4), NOISE), SMALL)
    seen = both(true, sphere((14.0, 3.0, 28.0), 25.0), TURN, TURN, 4, noise=NOISE, every=6,
                heights=(4.0, 60.0))  # fmt: skip
    measured = [replace(sweep, moved=False) for sweep in seen]  # its angles come from markers
    body = (Balls(), ((25.0, 0.01),))
    done = refine(rig, measured, RefineSettings(queries=300, rounds=4, body=body))
    assert done.gap_after < 1.2 * done.gap_noise
    assert any(name.startswith("camera.") for name in done.estimated)
    for place in ((20.0, 10.0), (40.0, 60.0)):
        _, before = place_error(rig, true, *place)
        off, after = place_error(done.rig, true, *place)
        assert np.all(np.abs(off) < 3 * np.array(after)), place
        # No less certain than boards alone leave it; the height is that of the platter still.
        assert np.all(np.array(after) < 1.05 * np.array(before)), place
    assert done.shape_after < 0.8 * done.shape_before


def test_a_picture_that_two_lasers_share_is_seen_once() -> None:
    """Each laser is lit on the same boards, and their picture without light is one."""
    world = World(true_rig(), np.random.default_rng(4))
    free = [world.board_view(T, name=f"c{k}") for k, T in enumerate(world.board_poses(6))]
    lit = [
        LaserPicture(world.board_view(T, name=f"l{k}"), world.board_stripe(T).pixels)
        for k, T in enumerate(world.board_poses(6))
    ]
    told = list[str]()
    settings = CalibrationSettings()
    once = calibrate_rig(free, {"laser": lit}, [], settings)
    twice = calibrate_rig([*free, lit[0].view], {"laser": lit, "other": lit}, [], settings,
                          told.append)  # fmt: skip
    assert "camera: 12 board views" in told
    assert len(once.network.boards) == len(twice.network.boards) == 12
    stripes = [sum(len(some) for some in c.network.board_stripes) for c in (once, twice)]
    assert stripes[1] == 2 * stripes[0] > 0
    sigmas = [np.sqrt(c.fit.covariance[:4].diagonal()) for c in (once, twice)]
    assert (sigmas[1] > 0.9 * sigmas[0]).all(), "no corner counts twice"
