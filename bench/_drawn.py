"""Rigs calibrated from corners and stripes that are drawn where the true rig sees them.

No picture is rendered and searched, so that dozens of calibrations cost what one by pictures does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bench._rigs import BOARD, MARGIN, PRINT, TURN, VIEWS, held_boards, said_of_boards
from turnscan.arrays import Floats, Ints
from turnscan.calibrate import BoardView, Charuco, LaserPicture, TablePicture, calibrate_rig
from turnscan.rig import Pose, Rig, rotation_z
from turnscan.simulate import SimulationSpec, bench

CORNERS, STRIPES, ALONG = 0.025, 0.61, 0.44
"""px: noise of the corners of boards, and of a row of stripes on them, with the correlation of
neighbouring rows, as rendered pictures of the modern rig have it (part ``noise`` of
`bench.calibration`)."""
_EDGE = 3.0
"""px from the picture's edge within which no corner is found."""
_PLACES = 2001
"""Of a stripe that is drawn."""


def from_drawn(spec: SimulationSpec, seed: int, views: tuple[int, int, int] = VIEWS) -> Rig:
    """Calibrate with boards held freely, under the laser, and on the table.

    They stand as `_rigs.from_pictures` holds them, and as many.
    """
    free, under, stops = views
    rig = bench(spec).rig
    stand = bench_board(spec)
    drawn = Drawn(rig, np.random.default_rng(seed))
    held = [rig.T_camera_table @ at @ PRINT for at in held_boards(drawn.dice, stand, free + under)]
    return drawn.calibrated(held[:free], held[free:], stand, stops)


def bench_board(spec: SimulationSpec) -> Pose:
    """Where the simulator's board stands on the table of this rig."""
    return bench(replace(spec, scene="charuco")).scene.bodies[0].T_table_part


class Drawn:
    """What the true rig sees of a board, with noise. Poses are those of the print, in the camera's
    frame."""

    def __init__(self, rig: Rig, dice: np.random.Generator) -> None:
        self.rig, self.dice = rig, dice

    def calibrated(
        self,
        free: Sequence[Pose],
        under: Sequence[Pose],
        stand: Pose,
        stops: int,
        board: Charuco = BOARD,
    ) -> Rig:
        """The rig that boards give which are held ``free``ly and ``under`` the lasers, and the
        simulator's board that ``stand``s on the table in so many ``stops``."""
        seen = [self.board(T, board, f"free {k}") for k, T in enumerate((*free, *under))]
        under_it = list(zip(under, seen[len(free) :], strict=True))
        striped: dict[str, Sequence[LaserPicture]] = {
            sheet.name: [
                LaserPicture(view, self.stripe(T, sheet.name, board)) for T, view in under_it
            ]
            for sheet in self.rig.sheets
        }
        table = self.table(stand, stops)
        said = said_of_boards(stand, 2 * TURN / (stops - 1))
        return calibrate_rig(seen[: len(free)], striped, table, said).rig

    def board(self, T: Pose, board: Charuco = BOARD, name: str = "") -> BoardView:
        """The corners of a board that are in the picture."""
        px, ids = in_picture(self.rig, T, board)
        px = px + CORNERS * self.dice.standard_normal(px.shape)
        size = (self.rig.camera.width, self.rig.camera.height)
        return BoardView(board, px[ids], ids, size, name)

    def stripe(self, T: Pose, laser: str, board: Charuco = BOARD) -> Floats:
        """(n, 2) px: what is found of a laser's stripe on a board, once in each row."""
        px = stripe_of(self.rig, T, laser, board)
        white = np.sqrt(1.0 - ALONG**2) * self.dice.standard_normal(len(px))
        white[:1] /= np.sqrt(1.0 - ALONG**2)
        from scipy.signal import lfilter  # takes a second to load

        noise = lfilter([STRIPES], [1.0, -ALONG], white)
        return np.column_stack([px[:, 0] + noise, px[:, 1]])

    def table(self, stand: Pose, stops: int) -> list[TablePicture]:
        """The simulator's board that ``stand``s on the table, turned by `TURN` to both sides."""
        angles = np.linspace(-TURN, TURN, stops)
        turned = [self.rig.T_camera_table @ Pose(rotation_z(a), np.zeros(3)) for a in angles]
        return [
            TablePicture(self.board(T @ stand @ PRINT, name=f"table {k}"), {}, f"table {k}", k)
            for k, T in enumerate(turned)
        ]


def in_picture(rig: Rig, T: Pose, board: Charuco) -> tuple[Floats, Ints]:
    """(n, 2) px: where a rig sees the corners of a board; and which of them are in its picture."""
    px = rig.camera.project(T.apply(board.points))
    end = np.array([rig.camera.width, rig.camera.height]) - 1 - _EDGE
    return px, np.flatnonzero(((px > _EDGE) & (px < end)).all(axis=1)).astype(np.int32)


def stripe_of(rig: Rig, T: Pose, laser: str, board: Charuco = BOARD) -> Floats:
    """(n, 2) px: where a laser's sheet cuts a board, once in each row of the picture."""
    x0, y0, x1, y1 = board.extent
    (a, b, c, d) = T.apply(np.array([[x0, y0, 0.0], [x0, y1, 0.0], [x1, y0, 0.0], [x1, y1, 0.0]]))
    share = np.linspace(-MARGIN, y1 - y0 + MARGIN, _PLACES)[:, None] / (y1 - y0)
    left, right = a + share * (b - a), c + share * (d - c)
    sheet = rig.sheet(laser)
    off = [(side - sheet.centre) @ sheet.normal for side in (left, right)]
    across = off[0] / (off[0] - off[1])
    margin = MARGIN / (x1 - x0)
    on = (across > -margin) & (across < 1 + margin)
    X = left[on] + across[on, None] * (right[on] - left[on])
    if len(X) < 2:  # the board stands beside the light
        return np.zeros((0, 2))
    px = rig.camera.project(X)
    px = px[np.argsort(px[:, 1])]
    top, end = np.clip(px[[0, -1], 1], 0.0, rig.camera.height - 1.0)
    rows = np.arange(np.ceil(top), end)
    return np.column_stack([np.interp(rows, px[:, 1], px[:, 0]), rows])
