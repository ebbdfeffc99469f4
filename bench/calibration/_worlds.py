"""Rigs calibrated from corners and stripes that stand for pictures, and three balls that they
measure.

The balls' stripes are cut by the true sheet and have little noise, so the rig decides.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from tests.analytic import full_turn, scan_shape
from tests.calibrate.world import World, true_layout, true_rig

from turnscan.arrays import Floats
from turnscan.calibrate import (
    CalibrationSettings,
    LaserPicture,
    MarkerView,
    TablePicture,
    calibrate_rig,
    measured_uncertainty,
)
from turnscan.points import build_grid
from turnscan.rig import Rig
from turnscan.shapes.verification import Survey, ball_at, survey_of_grids
from turnscan.shapes.verification._balls import ball_moves
from turnscan.stripes import Stripe

NOISE, FINE = 0.1, 0.03
"""px: of corners and stripes that calibrate, and of the stripes on the balls."""
STEPS = 24
BALLS = (
    (np.array([14.0, 3.0, 28.0]), 25.0),
    (np.array([-12.0, 8.0, 78.0]), 20.0),
    (np.array([18.0, -14.0, 105.0]), 16.0),
)
"""Centre and radius, mm: three balls beside the axis, one over the other."""
PLACES = ((20.0, 10.0), (40.0, 60.0))
"""Radius and height, mm, at which the report's own uncertainty of the sheet is asked."""


@dataclass(frozen=True)
class Pictures:
    """How many there are of each stage."""

    camera: int
    laser: int
    table: int


USUAL, SMALL, FEW = Pictures(16, 10, 24), Pictures(6, 6, 12), Pictures(6, 4, 12)


@dataclass(frozen=True)
class Outcome:
    """What one calibrated rig measured: errors and stated standard uncertainties, by name."""

    error: Mapping[str, float]
    sigma: Mapping[str, float]

    def z(self, name: str) -> float:
        """Error over the uncertainty stated."""
        return self.error[name] / self.sigma[name]


def calibrated(world: World, pictures: Pictures) -> Rig:
    """From boards held freely, boards under the laser, and a turn of the empty table."""
    free, under = world.board_poses(pictures.camera), world.board_poses(pictures.laser)
    camera = [world.board_view(T, name=f"c{k}") for k, T in enumerate(free)]
    laser = [
        LaserPicture(world.board_view(T, name=f"l{k}"), world.board_stripe(T).pixels)
        for k, T in enumerate(under)
    ]
    layout, table = true_layout(), []
    for k, angle in enumerate(full_turn(pictures.table)):
        seen = world.rider_view(layout, float(angle), every=1.0)
        markers = MarkerView(layout.numbers, seen.corners.reshape(-1, 4, 2))
        table.append(TablePicture(markers, {"laser": seen.stripes[0].pixels}, f"t{k}", k))
    return calibrate_rig(camera, {"laser": laser}, table, CalibrationSettings()).rig


@cache
def stripes_of_balls(moved: float = 0.0) -> list[Stripe]:
    """Without noise, the laser ``moved`` mm along its normal from where `true_rig` has it."""

    def outside(at: Floats) -> Floats:
        away = np.array([np.linalg.norm(at - c, axis=-1) - r for c, r in BALLS])
        nearest: Floats = away.min(axis=0)
        return nearest

    rig = true_rig()
    sheet = rig.sheets[0]
    away = replace(sheet, centre=sheet.centre + moved * sheet.normal)
    return scan_shape(replace(rig, sheets=(away,)), outside, full_turn(STEPS), "laser", sigma=FINE)


def survey(rig: Rig, dice: np.random.Generator, noise: float, moved: float = 0.0) -> Survey:
    """What a scan of the balls gives with what is believed to be its rig."""
    blurred = [
        replace(s, position=s.position + noise * dice.standard_normal(len(s.position)))
        for s in stripes_of_balls(moved)
    ]
    angles = full_turn(STEPS)
    return survey_of_grids([build_grid(rig, "laser", blurred, np.arange(STEPS), angles)], rig)


