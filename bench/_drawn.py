"""A rig calibrated from corners and stripes that are drawn where the true rig sees them.

Boards stand as `_rigs.from_pictures` holds them, and as many; but no picture is rendered and
searched, so that dozens of calibrations cost what one by pictures does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bench._rigs import BOARD, MARGIN, TURN, VIEWS, held_boards, said_of_boards
from turnscan.arrays import Floats
from turnscan.calibrate import BoardView, LaserPicture, TablePicture, calibrate_rig
from turnscan.rig import Pose, Rig, rotation_z
from turnscan.simulate import SimulationSpec, bench

CORNERS, STRIPES = 0.023, 0.55
"""px: noise of the corners of boards, and of stripes on them, as rendered pictures of the modern
rig have it. Their means are off by less than 0.005 px and 0.02 px, which is what chance does."""
_PLACES = 2001
"""Of a stripe that is drawn."""


def from_drawn(spec: SimulationSpec, seed: int, views: tuple[int, int, int] = VIEWS) -> Rig:
    """Calibrate with boards held freely, under the laser, and on the table."""
    free, under, stops = views
    rig = bench(spec).rig
    stand = bench(replace(spec, scene="charuco")).scene.bodies[0].T_table_part
    drawn = _Drawn(rig, np.random.default_rng(seed))
    held = held_boards(drawn.dice, stand, free + under)
    seen = [drawn.board(at, f"free {k}") for k, at in enumerate(held)]
    under_it = list(zip(held[free:], seen[free:], strict=True))
    striped: dict[str, Sequence[LaserPicture]] = {
        sheet.name: [LaserPicture(view, drawn.stripe(at, sheet.name)) for at, view in under_it]
        for sheet in rig.sheets
    }
    start, step = -TURN, 2 * TURN / (stops - 1)
    table = [
        TablePicture(drawn.board(stand, f"table {k}", start + k * step), {}, f"table {k}", k)
        for k in range(stops)
    ]
    return calibrate_rig(seen[:free], striped, table, said_of_boards(stand, step)).rig


class _Drawn:
    """What the true rig sees of the simulator's board, with noise."""

    def __init__(self, rig: Rig, dice: np.random.Generator) -> None:
        self.rig, self.dice = rig, dice

    def board(self, at: Pose, name: str, angle: float = 0.0) -> BoardView:
        """The corners of a board that stands ``at`` a place of the table, turned by ``angle``."""
        px = self._pixels(at, _on_plate(BOARD.points), angle)
        px = px + CORNERS * self.dice.standard_normal(px.shape)
        camera = self.rig.camera
        size = (camera.width, camera.height)
        inside = np.flatnonzero(((px > 0) & (px < np.array(size) - 1)).all(axis=1))
        return BoardView(BOARD, px[inside], inside.astype(np.int32), size, name)

    def stripe(self, at: Pose, laser: str) -> Floats:
        """(n, 2) px: where a laser's sheet cuts a board, once in each row of the picture."""
        x0, y0, x1, y1 = BOARD.extent
        sides = np.array([[x0, y0, 0.0], [x0, y1, 0.0], [x1, y0, 0.0], [x1, y1, 0.0]])
        (a, b, c, d) = (self._to_camera(at, _on_plate(side)) for side in sides)
        share = np.linspace(-MARGIN, y1 - y0 + MARGIN, _PLACES)[:, None] / (y1 - y0)
        left, right = a + share * (b - a), c + share * (d - c)
        sheet = self.rig.sheet(laser)
        off = [(side - sheet.centre) @ sheet.normal for side in (left, right)]
        across = off[0] / (off[0] - off[1])
        margin = MARGIN / (x1 - x0)
        on = (across > -margin) & (across < 1 + margin)
        X = left[on] + across[on, None] * (right[on] - left[on])
        if len(X) < 2:  # the board stands beside the light
            return np.zeros((0, 2))
        px = self.rig.camera.project(X)
        order = np.argsort(px[:, 1])
        rows = np.arange(np.ceil(px[order[0], 1]), px[order[-1], 1])
        columns = np.interp(rows, px[order, 1], px[order, 0])
        columns += STRIPES * self.dice.standard_normal(len(rows))
        return np.column_stack([columns, rows])

    def _pixels(self, at: Pose, plate: Floats, angle: float) -> Floats:
        return self.rig.camera.project(self._to_camera(at, plate, angle))

    def _to_camera(self, at: Pose, plate: Floats, angle: float = 0.0) -> Floats:
        return self.rig.T_camera_table.apply(at.apply(plate) @ rotation_z(angle).T)


def _on_plate(board: Floats) -> Floats:
    """Points (…, 3) of the board's own frame, as they lie on the simulator's plate."""
    x0, _, x1, y1 = BOARD.extent
    x, y = board[..., 0], board[..., 1]
    return np.stack([0.0 * x, x - (x0 + x1) / 2, MARGIN + y1 - y], axis=-1)
