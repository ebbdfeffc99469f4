"""A simulated rig, seen by a camera with known noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turnscan.arrays import Floats
from turnscan.calibrate._board import Board, BoardView, Chessboard
from turnscan.calibrate._layout import MarkerLayout, platter_powers
from turnscan.calibrate._observations import RigNetwork
from turnscan.calibrate._state import RiderView, State, StripeView
from turnscan.rig import Camera, LaserSheet, Pose, Rig, rotation_from_vector

CAMERA = Camera(640, 480, 622.0, 620.0, 322.0, 238.0, np.array([0.12, -0.2, 0.0, 0.0, 0.0]))
SHAPE = np.array([0.002, -0.001, 1e-5, -2e-5, 3e-5])
BOARD = Chessboard(8, 6, 40.0)
TURN = np.arange(0, 360, 15) * np.pi / 180


def true_rig() -> Rig:
    """A camera 600 mm from a table, looking down by 35°, one laser from the left."""
    down = np.radians(35.0)
    up = np.array([0.0, -np.cos(down), -np.sin(down)])
    x = np.array([1.0, 0.0, 0.0])
    R = np.stack([x, np.cross(up, x), up], axis=1)
    T = Pose(R, np.array([4.0, 60.0, 600.0]))
    # A sheet through the axis, standing 25 degrees to the left of the line of sight.
    n = T.turn(np.array([np.cos(np.radians(-35.0)), np.sin(np.radians(-35.0)), 0.0]))
    return Rig(CAMERA, (LaserSheet("laser", n, T.translation - 20 * up),), T)


def true_layout() -> MarkerLayout:
    """Four markers of 27.5 mm, not quite where they should be."""
    squares = np.array(
        [
            [70.0, 0.0, 0.3, 27.4],
            [2.0, 74.0, 1.5, 27.5],
            [-77.0, 3.0, 2.9, 27.6],
            [-4.0, -72.0, 4.5, 27.5],
        ]
    )
    return MarkerLayout(np.array([5, 18, 27, 42], np.int32), squares, SHAPE)


@dataclass
class World:
    """A rig and the dice that make its noise."""

    rig: Rig
    dice: np.random.Generator
    noise: float = 0.1

    def noisy(self, pixels: Floats) -> Floats:
        return pixels + self.noise * self.dice.standard_normal(pixels.shape)

    def board_poses(self, count: int, tilt_deg: float = 35.0) -> list[Pose]:
        """Boards all over the picture, between 500 and 900 mm away."""
        out: list[Pose] = []
        while len(out) < count:
            w = self.dice.uniform(-1, 1, 3) * np.radians([tilt_deg, tilt_deg, 15.0])
            t = np.array([-140.0, -100.0, 0.0]) + self.dice.uniform(-1, 1, 3) * (110, 70, 180)
            T = Pose(rotation_from_vector(w), t + (0, 0, 720.0))
            px = self.rig.camera.project(T.apply(BOARD.points))
            if (px.min() > 3) and (px[:, 0].max() < 636) and (px[:, 1].max() < 476):
                out.append(T)
        return out

    def board_view(self, T: Pose, board: Board = BOARD, name: str = "") -> BoardView:
        px = self.noisy(self.rig.camera.project(T.apply(board.points)))
        return BoardView(board, px, np.arange(len(px), dtype=np.int32), (640, 480), name)

    def stripe(
        self,
        normal: Floats,
        point: Floats,
        rows: Floats,
        near: Floats,
        reach: float,
        laser: str = "laser",
    ) -> StripeView:
        """The stripe on a plane, one centre per row, within ``reach`` mm of ``near``."""
        sheet = self.rig.sheet(laser)
        along = np.cross(sheet.normal, normal)
        A = np.stack([sheet.normal, normal, along])
        start = np.linalg.solve(A, [sheet.normal @ sheet.centre, normal @ point, along @ near])
        s = np.linspace(-reach, reach, 4001)[:, None]
        px = self.rig.camera.project(start + s * along / np.linalg.norm(along))
        order = np.argsort(px[:, 1])
        lo, hi = px[order[0], 1], px[order[-1], 1]
        rows = rows[(rows > lo) & (rows < hi)]
        u = np.interp(rows, px[order, 1], px[order, 0])
        u = u + self.noise * self.dice.standard_normal(len(u))
        return StripeView(laser, np.stack([u, rows], axis=1), np.array([1.0, 0.0]))

    def board_stripe(self, T: Pose, laser: str = "laser") -> StripeView:
        middle = T.apply(BOARD.points.mean(axis=0))
        return self.stripe(
            T.rotation[:, 2], T.translation, np.arange(0.0, 480, 2), middle, 150, laser
        )

    def stand(self, angle: float) -> tuple[Floats, Floats]:
        """Rotation and shift of the table at a true angle, in its frame at rest."""
        return self.rig.turning(angle)

    def rider_view(self, layout: MarkerLayout, angle: float, every: float = 3.0) -> RiderView:
        T = self.rig.T_camera_table
        points, _ = layout.points(layout.numbers)
        turn, shift = self.stand(angle)
        px = self.noisy(self.rig.camera.project(T.apply(points @ turn.T + shift)))
        return RiderView(layout.numbers, px, (self.platter_stripe(layout, angle, every),))

    def platter_stripe(self, layout: MarkerLayout, angle: float, every: float = 3.0) -> StripeView:
        """The stripe on the warped platter, a centre every few rows, within 70 mm of the axis."""
        sheet = self.rig.sheets[0]
        turn, shift = self.stand(angle)
        T = self.rig.T_camera_table @ Pose(turn, shift)
        axis = T.rotation[:, 2]
        along = np.cross(sheet.normal, axis)
        along /= np.linalg.norm(along)
        A = np.stack([sheet.normal, axis, along])
        to = [sheet.normal @ sheet.centre, axis @ T.translation, along @ T.translation]
        flat = np.linalg.solve(A, to) + np.linspace(-70, 70, 4001)[:, None] * along
        rise = axis - (axis @ sheet.normal) * sheet.normal
        rise /= rise @ axis
        points = flat
        for _ in range(4):
            place = T.inverse().apply(points)
            height = platter_powers(place[:, :2]) @ layout.shape
            points = flat + height[:, None] * rise
        px = self.rig.camera.project(points)
        order = np.argsort(px[:, 1])
        rows = np.arange(np.ceil(px[order[0], 1]), px[order[-1], 1], every)
        u = np.interp(rows, px[order, 1], px[order, 0])
        u = u + self.noise * self.dice.standard_normal(len(u))
        return StripeView("laser", np.stack([u, rows], axis=1), np.array([1.0, 0.0]))


def problem(seed: int, noise: float = 0.1, views: int = 14) -> tuple[RigNetwork, State, World]:
    """Observations of a rig, and the state that is true."""
    world = World(true_rig(), np.random.default_rng(seed), noise)
    poses = world.board_poses(views)
    half = views // 2
    boards = tuple(world.board_view(T) for T in poses)
    stripes = tuple(() if i < half else (world.board_stripe(T),) for i, T in enumerate(poses))
    layout = true_layout()
    table = tuple(world.rider_view(layout, a) for a in TURN)
    network = RigNetwork(boards, stripes, table, ("laser",), layout.names)
    return network, State(world.rig, layout, tuple(poses), TURN.copy()), world
