"""First values of a calibration, stage by stage: camera, sheets, table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.calibrate._adjust import Fit, adjust
from turnscan.calibrate._board import BoardView
from turnscan.calibrate._evidence import CalibrationSettings, LaserPicture, Rejected, TablePicture
from turnscan.calibrate._layout import Layout, MarkerLayout
from turnscan.calibrate._light import measuring_direction
from turnscan.calibrate._observations import BOARD, RigNetwork
from turnscan.calibrate._prior import RigPrior, like, prior_of
from turnscan.calibrate._select import on_platter, straighter
from turnscan.calibrate._start import FEWEST_VIEWS, board_pose, same_size, start_camera, start_sheet
from turnscan.calibrate._start_table import FEWEST_STEPS, start_board, start_markers
from turnscan.calibrate._state import RiderView, State, StripeView
from turnscan.errors import Degenerate, InputError, NotEnoughViews
from turnscan.remedy import Option, Remedy
from turnscan.rig import Camera, Pose, Rig

_ALIEN_PX = 5.0
"""rms of a board's corners before a known camera, above which it was taken by another one."""

_SAME_PX = 0.01
"""By which corners of one picture, read twice, differ at most."""
REJECT = 3.0  # times the usual residual of a view
_STRAY, _STRAY_PX, _FEW_STRAYS = 6.0, 0.1, 0.15
"""Times the usual residual of a corner in its view, and px of that at least, from which it is a
stray; and their share of the corners, at most."""
_STRIPE_POINTS, _FEWEST_MEANS = 40, 2
"""Of the longest stripe, each the mean of neighbours, which share some of their errors (speckle);
and of each stripe at least."""
_SCALE_TRUST = 0.02  # of the nominal marker side, where nothing measures it
_LEAST_TILT = np.radians(8.0)
_UNSURE_FOCUS = 0.05
_UP = np.array([0.0, -1.0, 0.0])
_LEAST_REACH = 0.3
"""Of a marker's side: how far from the axis the farthest marker must be."""
_OTHERS, _FEWEST_OTHERS = 0.25, 3
"""Of the stripes on boards, and at least: so many in a second sheet are no chance."""
_FIXED = ("camera", "table")
"""Stages that are no lasers."""


@dataclass(frozen=True)
class KnownRig:
    """A rig, or part of one, that was known before."""

    rig: Rig
    counts: bool = False
    """Whether it counts, by its uncertainty, for stages with pictures too, as a ruler's numbers do;
    else these start anew."""


@dataclass(frozen=True)
class Stages:
    """Which stages of a calibration have pictures, and what is known of the others."""

    given: tuple[str, ...]
    """"camera", names of lasers, "table"."""
    known: KnownRig | None = None

    @property
    def held(self) -> tuple[str, ...]:
        """The stages without pictures that were known before."""
        if self.known is None:
            return ()
        rig = self.known.rig
        some = ["camera", *(s.name for s in rig.sheets), *(["table"] if rig.table_known else [])]
        return tuple(s for s in some if s not in self.given)

    def prior(self, now: Rig) -> RigPrior | None:
        """What was known before about the rig as it is ``now``, and still counts."""
        if self.known is None:
            return None
        rig = self.known.rig
        counting = set(self.held)
        if self.known.counts:
            counting |= {s for s in self.given if s in (*_FIXED, *(x.name for x in rig.sheets))}
        return prior_of(rig, now, counting, anew="table" in self.given)

    def free(self, network: RigNetwork, state: State) -> Bools:
        """Which shared parameters the pictures and what is known determine."""
        lens = ("k1", "k2", "p1", "p2") if "camera" in self.given else False
        lasers = set(self.given) - set(_FIXED)
        return network.free(state, camera=lens, bend=True, sheet=lasers)


def with_rest(state: State, known: KnownRig | None) -> State:
    """The state with what was known of sheets and table."""
    if known is None:
        return state
    camera, before = state.rig.camera, known.rig.camera
    if (camera.width, camera.height) != (before.width, before.height):
        raise InputError(
            f"the boards are {camera.width}×{camera.height}, but the rig's camera has "
            f"{before.width}×{before.height}",
            hint="calibrate with pictures of one camera at one resolution",
        )
    return replace(state, rig=replace(known.rig, camera=camera, covariance=None))