@cache
def outcome(seed: int, pictures: Pictures) -> Outcome:
    """One rig, calibrated with noise of its own, and what it measures."""
    world = World(true_rig(), np.random.default_rng(seed), NOISE)
    rig = calibrated(world, pictures)
    error, sigma = _balls(survey(rig, world.dice, FINE))
    for radius, height in PLACES:
        off, stated = place_error(rig, world.rig, radius, height)
        for k, what in enumerate(("radius", "height")):
            name = f"{what} of the sheet at {radius:g} / {height:g}"
            error[name], sigma[name] = off[k], stated[k]
    return Outcome(error, sigma)


def _balls(seen: Survey) -> tuple[dict[str, float], dict[str, float]]:
    """Radius, height, distance and angle, as `turnscan.shapes.verification` states them."""
    balls = [ball_at(seen, c, r) for c, r in BALLS]
    shifts = []
    for ball in balls:
        spread = np.unique(np.linspace(0, len(ball.index) - 1, 400).astype(np.intp))
        shifts.append(ball_moves(seen, ball, ball.index[spread])[0])
    true = _lengths(np.array([[*c, r] for c, r in BALLS]))
    found = np.array([[*b.sphere.centre, b.sphere.radius] for b in balls])
    value, slope = _lengths(found), _slopes(found)
    error, sigma = {}, {}
    for name in true:
        J = slope[name]
        own = sum(float(j @ b.sphere.covariance @ j) for j, b in zip(J, balls, strict=True))
        common = sum(np.asarray(p @ j) for p, j in zip(shifts, J, strict=True))
        error[name] = value[name] - true[name]
        sigma[name] = float(np.sqrt(own + np.sum(np.asarray(common) ** 2)))
    return error, sigma


def _lengths(balls: Floats) -> dict[str, float]:
    """Balls (3, 4), centre and radius → radius, height, distance (mm) and angle (rad)."""
    centre = balls[:, :3]
    a, b = centre[1] - centre[0], centre[2] - centre[0]
    turned = float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
    return {
        "radius": float(balls[0, 3]),
        "height": float(centre[2, 2] + balls[2, 3]),
        "distance": float(np.linalg.norm(b)),
        "angle": turned,
    }


def _slopes(balls: Floats) -> dict[str, Floats]:
    """Derivatives (3, 4) of `_lengths` by the balls."""
    out = {name: np.zeros((3, 4)) for name in _lengths(balls)}
    for at in np.ndindex(3, 4):
        moved = [balls.copy(), balls.copy()]
        for sign, each in zip((1e-4, -1e-4), moved, strict=True):
            each[at] += sign
        ends = [_lengths(each) for each in moved]
        for name in out:
            out[name][at] = (ends[0][name] - ends[1][name]) / 2e-4
    return out


def place_error(
    rig: Rig, true: Rig, radius: float, height: float
) -> tuple[Floats, tuple[float, float]]:
    """Errors of radius and height where the true camera sees a place of the true sheet."""
    sheet, T = true.sheet("laser"), true.T_camera_table
    normal, centre = T.inverse().turn(sheet.normal), T.inverse().apply(sheet.centre)
    level = normal @ centre - normal[2] * height
    lead = np.arctan2(normal[1], normal[0])
    spread = np.arccos(level / (np.hypot(normal[0], normal[1]) * radius))
    both = [
        np.array([radius * np.cos(a), radius * np.sin(a), height])
        for a in (lead + spread, lead - spread)
    ]
    at = min(both, key=lambda x: float(np.linalg.norm(T.apply(x))))
    rays = rig.camera.rays(true.camera.project(T.apply(at))[None])
    x, y, z = rig.T_camera_table.inverse().apply(rig.sheet("laser").intersect(rays))[0]
    stated = measured_uncertainty(rig, "laser", radius, height)
    assert stated is not None
    return np.array([np.hypot(x, y) - radius, z - height]), stated
