"""A board that rides on the table gives axis and angles, as markers do."""

from __future__ import annotations

import numpy as np

from tests.calibrate.world import World, true_rig
from turnscan.calibrate import (
    BoardView,
    CalibrationSettings,
    LaserPicture,
    TablePicture,
    calibrate_rig,
)
from turnscan.calibrate._board import Chessboard
from turnscan.rig import Pose, rotation_from_vector, rotation_z

SMALL = Chessboard(7, 5, 12.0)


def test_axis_and_angles_from_a_standing_board() -> None:
    world = World(true_rig(), np.random.default_rng(21), 0.1)
    camera = [world.board_view(T, name=f"c{k}") for k, T in enumerate(world.board_poses(10))]
    laser = [
        LaserPicture(world.board_view(T, name=f"l{k}"), world.board_stripe(T).pixels)
        for k, T in enumerate(world.board_poses(8))
    ]
    # Standing upright, facing the camera at angle 0, beside the axis.
    T_tb = Pose(rotation_from_vector([-np.pi / 2, 0, 0]), np.array([-30.0, 12.0, 70.0]))
    T = world.rig.T_camera_table
    truth = np.radians(np.arange(-50, 51, 10.0))
    table = []
    for k, a in enumerate(truth):
        px = world.rig.camera.project(T.apply(T_tb.apply(SMALL.points) @ rotation_z(a).T))
        corners = world.noisy(px)
        corners = corners[::-1] if k % 3 == 1 else corners  # a chessboard read upside down
        view = BoardView(SMALL, corners, np.arange(35, dtype=np.int32), (640, 480), f"t{k}")
        table.append(TablePicture(view, {}, f"t{k}", float(k)))
    settings = CalibrationSettings(table_board=SMALL, lowest=22.0)
    result = calibrate_rig(camera, {"laser": laser}, table, settings)
    have = result.rig.T_camera_table
    off = np.degrees(np.arccos(min(1.0, float(have.rotation[:, 2] @ T.rotation[:, 2]))))
    assert off < 0.5
    reached = T.inverse().apply(have.translation)
    assert np.hypot(reached[0], reached[1]) < 1.5
    up = np.concatenate([np.zeros(3), have.rotation[:, 2]])
    sigma = float(np.sqrt(up @ result.rig.covariance[-6:, -6:] @ up))
    assert sigma < 0.6
    assert abs(reached[2]) < 3 * sigma
    turned = np.degrees(result.fit.state.angles - result.fit.state.angles[0])
    assert np.abs(turned - np.degrees(truth - truth[0])).max() < 0.5
    assert not result.rig.markers
