"""A hand that holds a calibration board before the camera, and puts it on the table."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from turnscan.rig import Pose, rotation_from_vector
from turnscan.simulate._bench import Bench
from turnscan.simulate._boards import board
from turnscan.simulate._random import seed64

_TILT, _ROLL = math.radians(32.0), math.radians(12.0)
_DEPTHS = 0.8, 1.15
"""Of the distance to the axis."""
_BESIDE = 30.0
"""mm between the board's middle and the stripe, at most."""
_ABOVE = 2.0
"""mm that it stays above the platter."""
_FACING = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
"""A board's frame (its print looks along +x, z up) → the camera's, the board facing it."""


class Hand:
    """One board on one bench; how it is held follows from the bench's seed and how often it was.

    The first time and each second one after it is held into the light of a laser, one after the
    other; else anywhere.
    """

    def __init__(self, bench: Bench, name: str) -> None:
        self._bench, self._board = bench, board(name)
        self._platter = bench.scene.bodies[-1]
        edge = self._platter.part.mesh.vertices[:, :2]
        self._reach = float(np.hypot(*edge.T).max())

    def standing(self) -> Bench:
        """The board stands on the table, in the place of the part, and turns with it."""
        return self._showing(self._board.T_table_part)

    def holding(self, time: int, angle: float) -> Bench:
        """The board held for the ``time``-th time, the table's true angle being ``angle``."""
        bench, camera = self._bench, self._bench.rig.camera
        u = np.random.default_rng(int(seed64(bench.seed, time, 23))).uniform(-1.0, 1.0, 6)
        R = _FACING @ rotation_from_vector((_ROLL * u[0], _TILT * u[1], _TILT * u[2]))
        v = self._board.part.mesh.vertices
        middle = (v.min(axis=0) + v.max(axis=0)) / 2
        at = np.array([(0.5 + 0.3 * u[3]) * camera.width, (0.5 + 0.25 * u[4]) * camera.height])
        axis = float(np.linalg.norm(bench.rig.T_camera_table.translation))
        depth = axis * float(np.interp(u[5], (-1.0, 1.0), _DEPTHS))
        place = camera.rays(at) * depth
        if time % 2 == 1:
            sheets = bench.rig.sheets
            sheet = sheets[time // 2 % len(sheets)]
            place[0] -= float(sheet.distance(place)) / sheet.normal[0] + _BESIDE * u[3]
        held = Pose(R, place - R @ middle)
        T = bench.rig.T_camera_table.inverse() @ held
        corners = T.apply(v)
        over = np.hypot(*T.apply(middle)[:2]) < self._reach + float(np.ptp(v[:, 1])) / 2
        lift = max(0.0, _ABOVE - float(corners[:, 2].min())) if over else 0.0
        T = Pose(T.rotation, T.translation + (0.0, 0.0, lift))
        return self._showing(bench.motion.pose(angle).inverse() @ T)

    def _showing(self, T: Pose) -> Bench:
        bodies = (replace(self._board, T_table_part=T), self._platter)
        return replace(self._bench, scene=replace(self._bench.scene, bodies=bodies))
