"""Where the axis of the modern rig comes out, over draws, and what it hangs on.

Corners and stripes stand for rendered pictures, of which one rig takes some ten minutes: corners
have the noise by which the stated uncertainty of the axis is that of the rendered ones (part
``boards``), stripes that of the rig's speckle. In the camera's frame the axis is as far away as the
focal length says, and that is told by how a tilted board narrows: by the size of the board in the
picture, its tilt, and how many there are. What is measured depends on the axis against the sheet,
which the pictures under the laser and on the table tell.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from tests.calibrate.world import World

from bench._rigs import BOARD, MARGIN, ROOM, TURN
from bench.calibration._figures import Figure, at_most
from bench.calibration.boards import MODERN, seen_of, spread_of
from turnscan.arrays import Floats
from turnscan.calibrate import (
    BoardView,
    CalibrationSettings,
    Charuco,
    LaserPicture,
    TablePicture,
    calibrate_rig,
)
from turnscan.rig import Pose, Rig, rotation_from_vector, rotation_z
from turnscan.simulate import SimulationSpec, bench

CORNERS, STRIPES = 0.033, 0.385
"""px"""
LARGE = Charuco(15, 10, 12.0, 9.0, "DICT_5X5_250")
_DEPTH, _ASIDE, _UNDER = 40.0, 0.35, 0.08
"""mm by which boards are nearer or farther than the axis; parts of the picture by which they are
beside its middle, held freely and under the laser."""
_REACH = 0.48
"""Of the board's height: half of the stripe on it that is looked at."""


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
    body = bench(replace(spec, scene="charuco", room=ROOM)).scene.bodies[0]
    assert body.texture is not None
    right, down = (np.asarray(v) / np.linalg.norm(v) for v in (body.texture.right,
                                                               body.texture.down))  # fmt: skip
    corner = body.texture.corner + BOARD.square * (right + down)
    printed = Pose(np.stack([right, down, np.cross(right, down)], axis=1), corner)
    for way in WAYS:
        rigs = [_drawn(true, body.T_table_part @ printed, way, seed) for seed in seeds]
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
    dice = np.random.default_rng(seed)
    corners, stripes = World(true, dice, CORNERS), World(true, dice, STRIPES)
    free, lit = list[BoardView](), list[LaserPicture]()
    while len(free) < way.count:
        T = _pose(true, way.board, way.tilt, _ASIDE, dice)
        view = _view(corners, T, way.board, f"c{len(free)}")
        free += [] if view is None else [view]
    reach = _REACH * (way.board.extent[3] - way.board.extent[1])
    while len(lit) < way.under:
        T = _pose(true, way.board, (0.1, 0.8), _UNDER, dice)
        view = _view(corners, T, way.board, f"l{len(lit)}")
        if view is not None:
            middle, rows = T.apply(_middle(way.board)), np.arange(0.0, true.camera.height)
            seen = stripes.stripe(T.rotation[:, 2], T.translation, rows, middle, reach,
                                  true.sheets[0].name)  # fmt: skip
            lit.append(LaserPicture(view, seen.pixels))
    step = 2 * TURN / (STOPS - 1)
    turns = [Pose(rotation_z(-TURN + k * step), np.zeros(3)) for k in range(STOPS)]
    turned = [
        _view(corners, true.T_camera_table @ turn @ stand, BOARD, f"t{k}")
        for k, turn in enumerate(turns)
    ]
    table = [TablePicture(v, {}, v.name, k) for k, v in enumerate(turned) if v is not None]
    # The table's origin is beside the true one where the lowest corner's height is: along the axis,
    # which moves no axis.
    settings = CalibrationSettings(step=step, table_board=BOARD, margin=MARGIN)
    return calibrate_rig(free, {true.sheets[0].name: lit}, table, settings).rig


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


def _view(world: World, T: Pose, board: Charuco, name: str) -> BoardView | None:
    """What is in the picture of a board; None for one that shows too little."""
    camera = world.rig.camera
    view = world.board_view(T, board, name)
    size = np.array([camera.width, camera.height])
    inside = np.flatnonzero(((view.corners > 3) & (view.corners < size - 4)).all(axis=1))
    if len(inside) < len(view.ids) // 4:
        return None
    return replace(view, corners=view.corners[inside], ids=view.ids[inside],
                   size=(camera.width, camera.height))  # fmt: skip


__all__ = ["figures"]
