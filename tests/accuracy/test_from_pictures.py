"""Pictures → calibration → scan → truth: nothing here measures with the rig that it should find.

What is asserted are the errors over the uncertainties that turnscan states: `measured_uncertainty`
for a place on the sheet, as the calibration's report prints it, and for a size the fit's own
(noise of the points) together with `rig_moves` (what the calibration leaves open).

- Sixteen rigs are calibrated from corners and stripe centres with known noise, which stand for
  pictures; the scan's stripes are cut by the true sheet. No picture is rendered there, so detection
  is not in it, and neither speckle nor the thickness of the light.
- One is calibrated and scans with rendered pictures, noise and speckle and all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from bench._rigs import from_pictures
from bench.accuracy import SPHERE, scan
from bench.calibration._worlds import place_error

from tests.analytic import full_turn, scan_shape
from tests.calibrate.world import World, true_layout, true_rig
from turnscan.arrays import Floats
from turnscan.calibrate import (
    CalibrationSettings,
    LaserPicture,
    MarkerView,
    TablePicture,
    calibrate_rig,
)
from turnscan.points import RangeGrid, build_grid, pixels_of, rig_moves
from turnscan.rig import Rig
from turnscan.shapes import Sphere, fit_sphere
from turnscan.simulate import SimulationSpec, bench, seconds_of
from turnscan.stripes import Stripe

SEEDS = range(16)
NOISE, FINE = 0.1, 0.03
"""px, of what calibrates and of the scan's stripes: so the rig decides, not the points, whose sigma
is the whole way that they move along the sheet and so too large where a surface leans."""
BOARDS, STOPS, ANGLES = 6, 12, 6
BALLS = ((np.array([0.0, 0.0, 30.0]), 25.0), (np.array([0.0, 0.0, 85.0]), 18.0))
"""Centre and radius, mm: two balls on the axis, one on top of the other."""
PLACES = ((20.0, 10.0), (40.0, 60.0))
"""Radius and height, mm, at which the sheet is asked."""
LEAST, MOST = 0.65, 1.35
"""Of sixteen independent z the rms is 1 ± 0.18: these are two standard deviations. A hundred rigs,
and so a third of that, are a bench's (`python -m bench calibration`)."""
ALL_LEAST, ALL_MOST = 0.8, 1.25
"""Of all of them together."""


def calibrated(world: World) -> Rig:
    """From boards held freely, boards under the laser, and a turn of the empty table."""
    camera = [world.board_view(T, name=f"c{k}") for k, T in enumerate(world.board_poses(BOARDS))]
    laser = [
        LaserPicture(world.board_view(T, name=f"l{k}"), world.board_stripe(T).pixels)
        for k, T in enumerate(world.board_poses(BOARDS))
    ]
    layout, table = true_layout(), []
    for k, angle in enumerate(full_turn(STOPS)):
        seen = world.rider_view(layout, float(angle), every=1.0)
        markers = MarkerView(layout.numbers, seen.corners.reshape(-1, 4, 2))
        table.append(TablePicture(markers, {"laser": seen.stripes[0].pixels}, f"t{k}", k))
    return calibrate_rig(camera, {"laser": laser}, table, CalibrationSettings()).rig


@pytest.fixture(scope="module")
def exact() -> list[Stripe]:
    def outside(at: Floats) -> Floats:
        return np.minimum(*(np.linalg.norm(at - c, axis=-1) - r for c, r in BALLS))

    return scan_shape(true_rig(), outside, full_turn(ANGLES), "laser", sigma=FINE)


