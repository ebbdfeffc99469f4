"""How boards are held before the camera: freely, and under the laser.

Given in the camera's frame, about as far away as the rotation axis, tilted about any direction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bench._drawn import Drawn, bench_board, in_picture
from bench._rigs import photographed, print_on_plate
from turnscan.arrays import Floats
from turnscan.calibrate import Charuco
from turnscan.rig import Pose, Rig, rotation_from_vector, rotation_z
from turnscan.simulate import SimulationSpec, bench

LARGE = Charuco(15, 10, 12.0, 9.0, "DICT_5X5_250")
_TILT_UNDER = (0.1, 0.8)
"""rad, of boards under the laser."""
_DEPTH, _ASIDE, _UNDER = 40.0, 0.35, 0.08
"""mm by which boards are nearer or farther than the axis; parts of the picture by which they are
beside its middle, held freely and under the laser."""


@dataclass(frozen=True)
class Held:
    """How the boards of the camera were photographed."""

    words: str
    board: Charuco
    count: int
    tilt: tuple[float, float]
    """rad, from and to."""
    under: int = 12
    """How many of them were photographed under the laser."""

    def poses(self, true: Rig, dice: np.random.Generator) -> tuple[list[Pose], list[Pose]]:
        """Of the print in the camera's frame, held freely and under the laser, where enough of the
        board is in the picture."""
        ways = ((self.count, self.tilt, _ASIDE), (self.under, _TILT_UNDER, _UNDER))
        free, under = (
            [_in_view(true, self.board, tilt, aside, dice) for _ in range(count)]
            for count, tilt, aside in ways
        )
        return free, under


STANDARD = Held("20 + 12 of a board of 180 × 120 mm, tilted 34 to 57°", LARGE, 20, (0.6, 1.0))
"""One that fills the picture of the modern rig."""


def from_large_boards(
    spec: SimulationSpec, views: tuple[int, int, int], held: Held = STANDARD
) -> Rig:
    """Calibrate with rendered pictures of a large board, held freely and under the laser, and of
    the simulator's board on the table; ``views`` says how many of each."""
    true, on_plate = bench(spec).rig, print_on_plate(held.board).inverse()
    as_many = replace(held, count=views[0], under=views[1])
    of_print = as_many.poses(true, np.random.default_rng(spec.seed))
    free, under = (
        [true.T_camera_table.inverse() @ T @ on_plate for T in some] for some in of_print
    )
    return photographed(spec, free, under, views[2], held.board)


def from_large_drawn(
    spec: SimulationSpec, seed: int, views: tuple[int, int, int], held: Held = STANDARD
) -> Rig:
    """The same with corners and stripes that are drawn (`Drawn`)."""
    true = bench(spec).rig
    drawn = Drawn(true, np.random.default_rng(seed))
    as_many = replace(held, count=views[0], under=views[1])
    free, under = as_many.poses(true, drawn.dice)
    return drawn.calibrated(free, under, bench_board(spec), views[2], held.board)


def _middle(board: Charuco) -> Floats:
    x0, y0, x1, y1 = board.extent
    return np.array([(x0 + x1) / 2, (y0 + y1) / 2, 0.0])


def _in_view(
    true: Rig, board: Charuco, tilt: tuple[float, float], aside: float, dice: np.random.Generator
) -> Pose:
    while True:
        T = _pose(true, board, tilt, aside, dice)
        if len(in_picture(true, T, board)[1]) >= len(board.points) // 4:
            return T


def _pose(
    true: Rig, board: Charuco, tilt: tuple[float, float], aside: float, dice: np.random.Generator
) -> Pose:
    """A board about as far from the camera as the axis, tilted about any direction."""
    camera = true.camera
    z = float(true.T_camera_table.translation[2]) + dice.uniform(-1, 1) * _DEPTH
    x, y = dice.uniform(-aside, aside, 2) * (camera.width, camera.height)
    about = dice.uniform(0, 2 * np.pi)
    lean = dice.uniform(*tilt) * np.array([np.cos(about), np.sin(about), 0.0])
    R = rotation_from_vector(lean) @ rotation_z(dice.uniform(-0.4, 0.4))
    return Pose(R, np.array([x / camera.fx * z, y / camera.fy * z, z]) - R @ _middle(board))
