"""How thick a sheet is, told by stripes on boards, against boards lit by a known one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.calibrate.world import BOARD, World, true_rig
from turnscan.arrays import Floats
from turnscan.calibrate._board import BoardView
from turnscan.calibrate._evidence import LaserPicture
from turnscan.calibrate._state import StripeView
from turnscan.calibrate._thickness import sheet_thickness
from turnscan.errors import FormatError
from turnscan.rig import LaserSheet, Pose, rig_from_json, rig_hash, rig_to_json

THICK, BLUR = 0.6, 0.9
"""mm and px rms."""
Boards = list[tuple[LaserPicture, StripeView, Pose]]


def boards(count: int, tilt_deg: float, noise: float = 0.06) -> Boards:
    """Boards with a stripe of a Gaussian sheet on each, as wide as a shifted sheet's edge says."""
    world = World(true_rig(), np.random.default_rng(3))
    sheet, out = world.rig.sheets[0], []
    moved = replace(sheet, centre=sheet.centre + 0.01 * sheet.normal)
    for k, pose in enumerate(world.board_poses(count, tilt_deg)):
        # Where the sheet and one 0.01 mm beside it meet the board, seen line by line.
        normal = pose.rotation[:, 2]
        v = np.linspace(150.0, 330.0, 60)
        here, beside = (_meets(world, s, pose, normal, v) for s in (sheet, moved))
        wide = np.hypot(np.abs(beside - here) / 0.01 * THICK, BLUR)
        wide *= 1.0 + noise * world.dice.standard_normal(len(wide))
        pixels = np.stack([here, v], axis=1)
        view = BoardView(BOARD, np.zeros((0, 2)), np.zeros(0, np.int32), (640, 480), f"{k}")
        stripe = StripeView("laser", pixels[::2], np.array([1.0, 0.0]))
        out.append((LaserPicture(view, pixels, widths=wide), stripe, pose))
    return out


def _meets(world: World, sheet: LaserSheet, pose: Pose, normal: Floats, v: Floats) -> Floats:
    """(n,) u at which the light of a sheet stands in the lines v of the picture, by bisection."""
    low, high = np.full(len(v), -200.0), np.full(len(v), 840.0)

    def off(u: Floats) -> Floats:
        rays = world.rig.camera.rays(np.stack([u, v], axis=1))
        return sheet.distance(rays * ((pose.translation @ normal) / (rays @ normal))[:, None])

    up = off(high) > off(low)
    for _ in range(60):
        middle = 0.5 * (low + high)
        below = (off(middle) < 0) == up
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return 0.5 * (low + high)


def test_boards_that_lie_unlike_tell_the_thickness_from_the_blur() -> None:
    found = sheet_thickness(true_rig(), "laser", boards(10, 35.0))
    assert found == pytest.approx(THICK, rel=0.12)
    exact = sheet_thickness(true_rig(), "laser", boards(6, 35.0, noise=0.0))
    assert exact == pytest.approx(THICK, rel=0.05)


def test_nothing_is_told_that_the_boards_do_not_tell() -> None:
    some = boards(10, 35.0)
    assert sheet_thickness(true_rig(), "laser", some[:3]) is None, "too few"
    alike = [some[0]] * 8
    assert sheet_thickness(true_rig(), "laser", alike) is None, "one slope"
    bare = [(replace(p, widths=None), s, T) for p, s, T in some]
    assert sheet_thickness(true_rig(), "laser", bare) is None, "widths not kept"
    dice = np.random.default_rng(0)
    wild = [(replace(p, widths=dice.uniform(0.5, 9.0) + 0 * p.widths), s, T) for p, s, T in some]
    assert sheet_thickness(true_rig(), "laser", wild) is None, "widths of something else"


def test_the_thickness_stays_in_the_rigs_file_and_rigs_without_keep_their_text() -> None:
    rig = true_rig()
    assert "thickness" not in rig_to_json(rig)
    known = replace(rig, sheets=(replace(rig.sheets[0], thickness=0.31),))
    assert rig_from_json(rig_to_json(known)).sheets[0].thickness == 0.31
    assert rig_hash(known) != rig_hash(rig)
    with pytest.raises(ValueError, match="thickness"):
        replace(rig.sheets[0], thickness=0.0)
    # Radii would be off by a millimetre.
    thick = replace(rig, sheets=(replace(rig.sheets[0], thickness=9.0),))
    with pytest.raises(FormatError, match=r"laser 'laser' is 9 mm thick .* is no line"):
        rig_from_json(rig_to_json(thick))
