"""All observations of a calibration in one adjustment: boards, stripes, and the table."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np

from turnscan.arrays import Bools, Floats, cross
from turnscan.calibrate._board import BoardView
from turnscan.calibrate._layout import (
    BoardLayout,
    MarkerLayout,
    cross_matrices,
    moved_poses,
    stacked,
)
from turnscan.calibrate._normal import Block
from turnscan.calibrate._prior import RigPrior
from turnscan.calibrate._residuals import (
    CAMERA_SIZE,
    StripeTerm,
    Traced,
    point_term,
    stripe_term,
    trace,
)
from turnscan.calibrate._state import (
    RiderView,
    State,
    StripeView,
    board_stripe,
    bulge,
    platter_stripe,
)
from turnscan.rig import Pose, Wobble, nearest_rotation

BEND = ("board.bend_xx", "board.bend_xy", "board.bend_yy")
BOARD, RIDER = "board corners", "table corners"
_PRIOR_SIDE, _PRIOR_RIG = "prior marker side", "prior rig"
Where = Literal["boards", "table"]


def stripe_kind(where: Where, laser: str) -> str:
    """The kind of the residuals of one laser's stripe on the boards or on the table."""
    return f"stripe on {where} [{laser}]"


@dataclass(frozen=True)
class RigNetwork:
    """The observations. Board views come first among the views, then table views."""

    boards: tuple[BoardView, ...]
    board_stripes: tuple[tuple[StripeView, ...], ...]
    """Per board view: the stripes on it."""
    table: tuple[RiderView, ...]
    lasers: tuple[str, ...]
    layout_names: tuple[str, ...] = ()
    trusted_side: tuple[float, float] | None = None
    """Mean marker side and its uncertainty, mm, where nothing else gives the scale."""
    prior: RigPrior | None = None
    """What was known of the rig before."""
    wobble: bool = False
    """Whether the states' rigs have a motion of the axis, whose parameters then are shared ones."""

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the shared parameters: of the rig, of the layout, of the board's bend."""
        sheet = ("turn_along", "turn_across", "offset", "bow_aa", "bow_ab", "bow_bb")
        lens_names = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "tilt_x", "tilt_y")
        table = ("turn_x", "turn_y", "turn_z", "shift_x", "shift_y", "shift_z")
        return (
            *(f"camera.{n}" for n in lens_names),
            *(f"{laser}.{n}" for laser in self.lasers for n in sheet),
            *(Wobble.NAMES if self.wobble else ()),
            *(f"table.{n}" for n in table),
            *self.layout_names,
            *BEND,
        )

    @cached_property
    def own_sizes(self) -> tuple[int, ...]:
        """Six for a board's pose, one for an angle; the first angle is where zero is."""
        return (6,) * len(self.boards) + tuple(0 if i == 0 else 1 for i in range(len(self.table)))

    def own_words(self, view: int) -> str:
        """What a view's own parameters are, and of which picture."""
        n = len(self.boards)
        if view < n:
            return f"the pose of the board in {self.boards[view].name or f'picture {view + 1}'}"
        name = self.table[view - n].name or f"picture {view - n + 1}"
        return f"the angle of the table in {name}"

    def blocks(self, state: State) -> list[Block]:
        """Residuals and derivatives of all observations at ``state``."""
        out: list[Block] = []
        stripes = [s for group in self.board_stripes for s in group]
        stripes += [s for v in self.table for s in v.stripes]
        pixels = np.concatenate([np.zeros((0, 2)), *(s.pixels for s in stripes)])
        traced, at = trace(state.rig.camera, pixels), 0
        corners, on_boards = self._board_corners(state), self._on_boards(state, traced)
        for i, lit in enumerate(self.board_stripes):
            out += [corners[i], *(on_boards[at + k] for k in range(len(lit)))]
            at += len(lit)
        at = sum(len(s.pixels) for group in self.board_stripes for s in group)
        if self.table:
            out += self._riders(state)
            if isinstance(state.layout, MarkerLayout):
                out += self._platter_stripes(state, traced, at)
                at = len(pixels)
        for k, rider in enumerate(self.table):
            for stripe in rider.stripes if at < len(pixels) else ():
                seen = traced.part(slice(at, at + len(stripe.pixels)))
                out.append(self._rider_stripe(state, k, stripe, seen))
                at += len(stripe.pixels)
        if self.trusted_side is not None and isinstance(state.layout, MarkerLayout):
            out.append(self._side(state.layout, self.trusted_side))
        if self.prior is not None:
            common = self._zeros(len(self.prior.index))
            common[:, self.prior.index] = self.prior.root
            none = np.zeros((len(common), 0))
            out.append(Block(-1, _PRIOR_RIG, self.prior.residual(state.rig), common, none))
        return out

    def moved(self, state: State, common: Floats, own: Sequence[Floats]) -> State:
        """``state`` after a step of the shared parameters and of every view's own."""
        p = len(state.rig.parameter_names)
        rig = state.rig.perturbed(common[:p])
        T = rig.T_camera_table
        rig = replace(rig, T_camera_table=Pose(nearest_rotation(T.rotation), T.translation))
        n = len(self.boards)
        poses = moved_poses(state.poses, np.array(own[:n]).reshape(n, 6))
        turns = np.array([d[0] if len(d) else 0.0 for d in own[n:]])
        layout = None if state.layout is None else state.layout.moved(common[p:-3])
        return State(rig, layout, poses, state.angles + turns, state.bend + common[-3:])

    def free(
        self,
        state: State,
        *,
        camera: bool | Sequence[str] = True,
        bow: bool = False,
        bend: bool = False,
        sheet: bool | Collection[str] = True,
        platter: bool = True,
    ) -> Bools:
        """Which shared parameters the observations at hand should determine.

        ``camera`` may name the distortion coefficients to estimate besides focal lengths and
        principal point, ``sheet`` the lasers. What the prior is about is free, too: it is held by
        its uncertainty.
        """
        names = self.names
        on = np.zeros(len(names), dtype=bool)
        if camera is not False:
            wanted = ("k1", "k2") if camera is True else tuple(camera)
            for name in ("fx", "fy", "cx", "cy", *wanted):
                on[names.index(f"camera.{name}")] = True
        seen = {s.laser for group in self.board_stripes for s in group}
        seen |= {s.laser for v in self.table for s in v.stripes}
        if not isinstance(sheet, bool):
            seen &= set(sheet)
        for laser in seen if sheet else ():
            first = names.index(f"{laser}.turn_along")
            # Light runs straight: a bent sheet is curved along the fan, not along its rays.
            on[first : first + (4 if bow else 3)] = True
        on[-3:] = bend and bool(self.boards)
        if self.table and state.layout is not None:
            table = names.index("table.turn_x")
            on[table - len(self._moves) : -3] = True
            for k in state.layout.held:
                on[table + 6 + k] = False
            if isinstance(state.layout, MarkerLayout) and not platter:
                on[table + 6 : table + 11] = False
        if self.prior is not None:
            on[self.prior.index] = True
        return on

    def _zeros(self, rows: int) -> Floats:
        return np.zeros((rows, len(self.names)))

    @cached_property
    def _cuts(self) -> list[slice]:
        """Which rows are the corners of each board view."""
        ends = np.cumsum([0, *(len(v.points) for v in self.boards)])
        return [slice(int(a), int(b)) for a, b in pairwise(ends)]

    @cached_property
    def _points(self) -> Floats:
        """(n, 3) mm on their boards: the corners of all views."""
        return np.concatenate([np.zeros((0, 3)), *(v.points for v in self.boards)])

    @cached_property
    def _bulges(self) -> Floats:
        """(n, 3) of all corners of the boards: the powers of `bulge`."""
        return np.concatenate([np.zeros((0, 3)), *(bulge(v.board, v.points) for v in self.boards)])

    def _board_corners(self, state: State) -> list[Block]:
        """The corners of the boards, all views at once, then cut into views."""
        if not self.boards:
            return []
        R, shift = stacked(state.poses, [cut.stop - cut.start for cut in self._cuts])
        bent = self._points + self._bulges @ state.bend[:, None] * (0.0, 0.0, 1.0)
        turned = np.einsum("nij,nj->ni", R, bent)
        pixels, by_point, by_camera = point_term(state.rig.camera, turned + shift)
        own = np.concatenate([-by_point @ cross_matrices(turned), by_point], axis=2)
        common = self._zeros(2 * len(pixels))
        common[:, :CAMERA_SIZE] = by_camera.reshape(-1, CAMERA_SIZE)
        up = np.einsum("nij,nj->ni", by_point, R[:, :, 2])
        common[:, -3:] = (up[:, :, None] * self._bulges[:, None, :]).reshape(-1, 3)
        off = np.concatenate([v.corners for v in self.boards]) - pixels
        out = []
        for i, cut in enumerate(self._cuts):
            rows = slice(2 * cut.start, 2 * cut.stop)
            out.append(Block(i, BOARD, off[cut].ravel(), common[rows], own[cut].reshape(-1, 6)))
        return out

    def _on_boards(self, state: State, traced: Traced) -> dict[int, Block]:
        """The stripes on the boards by their number, all of one laser at once."""
        all_of = [(i, s) for i, group in enumerate(self.board_stripes) for s in group]
        starts = np.cumsum([0, *(len(s.pixels) for _, s in all_of)])
        alike: dict[object, list[int]] = {}
        for j, (i, s) in enumerate(all_of):
            alike.setdefault((s.laser, *s.direction, self.boards[i].board), []).append(j)
        out: dict[int, Block] = {}
        for mine in alike.values():
            first, stripe = all_of[mine[0]]
            counts = [len(all_of[j][1].pixels) for j in mine]
            seen = traced.part(np.concatenate([np.arange(starts[j], starts[j + 1]) for j in mine]))
            R, shift = stacked([state.poses[all_of[j][0]] for j in mine], counts)
            term, powers = board_stripe(state, stripe, seen, self.boards[first].board, (R, shift))
            normal = R[:, :, 2]
            swing = cross(term.by_normal, normal)
            own = np.concatenate([-swing, term.by_point], axis=1)
            common = self._sheet_columns(term.by_camera, term.by_sheet, stripe.laser)
            common[:, -3:] = np.einsum("ni,ni->n", term.by_point, normal)[:, None] * powers
            kind = stripe_kind("boards", stripe.laser)
            for j, end, count in zip(mine, np.cumsum(counts), counts, strict=True):
                rows = slice(end - count, end)
                view = all_of[j][0]
                out[j] = Block(view, kind, term.residual[rows], common[rows], own[rows])
        return out

    def _sheet_columns(self, by_camera: Floats, by_sheet: Floats, laser: str) -> Floats:
        common = self._zeros(len(by_camera))
        common[:, :CAMERA_SIZE] = by_camera
        first = CAMERA_SIZE + 6 * self.lasers.index(laser)
        common[:, first : first + 6] = by_sheet
        return common

    @property
    def _table_column(self) -> int:
        return CAMERA_SIZE + 6 * len(self.lasers) + len(self._moves)

    @property
    def _moves(self) -> tuple[str, ...]:
        """Parameters of the axis's own motion, which stand before those of the table."""
        return Wobble.NAMES if self.wobble else ()

    def _swings(self, state: State, angles: Floats) -> tuple[Floats, Floats]:
        """Turns (..., 6, 3) and shifts (..., 6, 3) in camera axes that one unit of each parameter
        of the axis's motion makes at angles (...); (..., 0, 3) where there is none."""
        if not self.wobble:
            none = np.zeros((*np.shape(angles), 0, 3))
            return none, none
        T = state.rig.T_camera_table
        turns, shifts = (T.turn(s) for s in Wobble.slopes(angles))
        return turns, shifts

    def _riders(self, state: State) -> list[Block]:
        """The corners on the table, all pictures at once, then cut into views."""
        assert state.layout is not None
        T = state.rig.T_camera_table
        counts = [len(v.corners) for v in self.table]
        points, by_layout = state.layout.points(np.concatenate([v.numbers for v in self.table]))
        angle = np.repeat(state.angles, counts)
        spin, shift = state.rig.turning(angle)
        arm = np.einsum("nij,nj->ni", spin, points)
        turned = T.turn(arm + shift)
        pixels, by_point, by_camera = point_term(state.rig.camera, turned + T.translation)
        common = self._zeros(2 * len(pixels))
        common[:, :CAMERA_SIZE] = by_camera.reshape(-1, CAMERA_SIZE)
        c = self._table_column
        common[:, c : c + 3] = (-by_point @ cross_matrices(turned)).reshape(-1, 3)
        common[:, c + 3 : c + 6] = by_point.reshape(-1, 3)
        by_layout = by_point @ (T.rotation @ spin) @ by_layout
        common[:, c + 6 : -3] = by_layout.reshape(2 * len(pixels), -1)
        turns, shifts = self._swings(state, angle)
        swing = cross(turns, T.turn(arm)[:, None]) + shifts
        common[:, c - len(self._moves) : c] = np.einsum("nij,nkj->nik", by_point, swing).reshape(
            2 * len(pixels), -1
        )
        by_angle = np.einsum("nij,nj->ni", spin, _quarter_turned(points))
        own = np.einsum("nij,nj->ni", by_point, T.turn(by_angle)).reshape(-1, 1)
        residual = (np.concatenate([v.corners for v in self.table]) - pixels).reshape(-1)
        out = []
        for k, end in enumerate(2 * np.cumsum(counts)):
            part = slice(end - 2 * counts[k], end)
            mine = own[part] if k else own[part, :0]
            out.append(Block(len(self.boards) + k, RIDER, residual[part], common[part], mine))
        return out

    def _platter_stripes(self, state: State, traced: Traced, at: int) -> list[Block]:
        """The stripes on the platter, all pictures of one laser at once, then cut into views."""
        T = state.rig.T_camera_table
        c = self._table_column
        all_of = [(k, s) for k, v in enumerate(self.table) for s in v.stripes]
        starts = at + np.cumsum([0, *(len(s.pixels) for _, s in all_of)])
        out: list[Block] = []
        for laser in dict.fromkeys(s.laser for _, s in all_of):
            mine = [i for i, (_, s) in enumerate(all_of) if s.laser == laser]
            counts = [len(all_of[i][1].pixels) for i in mine]
            where = np.concatenate([np.arange(starts[i], starts[i + 1]) for i in mine])
            angle = np.repeat([state.angles[all_of[i][0]] for i in mine], counts)
            seen = traced.part(where)
            term, powers = platter_stripe(state, all_of[mine[0]][1], seen, angle)
            common = self._sheet_columns(term.by_camera, term.by_sheet, laser)
            normal = T.turn(state.rig.turning(angle)[0][:, :, 2])
            common[:, c : c + 3] = cross(normal, term.by_normal)
            common[:, c + 3 : c + 6] = term.by_point
            up = np.einsum("ni,ni->n", term.by_point, normal)
            common[:, c + 6 : c + 11] = up[:, None] * powers
            turns, shifts = self._swings(state, angle)
            swing = cross(turns, normal[:, None])
            common[:, c - len(self._moves) : c] = _both(term, swing, shifts)
            for i, end, count in zip(mine, np.cumsum(counts), counts, strict=True):
                k, part = all_of[i][0], slice(end - count, end)
                own = np.zeros((count, 0))  # the platter is flat whichever way it is turned
                kind = stripe_kind("table", laser)
                view = len(self.boards) + k
                out.append(Block(view, kind, term.residual[part], common[part], own))
        return out

    def _rider_stripe(self, state: State, k: int, stripe: StripeView, seen: Traced) -> Block:
        """A stripe on the board fixed to the table."""
        assert isinstance(state.layout, BoardLayout)
        T = state.rig.T_camera_table
        c = self._table_column
        spin, shift = state.rig.turning(state.angles[k])
        turn = T.rotation @ spin
        n0, q0, by_n0, by_q0 = state.layout.plane()
        normal, arm = turn @ n0, turn @ q0 + T.turn(shift)
        sheet = state.rig.sheet(stripe.laser)
        term = stripe_term(sheet, seen, stripe.direction, normal, arm + T.translation)
        common = self._sheet_columns(term.by_camera, term.by_sheet, stripe.laser)
        swing = cross_matrices(np.stack([normal, arm]))
        common[:, c : c + 3] = -term.by_normal @ swing[0] - term.by_point @ swing[1]
        common[:, c + 3 : c + 6] = term.by_point
        common[:, c + 6 : -3] = term.by_normal @ (turn @ by_n0) + term.by_point @ (turn @ by_q0)
        turns, shifts = self._swings(state, state.angles[k])
        moved = cross(turns, turn @ q0) + shifts
        common[:, c - len(self._moves) : c] = _both(term, cross(turns, normal), moved)
        axis = T.rotation[:, 2]
        own = term.by_normal @ cross(axis, normal) + term.by_point @ cross(axis, arm)
        view = len(self.boards) + k
        kind = stripe_kind("table", stripe.laser)
        return Block(view, kind, term.residual, common, own[:, None] if k else own[:, None][:, :0])

    def _side(self, layout: MarkerLayout, trusted: tuple[float, float]) -> Block:
        side, sigma = trusted
        common = self._zeros(1)
        m = len(layout.numbers)
        common[0, self._table_column + 6 + 5 + 3 : -3 : 4] = 1.0 / (m * sigma)
        residual = np.array([(side - float(layout.squares[:, 3].mean())) / sigma])
        return Block(-1, _PRIOR_SIDE, residual, common, np.zeros((1, 0)))


def _quarter_turned(points: Floats) -> Floats:
    """Points (n, 3) → z × points (n, 3): how they move as the table turns."""
    return np.stack([-points[:, 1], points[:, 0], np.zeros(len(points))], axis=1)


def _both(term: StripeTerm, normals: Floats, points: Floats) -> Floats:
    """(n, k): derivative of a stripe where k parameters move its plane's normal and point by
    (n, k, 3) or (k, 3) each."""
    many = (len(term.residual), *normals.shape[-2:])
    by: Floats = np.einsum("ni,nki->nk", term.by_normal, np.broadcast_to(normals, many))
    by += np.einsum("ni,nki->nk", term.by_point, np.broadcast_to(points, many))
    return by
