"""What is fixed to the table: markers glued to the platter, or one board standing on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from turnscan.arrays import Floats, Ints, frozen
from turnscan.calibrate._board import Board
from turnscan.rig import Marker, Pose, nearest_rotations

PLATTER = ("slope_x", "slope_y", "bend_xx", "bend_xy", "bend_yy")

# Clockwise from the marker's top left, seen from above: x right, y up.
_SQUARE = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]]) / 2


@dataclass(frozen=True)
class MarkerLayout:
    """Square markers on the platter, each of its own size.

    The platter is the surface z = s_x x + s_y y + b_xx x² + b_xy x y + b_yy y² of the turning table
    frame: slopes where it does not stand square on its axis, bends where it is warped.
    """

    numbers: Ints
    """(m,) ids."""
    squares: Floats
    """(m, 4): centre x, y mm; angle rad of the marker's x edge; side mm."""
    shape: Floats = field(default_factory=lambda: np.zeros(5))
    """(5,) s_x, s_y, and 1/mm: b_xx, b_xy, b_yy."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "numbers", frozen(self.numbers, (None,), "numbers", np.int32))
        m = len(self.numbers)
        object.__setattr__(self, "squares", frozen(self.squares, (m, 4), "squares"))
        object.__setattr__(self, "shape", frozen(self.shape, (5,), "shape"))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the 5 + 4 m parameters."""
        each = [f"marker{n}.{p}" for n in self.numbers for p in ("x", "y", "angle", "side")]
        return (*(f"platter.{p}" for p in PLATTER), *each)

    @property
    def held(self) -> tuple[int, ...]:
        """Parameters that only say where zero is: the first marker's y (it lies on the x axis)."""
        return (6,)

    def points(self, numbers: Ints) -> tuple[Floats, Floats]:
        """Corners of the markers ``numbers`` (k,) → (4 k, 3) mm in the table frame at angle 0 and
        their derivative (4 k, 3, 5 + 4 m)."""
        order = np.argsort(self.numbers)
        at = order[np.searchsorted(self.numbers, numbers, sorter=order)]
        x, y, turn, side = self.squares[at].T[:, :, None]
        c, s = np.cos(turn), np.sin(turn)
        lx, ly = _SQUARE[:, 0], _SQUARE[:, 1]
        ux, uy = c * lx - s * ly, s * lx + c * ly
        flat = np.stack([x + side * ux, y + side * uy], axis=2)
        k = len(at)
        by = np.zeros((k, 4, 3, 5 + self.squares.size))
        rows = np.arange(k)[:, None]
        corner = np.arange(4)[None, :]
        first = 5 + 4 * at[:, None]
        by[rows, corner, 0, first] = 1.0
        by[rows, corner, 1, first + 1] = 1.0
        by[rows, corner, 0, first + 2] = -side * uy
        by[rows, corner, 1, first + 2] = side * ux
        by[rows, corner, 0, first + 3] = ux
        by[rows, corner, 1, first + 3] = uy
        powers = platter_powers(flat)
        slope = self.slope(flat)
        by[:, :, 2] = slope[..., :1] * by[:, :, 0] + slope[..., 1:] * by[:, :, 1]
        by[:, :, 2, :5] = powers
        points = np.concatenate([flat, (powers @ self.shape)[..., None]], axis=2)
        return points.reshape(-1, 3), by.reshape(4 * k, 3, -1)

    def slope(self, xy: Floats) -> Floats:
        """Slope (..., 2) of the platter at places (..., 2) mm."""
        s = self.shape
        x, y = xy[..., 0], xy[..., 1]
        return np.stack([s[0] + 2 * s[2] * x + s[3] * y, s[1] + s[3] * x + 2 * s[4] * y], axis=-1)

    def moved(self, delta: Floats) -> MarkerLayout:
        """The layout with its parameters moved by ``delta`` (5 + 4 m,)."""
        return replace(
            self, shape=self.shape + delta[:5], squares=self.squares + delta[5:].reshape(-1, 4)
        )

    def scaled(self, factor: float) -> MarkerLayout:
        """The layout with all lengths multiplied."""
        return replace(
            self,
            squares=self.squares * np.array([factor, factor, 1.0, factor]),
            shape=self.shape / np.array([1.0, 1.0, factor, factor, factor]),
        )

    def markers(self, dictionary: str) -> tuple[Marker, ...]:
        """The markers as a rig holds them."""
        corners, _ = self.points(self.numbers)
        return tuple(
            Marker(dictionary, int(n), c)
            for n, c in zip(self.numbers, corners.reshape(-1, 4, 3), strict=True)
        )