def known_camera_stage(
    rig: Rig, with_stripe: list[tuple[str, LaserPicture]], rejected: list[Rejected]
) -> tuple[State, list[tuple[str, LaserPicture]]]:
    """Poses of the boards before a camera that is known; boards of another one are dropped."""
    camera = rig.camera
    views = [p.view for _, p in with_stripe]
    for v in views:
        if v.size != (camera.width, camera.height):
            raise InputError(
                f"{v.name} is {v.size[0]}×{v.size[1]}, but the rig's camera has "
                f"{camera.width}×{camera.height}",
                hint="calibrate with pictures of one camera at one resolution",
            )
    poses = [board_pose(camera, v) for v in views]
    off = [camera.project(T.apply(v.points)) - v.corners for v, T in zip(views, poses, strict=True)]
    rms = np.array([float(np.sqrt(np.mean(r**2))) for r in off])
    if len(rms) and float(np.median(rms)) > _ALIEN_PX:
        raise Degenerate(
            f"the boards are {np.median(rms):.1f} px rms off where the rig's camera would see them",
            hint="calibrate the camera again: its lens or focus has changed",
        )
    bad = rms > REJECT * max(float(np.median(rms)), 0.1) if len(rms) else np.zeros(0, bool)
    for i in np.flatnonzero(bad):
        clean = without_strays(views[i], off[i])
        if clean is not views[i]:
            with_stripe[i] = with_stripe[i][0], replace(with_stripe[i][1], view=clean)
            poses[i], bad[i] = board_pose(camera, clean), False
    for (name, p), r, b in zip(with_stripe, rms, bad, strict=True):
        if b:
            reason = f"corners {r:.2f} px rms off, the other views {np.median(rms):.2f} px"
            rejected.append(Rejected(f"laser {name}", p.view.name, reason))
    with_stripe = [p for p, b in zip(with_stripe, bad, strict=True) if not b]
    kept = tuple(T for T, b in zip(poses, bad, strict=True) if not b)
    state = State(replace(rig, covariance=None), None, kept, np.zeros(0))
    return state, with_stripe


def refuse_no_boards(asked: Sequence[BoardView], kept: Sequence[BoardView]) -> None:
    if len(kept) >= FEWEST_VIEWS:
        return
    why = next((v for v in asked if v.failure), None)
    example = f"; {why.name}: {why.failure}" if why else ""
    raise NotEnoughViews(
        f"camera: the board was found in {len(kept)} of {len(asked)} pictures, at least "
        f"{FEWEST_VIEWS} are needed{example}",
        hint=Remedy(
            "check the size of the board (",
            Option("board"),
            " counts inner corners of a chessboard, squares of a ChArUco board) and that it is in "
            "focus and evenly lit",
        ),
    )


def same_picture(a: BoardView, b: BoardView) -> bool:
    """Whether two views show exactly the same: a second look differs by its noise."""
    alike = a.board == b.board and np.array_equal(a.ids, b.ids)
    return alike and bool(np.abs(a.corners - b.corners).max(initial=0) < _SAME_PX)


def distinct(views: list[BoardView], rejected: list[Rejected]) -> list[BoardView]:
    """Drop pictures that show exactly what another one shows: a copy is not a second look."""
    out: list[BoardView] = []
    for v in views:
        twin = next((o for o in out if same_picture(v, o)), None)
        if twin is None:
            out.append(v)
        else:
            rejected.append(Rejected("camera", v.name, f"a copy of {twin.name}"))
    return out