@dataclass
class Sizes:
    """Balls fitted to a grid, and what the rig's calibration does to them."""

    grid: RangeGrid
    rig: Rig
    balls: tuple[tuple[Floats, float], ...] = BALLS

    def fitted(self, move: Floats | float = 0.0) -> list[Sphere]:
        """Each ball, all points moved by ``move`` (n, 3) mm."""
        at, sigma = self.grid.points[self.grid.found], self.grid.sigma[self.grid.found]
        near = [np.abs(np.linalg.norm(at - c, axis=1) - r) < 2.0 for c, r in self.balls]
        return [fit_sphere((at + move)[k], sigma[k]) for k in near]

    def values(self, move: Floats | float = 0.0) -> Floats:
        """Radius and height of the uppermost ball, and the distance of the centres, mm."""
        balls = self.fitted(move)
        apart = np.linalg.norm(balls[-1].centre - balls[0].centre)
        return np.array([balls[-1].radius, balls[-1].centre[2] + balls[-1].radius, apart])

    def uncertainties(self) -> Floats:
        """Standard uncertainties of `values`, mm."""
        step, _ = np.nonzero(self.grid.found)
        angles = self.grid.angles[step]
        pixels = pixels_of(self.rig, self.grid.points[self.grid.found], angles)
        known = self.values()
        moves = rig_moves(self.rig, self.grid.laser, pixels, angles)
        common = sum((self.values(move) - known) ** 2 for move in moves)
        first, last = (b.covariance for b in (self.fitted()[0], self.fitted()[-1]))
        up = np.array([0.0, 0.0, 1.0, 1.0])
        noise = [last[3, 3], up @ last @ up, first[2, 2] + last[2, 2]]
        return np.sqrt(common + np.array(noise))


def place_errors(rig: Rig, true: Rig) -> list[float]:
    """z of radius and height at `PLACES`, for the pixel in which the true camera sees each."""
    out: list[float] = []
    for radius, height in PLACES:
        off, stated = place_error(rig, true, radius, height)
        out += [off[0] / stated[0], off[1] / stated[1]]
    return out


def test_stated_uncertainties_are_the_errors_of_calibrated_rigs(
    exact: list[Stripe],
) -> None:
    """Radius, height and distance of a scan, and radius and height of places on the sheet."""
    (_, _), (top, radius) = BALLS
    truth = np.array([radius, top[2] + radius, 55.0])
    z, stated = [], []
    for seed in SEEDS:
        world = World(true_rig(), np.random.default_rng(seed), NOISE)
        rig = calibrated(world)
        draw = world.dice.standard_normal
        blurred = [replace(s, position=s.position + FINE * draw(len(s.position))) for s in exact]
        angles = full_turn(ANGLES)
        sizes = Sizes(build_grid(rig, "laser", blurred, np.arange(ANGLES), angles), rig)
        known = sizes.uncertainties()
        z.append([*(sizes.values() - truth) / known, *place_errors(rig, world.rig)])
        stated.append(known)
    rms = np.sqrt(np.mean(np.square(z), axis=0))
    assert (rms > LEAST).all(), rms
    assert (rms < MOST).all(), rms
    assert ALL_LEAST < np.sqrt(np.mean(np.square(z))) < ALL_MOST
    assert np.abs(z).max() < 4.5
    assert (np.abs(np.mean(z, axis=0)) < 0.5).all()
    # 0.1 px are some 0.1 mm here; averaged over the views, a few hundredths are left.
    assert (np.mean(stated, axis=0) > 0.01).all()
    assert (np.mean(stated, axis=0) < 0.08).all()


def test_a_scan_with_a_rig_calibrated_from_rendered_pictures() -> None:
    """A ball of 40 mm: radius and height, within three of the uncertainties stated.

    The thickness of the light takes 0.8 · 3/2 σ²/R off the radius, which no uncertainty holds
    (docs/explain/accuracy.md); σ is 0.61 mm.
    """
    spec = SimulationSpec("sphere", "paper", lasers=1, seed=3)
    made = bench(spec)
    rig = from_pictures(spec, (4, 5, 6))
    real = scan(made, seconds_of(spec), 6, rig)
    ball = ((np.array([0.0, 0.0, SPHERE]), SPHERE),)
    sizes = Sizes(real.grid, rig, ball)
    optics = -0.8 * 1.5 * 0.61**2 / SPHERE
    truth = np.array([SPHERE + optics, 2 * SPHERE + optics])
    off, stated = sizes.values()[:2] - truth, sizes.uncertainties()[:2]
    assert (stated < 0.2).all()
    assert (np.abs(off) < 3 * stated).all(), (off, stated)