@dataclass(frozen=True)
class BoardLayout:
    """One board fixed to the turning table, in any pose."""

    board: Board
    pose: Pose
    """Board frame → table frame at angle 0."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the 6 parameters."""
        return tuple(f"board.{p}" for p in ("turn_x", "turn_y", "turn_z", "x", "y", "z"))

    @property
    def held(self) -> tuple[int, ...]:
        """Parameters that only say where zero is: the turn about the axis and the height."""
        return (2, 5)

    def points(self, numbers: Ints) -> tuple[Floats, Floats]:
        """Corners ``numbers`` (k,) → (k, 3) mm in the table frame at angle 0, derivative
        (k, 3, 6)."""
        turned = self.pose.turn(self.board.points[numbers])
        by = np.zeros((len(turned), 3, 6))
        by[:, :, :3] = -cross_matrices(turned)
        by[:, :, 3:] = np.eye(3)
        return turned + self.pose.translation, by

    def plane(self) -> tuple[Floats, Floats, Floats, Floats]:
        """The board at angle 0: normal (3,), a point (3,), and their derivatives (3, 6)."""
        normal = self.pose.rotation[:, 2]
        by_normal, by_point = np.zeros((3, 6)), np.zeros((3, 6))
        by_normal[:, :3] = -cross_matrices(normal[None])[0]
        by_point[:, 3:] = np.eye(3)
        return normal, self.pose.translation, by_normal, by_point

    def moved(self, delta: Floats) -> BoardLayout:
        """The layout with its pose turned and shifted by ``delta`` (6,) in table axes."""
        return replace(self, pose=moved_pose(self.pose, delta))

    def scaled(self, factor: float) -> BoardLayout:
        """The layout with its distances multiplied (the board itself keeps its size)."""
        return replace(self, pose=Pose(self.pose.rotation, self.pose.translation * factor))


Layout: TypeAlias = MarkerLayout | BoardLayout


def platter_powers(xy: Floats) -> Floats:
    """Places (..., 2) mm on the platter → (..., 5): x, y, x², x y, y²."""
    x, y = xy[..., 0], xy[..., 1]
    return np.stack([x, y, x * x, x * y, y * y], axis=-1)


def cross_matrices(v: Floats) -> Floats:
    """(n, 3) → (n, 3, 3) matrices [v]ₓ with [v]ₓ w = v × w."""
    out = np.zeros((len(v), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    out[:, 1, 0], out[:, 2, 0], out[:, 2, 1] = v[:, 2], -v[:, 1], v[:, 0]
    return out


def moved_pose(pose: Pose, delta: Floats) -> Pose:
    """Turn by the rotation vector ``delta[:3]`` in the outer axes, shift by ``delta[3:]``.

    The rotation is made orthonormal again, so that many small steps do not add up.
    """
    return moved_poses((pose,), delta[None])[0]


def moved_poses(poses: Sequence[Pose], delta: Floats) -> tuple[Pose, ...]:
    """`moved_pose` of each by its row of ``delta`` (n, 6)."""
    if not len(poses):
        return ()
    angle = np.maximum(np.linalg.norm(delta[:, :3], axis=1), 1e-300)[:, None, None]
    cross = cross_matrices(delta[:, :3]) / angle
    turn = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    turned = nearest_rotations(turn @ np.stack([T.rotation for T in poses]))
    return tuple(
        Pose(R, T.translation + d[3:]) for R, T, d in zip(turned, poses, delta, strict=True)
    )


def stacked(poses: Sequence[Pose], counts: Sequence[int]) -> tuple[Floats, Floats]:
    """Rotations (n, 3, 3) and shifts (n, 3) mm of poses, each as often as ``counts`` says."""
    of = np.repeat(np.arange(len(poses)), counts)
    return np.stack([T.rotation for T in poses])[of], np.stack([T.translation for T in poses])[of]