def camera_stage(
    kept: list[BoardView],
    with_stripe: list[tuple[str, LaserPicture]],
    rejected: list[Rejected],
) -> tuple[State, list[BoardView], list[tuple[str, LaserPicture]]]:
    """Camera, poses and the board's bend from all boards.

    Of a view that does not fit, the few corners that are off are dropped; where they are not few,
    all of it.
    """
    same_size([*kept, *(p.view for _, p in with_stripe)])
    camera, poses = start_camera(kept)
    _refuse_no_tilt(poses)
    poses = (*poses, *(board_pose(camera, p.view) for _, p in with_stripe))
    state = State(Rig(camera, (), Pose(), table_known=False), None, poses, np.zeros(0))
    while True:
        boards = (*kept, *(p.view for _, p in with_stripe))
        network = RigNetwork(boards, tuple(() for _ in boards), (), ())
        fit = adjust(network, state, network.free(state, camera=("k1", "k2"), bend=True))
        state = fit.state
        rms = np.array([fit.rms(BOARD, i) for i in range(len(boards))])
        bad = rms > REJECT * float(np.median(rms))
        if not bad.any() or np.count_nonzero(~bad) < FEWEST_VIEWS:
            _refuse_unsure_focus(fit)
            return state, kept, with_stripe
        off = [b.residual.reshape(-1, 2) for b in fit.blocks if b.kind == BOARD]
        clean = [without_strays(v, r) if b else v for v, r, b in zip(boards, off, bad, strict=True)]
        if any(c is not v for c, v in zip(clean, boards, strict=True)):
            n = len(kept)
            kept = clean[:n]
            with_stripe = [
                (name, replace(p, view=v))
                for (name, p), v in zip(with_stripe, clean[n:], strict=True)
            ]
            continue
        for i in np.flatnonzero(bad):
            role = "camera" if i < len(kept) else f"laser {with_stripe[i - len(kept)][0]}"
            reason = (
                f"corners {rms[i]:.2f} px rms off, the other views {np.median(rms):.2f} px "
                "(blurred, or another camera)"
            )
            rejected.append(Rejected(role, boards[i].name, reason))
        n = len(kept)
        kept = [v for v, b in zip(kept, bad[:n], strict=True) if not b]
        with_stripe = [p for p, b in zip(with_stripe, bad[n:], strict=True) if not b]
        poses = tuple(T for T, b in zip(state.poses, bad, strict=True) if not b)
        state = replace(state, poses=poses)


def without_strays(view: BoardView, residual: Floats) -> BoardView:
    """The view without the few corners that are far off, (n, 2) px; itself where there are none.

    A stripe that runs over a corner, or a reflection on it, moves that corner alone.
    """
    off = np.linalg.norm(residual, axis=1)
    usual = max(float(np.median(off)), _STRAY_PX)
    good = off < _STRAY * usual
    if good.all() or np.mean(~good) > _FEW_STRAYS:
        return view
    return replace(view, corners=view.corners[good], ids=view.ids[good])


def _refuse_no_tilt(poses: Sequence[Pose]) -> None:
    """A board that always faces the camera the same way cannot tell distance from focal length."""
    normals = np.array([T.rotation[:, 2] for T in poses])
    apart = float(np.arccos(np.clip(normals @ normals.T, -1, 1)).max())
    if apart < _LEAST_TILT:
        raise Degenerate(
            f"camera: the board stands within {np.degrees(apart):.1f}° of the same direction in "
            f"all {len(poses)} pictures, so distance and focal length cannot be separated",
            hint="tilt the board up to 45° in all directions",
        )


def _refuse_unsure_focus(fit: Fit[State]) -> None:
    focus = fit.state.rig.camera.fx
    sigma = float(np.sqrt(fit.covariance[0, 0]))
    if sigma > _UNSURE_FOCUS * focus:
        raise Degenerate(
            f"camera: the focal length comes out as {focus:.0f} ± {sigma:.0f} px",
            hint="add pictures of the board, tilted up to 45° to all sides",
        )


