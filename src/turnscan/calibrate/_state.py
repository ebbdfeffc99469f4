"""What a calibration saw on boards and table, what it adjusts, and where that puts the stripes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from turnscan.arrays import Floats, Ints, frozen
from turnscan.calibrate._board import Board
from turnscan.calibrate._layout import Layout, MarkerLayout, platter_powers
from turnscan.calibrate._residuals import StripeTerm, Traced, stripe_term
from turnscan.rig import Pose, Rig


@dataclass(frozen=True)
class StripeView:
    """A laser's stripe on a plane that is known: pixels and the direction they were located in."""

    laser: str
    pixels: Floats
    """(n, 2) px."""
    direction: Floats
    """(2,): (1, 0) for one centre per row, (0, 1) for one per column."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "pixels", frozen(self.pixels, (None, 2), "pixels"))
        object.__setattr__(self, "direction", frozen(self.direction, (2,), "direction"))


@dataclass(frozen=True)
class RiderView:
    """What is fixed to the table, seen in one picture."""

    numbers: Ints
    """Markers (m,) or board corners (n,) that were found."""
    corners: Floats
    """(4 m, 2) or (n, 2) px."""
    stripes: tuple[StripeView, ...] = ()
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "numbers", frozen(self.numbers, (None,), "numbers", np.int32))
        object.__setattr__(self, "corners", frozen(self.corners, (None, 2), "corners"))


@dataclass(frozen=True)
class State:
    """What is adjusted: the rig, what is fixed to the table, every board's pose, every angle."""

    rig: Rig
    layout: Layout | None
    poses: tuple[Pose, ...]
    """Board frame → camera frame, one per board view."""
    angles: Floats
    """(k,) rad, one per table view."""
    bend: Floats = field(default_factory=lambda: np.zeros(3))
    """(3,) 1/mm: b_xx, b_xy, b_yy. The board bulges by z = b_xx x² + b_xy x y + b_yy y² away from
    its plane, x and y from the middle of the pattern."""


def bulge(board: Board, xy: Floats) -> Floats:
    """Board points (n, 2 or more) mm → (n, 3): x², x y, y² from the middle of the pattern."""
    x0, y0, x1, y1 = board.extent
    x, y = xy[:, 0] - (x0 + x1) / 2, xy[:, 1] - (y0 + y1) / 2
    return np.stack([x * x, x * y, y * y], axis=1)


def board_stripe(
    state: State, stripe: StripeView, seen: Traced, board: Board, lies: tuple[Floats, Floats]
) -> tuple[StripeTerm, Floats]:
    """Stripes on boards as bent as the state says, and the bulge (n, 3) where each pixel is.

    ``lies`` (`stacked`) is how the board of each pixel lies in the camera's frame. All pixels are
    of the laser and the direction of ``stripe``.
    """
    R, shift = lies
    normal = R[:, :, 2]
    rays = seen.rays
    across, away = np.einsum("ni,ni->n", rays, normal), np.einsum("ni,ni->n", normal, shift)
    height = np.zeros(len(rays))
    for _ in range(2):
        at = rays * ((away + height) / across)[:, None] - shift
        powers = bulge(board, np.einsum("ni,nij->nj", at, R))
        height = powers @ state.bend
    point = shift + height[:, None] * normal
    term = stripe_term(state.rig.sheet(stripe.laser), seen, stripe.direction, normal, point)
    return term, powers


def platter_stripe(
    state: State, stripe: StripeView, seen: Traced, angle: float | Floats
) -> tuple[StripeTerm, Floats]:
    """A stripe on the platter at a table angle (or one for each point), and the powers (n, 5) of
    the platter's shape."""
    layout = state.layout
    assert isinstance(layout, MarkerLayout)
    T = state.rig.T_camera_table
    rays = seen.rays
    turned, shift = state.rig.turning(angle)
    back = np.broadcast_to(turned, (len(rays), 3, 3))
    normal = back[:, :, 2] @ T.rotation.T
    middle = T.apply(np.broadcast_to(shift, (len(rays), 3)))
    foot = np.einsum("ni,ni->n", normal, middle)
    across = np.einsum("ni,ni->n", rays, normal)
    height = np.zeros(len(rays))
    for _ in range(2):
        flat = T.inverse().apply(rays * ((foot + height) / across)[:, None]) - shift
        place = np.einsum("ni,nij->nj", flat, back)
        powers = platter_powers(place)
        height = powers @ layout.shape
    point = middle + height[:, None] * normal
    sheet = state.rig.sheet(stripe.laser)
    return stripe_term(sheet, seen, stripe.direction, normal, point), powers
