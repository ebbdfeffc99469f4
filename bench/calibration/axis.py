"""Where the axis of the modern rig comes out, over draws, and what it hangs on.

Corners and stripes are drawn with the noise that those of rendered pictures have (`bench._drawn`),
of which one rig takes some ten minutes. In the camera's frame the axis is as far away as the
focal length says, and that is told by how a tilted board narrows: by the size of the board in the
picture, its tilt, and how many there are. What is measured depends on the axis against the sheet,
which the pictures under the laser and on the table tell.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bench._drawn import Drawn, bench_board
from bench._rigs import BOARD, MARGIN, TURN
from bench.calibration._figures import Figure, at_most
from bench.calibration.boards import MODERN, seen_of, spread_of
from turnscan.arrays import Floats
from turnscan.calibrate import (
    BoardView,
    CalibrationSettings,
    Charuco,
    LaserPicture,
    calibrate_rig,
)
from turnscan.rig import Pose, Rig, rotation_from_vector, rotation_z
from turnscan.simulate import SimulationSpec, bench

LARGE = Charuco(15, 10, 12.0, 9.0, "DICT_5X5_250")
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


WAYS = (
    Held("20 + 12 of a board of 108 × 72 mm, tilted 17 to 52°", BOARD, 20, (0.3, 0.9)),
    Held("80 + 48 of it", BOARD, 80, (0.3, 0.9), 48),
    Held("20 + 12 of a board of 180 × 120 mm, tilted 34 to 57°", LARGE, 20, (0.6, 1.0)),
    Held("40 + 24 of it", LARGE, 40, (0.6, 1.0), 24),
)
STOPS = 24
"""Pictures of the small board on the turning table."""


def figures(quick: bool) -> Iterator[Figure]:
    """Median and largest errors over the draws; the last way is what is asked for."""
    seeds = range(4 if quick else 16)
    spec = SimulationSpec("ball-bar", "modern", lasers=1)
    true = bench(spec).rig
    stand = bench_board(spec)
    for way in WAYS:
        rigs = [_drawn(true, stand, way, seed) for seed in seeds]
        yield from _lines(true, rigs, way)


def _lines(true: Rig, rigs: list[Rig], way: Held) -> Iterator[Figure]:
    laser, asked = true.sheets[0].name, way is WAYS[-1]
    basis = np.linalg.svd(true.T_camera_table.rotation[:, 2:].T)[2][1:]
    off = np.array([seen_of(rig, laser, basis) - seen_of(true, laser, basis) for rig in rigs])
    told = np.mean([np.diag(spread_of(rig, laser, basis)) for rig in rigs], axis=0)
    for what, unit, part, k in (
        ("axis in the camera's frame, off", "mm", slice(0, 2), 0),
        ("axis in the camera's frame, turned", "°", slice(2, 4), 1),
        ("axis from the sheet, off", "mm", slice(4, 5), 0),
        ("axis to the sheet, turned", "°", slice(5, 6), 1),
    ):
        size = np.linalg.norm(off[:, part], axis=1)
        line = at_most(f"{way.words}: {what}", float(size.max()), MODERN[k], unit, 4)
        words = (
            f"median {np.median(size):.4f}, largest {size.max():.4f} {unit} of {len(size)} draws"
        )
        words += f" (U = {2 * np.sqrt(told[part].sum()):.4f} {unit})"
        yield Figure(line.name, line.asked if asked else "", words, line.met if asked else None)


def _drawn(true: Rig, stand: Pose, way: Held, seed: int) -> Rig:
    drawn = Drawn(true, np.random.default_rng(seed))
    laser = true.sheets[0].name
    free, lit = list[BoardView](), list[LaserPicture]()
    while len(free) < way.count:
        T = _pose(true, way.board, way.tilt, _ASIDE, drawn.dice)
        view = drawn.board(T, way.board, f"c{len(free)}")
        free += [view] if _shows_enough(view) else []
    while len(lit) < way.under:
        T = _pose(true, way.board, (0.1, 0.8), _UNDER, drawn.dice)
        view = drawn.board(T, way.board, f"l{len(lit)}")
        if _shows_enough(view):
            lit.append(LaserPicture(view, drawn.stripe(T, laser, way.board)))
    step = 2 * TURN / (STOPS - 1)
    table = drawn.table(stand, STOPS)
    # The table's origin is beside the true one where the lowest corner's height is: along the axis,
    # which moves no axis.
    settings = CalibrationSettings(step=step, table_board=BOARD, margin=MARGIN)
    return calibrate_rig(free, {laser: lit}, table, settings).rig


def _middle(board: Charuco) -> Floats:
    x0, y0, x1, y1 = board.extent
    return np.array([(x0 + x1) / 2, (y0 + y1) / 2, 0.0])


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


def _shows_enough(view: BoardView) -> bool:
    return len(view.ids) >= len(view.board.points) // 4


__all__ = ["figures"]