def sheet_stage(
    state: State,
    first: int,
    with_stripe: list[tuple[str, LaserPicture]],
    settings: CalibrationSettings,
    rejected: list[Rejected],
    known: KnownRig | None = None,
) -> tuple[State, tuple[tuple[StripeView, ...], ...], tuple[LaserPicture, ...]]:
    """Which candidates are the stripe on each board, and a plane through them for every laser; and
    the pictures, each with the light that makes its stripe straighter."""
    camera = state.rig.camera
    direction = measuring_direction(settings.orientation)
    stripes: list[tuple[StripeView, ...]] = [()] * len(with_stripe)
    pictures = [p for _, p in with_stripe]
    sheets = []
    for name in dict.fromkeys(n for n, _ in with_stripe):
        pixels, clouds = [], []
        mine = [i for i, (n, _) in enumerate(with_stripe) if n == name]
        seen = []
        for i in mine:
            view, pose = with_stripe[i][1].view, state.poses[first + i]
            around = pictures[i].around(settings)
            pictures[i], px = straighter(camera, pictures[i], pose, around)
            if not len(px):
                reason = "no straight stripe on the board or its margin"
                rejected.append(Rejected(f"laser {name}", view.name, reason))
                continue
            seen.append(i)
            pixels.append(px)
            clouds.append(_on_plane_mm(camera, px, pose))
        sheet, agree = start_sheet(name, clouds)
        _refuse_mixed(name, [c for c, a in zip(clouds, agree, strict=True) if not a], len(clouds))
        sheets.append(sheet)
        for i, px, good in zip(seen, _gathered(pixels), agree, strict=True):
            if good:
                stripes[i] = (StripeView(name, px, direction),)
            else:
                reason = "the line found on it does not lie in the sheet of the others"
                rejected.append(Rejected(f"laser {name}", with_stripe[i][1].view.name, reason))
    merged = {s.name: s for s in state.rig.sheets}
    for sheet in sheets:
        before = merged.get(sheet.name)
        both = known is not None and known.counts and before is not None
        merged[sheet.name] = like(sheet, before) if both and before is not None else sheet
    rig = replace(state.rig, sheets=tuple(merged.values()))
    return replace(state, rig=rig), tuple(stripes), tuple(pictures)


def _refuse_mixed(name: str, others: list[Floats], count: int) -> None:
    """Stripes that lie in no sheet are chance; several that lie in one are another laser's."""
    if len(others) < max(_FEWEST_OTHERS, _OTHERS * count):
        return
    try:
        _, agree = start_sheet(name, others)
    except Degenerate:
        return
    if sum(agree) >= max(_FEWEST_OTHERS, _OTHERS * count):
        raise Degenerate(
            f"laser {name!r}: the stripes on {count - len(others)} boards lie in one sheet, those "
            f"on {sum(agree)} others in a second one: pictures of two lasers are mixed, or the "
            "laser moved",
            hint="give the pictures of each laser by themselves, under its own name",
        )


def _on_plane_mm(camera: Camera, pixels: Floats, pose: Pose) -> Floats:
    rays = camera.rays(pixels)
    normal = pose.rotation[:, 2]
    points: Floats = rays * ((pose.translation @ normal) / (rays @ normal))[:, None]
    return points


def _gathered(stripes: Sequence[Floats]) -> list[Floats]:
    """Means (k, 2) px of neighbours along stripes (n, 2) of one laser.

    As many are in each, in all of them, so that each mean is known as well; `_STRIPE_POINTS` are in
    the longest. So little of a stripe is straight to far less than it is known.
    """
    many = max((len(px) for px in stripes), default=0) / _STRIPE_POINTS
    out = []
    for px in stripes:
        count = min(max(round(len(px) / max(many, 1.0)), _FEWEST_MEANS), len(px))
        out.append(np.array([g.mean(axis=0) for g in np.array_split(px, count)]) if count else px)
    return out


def table_stage(
    state: State,
    network: RigNetwork,
    table: Sequence[TablePicture],
    settings: CalibrationSettings,
    rejected: list[Rejected],
) -> tuple[State, RigNetwork, list[TablePicture]]:
    """Axis, layout and angles; then the stripes on the platter and with them the scale."""
    camera = state.rig.camera
    # How the axis moves in a turn counts from an angle zero that is chosen anew here.
    state = replace(state, rig=replace(state.rig, wobble=None))
    layout: Layout
    used, riders = _riders(table, settings, rejected)
    if settings.table_board is not None:
        board = settings.table_board
        layout, T, angles, righted = start_board(camera, riders, board, _UP, settings.lowest)
        riders = list(righted)
    else:
        side = settings.marker_side or 1.0
        layout, T, angles = start_markers(camera, riders, side)
        _refuse_middle(layout)
        good = np.isfinite(angles)
        lost = [p for p, g in zip(used, good, strict=True) if not g]
        rejected += [Rejected("table", p.name, "no marker in common with the rest") for p in lost]
        used = [p for p, g in zip(used, good, strict=True) if g]
        riders = [r for r, g in zip(riders, good, strict=True) if g]
        angles = angles[good]
        own = RigNetwork((), (), tuple(riders), network.lasers, layout.names, (side, 0.01 * side))
        alone = State(replace(state.rig, T_camera_table=T), layout, (), angles)
        first = adjust(own, alone, own.free(alone, camera=False, sheet=False)).state
        assert first.layout is not None
        layout, T, angles = first.layout, first.rig.T_camera_table, first.angles
        riders = _with_stripes(riders, used, State(first.rig, layout, (), angles), settings)
        ratio = [
            float(np.median(state.rig.sheet(s.laser).intersect(camera.rays(s.pixels)) @ up))
            / float(T.translation @ up)
            for up in [T.rotation[:, 2]]
            for r in riders
            for s in r.stripes
        ]
        if ratio:
            scale = float(np.median(ratio))
            layout, T = layout.scaled(scale), Pose(T.rotation, T.translation * scale)
    trusted = None
    if settings.table_board is None and not any(r.stripes for r in riders):
        trusted = (settings.marker_side or 1.0, _SCALE_TRUST * (settings.marker_side or 1.0))
    network = replace(network, table=tuple(riders), layout_names=layout.names, trusted_side=trusted)
    rig = replace(state.rig, T_camera_table=T)
    return replace(state, rig=rig, layout=layout, angles=angles), network, used


def _refuse_middle(layout: MarkerLayout) -> None:
    """A marker that only turns on its place says little of where the axis leans."""
    reach = float(np.linalg.norm(layout.squares[:, :2], axis=1).max())
    if reach < _LEAST_REACH * float(layout.squares[:, 3].mean()):
        raise Degenerate(
            "table: all markers lie on the rotation axis, which leaves its direction undetermined",
            hint="put markers near the rim of the platter",
        )


def _riders(
    table: Sequence[TablePicture], settings: CalibrationSettings, rejected: list[Rejected]
) -> tuple[list[TablePicture], list[RiderView]]:
    used, riders = [], []
    for p in table:
        if isinstance(p.seen, BoardView):
            reason = p.seen.failure
            rider = RiderView(p.seen.ids, p.seen.corners, (), p.name)
        else:
            reason = "" if len(p.seen.numbers) else f"no marker of {settings.dictionary} found"
            rider = RiderView(p.seen.numbers, p.seen.corners.reshape(-1, 2), (), p.name)
        if reason:
            rejected.append(Rejected("table", p.name, reason))
        else:
            used.append(p)
            riders.append(rider)
    if len(used) < FEWEST_STEPS:
        raise NotEnoughViews(
            f"table: {len(used)} of {len(table)} pictures show the table's markers or board; at "
            f"least "
            f"{FEWEST_STEPS} are needed",
            hint="check the marker dictionary or the board, and that it is sharp and uncovered",
        )
    return used, riders


def _with_stripes(
    riders: Sequence[RiderView],
    pictures: Sequence[TablePicture],
    state: State,
    settings: CalibrationSettings,
) -> list[RiderView]:
    """The table views with the stripes on the platter."""
    layout, T, camera = state.layout, state.rig.T_camera_table, state.rig.camera
    assert isinstance(layout, MarkerLayout)
    seen: dict[str, list[Floats]] = {}
    for picture, angle in zip(pictures, state.angles, strict=True):
        for laser, candidates in picture.candidates.items():
            px = on_platter(camera, candidates, layout, T, float(angle))
            seen.setdefault(laser, []).append(px)
    means = {laser: iter(_gathered(some)) for laser, some in seen.items()}
    direction = measuring_direction(settings.orientation)
    out = []
    for rider, picture in zip(riders, pictures, strict=True):
        lit = ((laser, next(means[laser])) for laser in picture.candidates)
        stripes = (StripeView(laser, px, direction) for laser, px in lit if len(px))
        out.append(replace(rider, stripes=tuple(stripes)))
    return out
