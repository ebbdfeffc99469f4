"""The story of a calibration: camera, sheets, table, then everything together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from turnscan.arrays import Floats
from turnscan.calibrate._adjust import Fit, adjust
from turnscan.calibrate._board import Board, BoardView
from turnscan.calibrate._layout import Layout, MarkerLayout
from turnscan.calibrate._light import measuring_direction
from turnscan.calibrate._markers import MarkerView
from turnscan.calibrate._network import (
    BOARD,
    RIDER,
    RiderView,
    RigNetwork,
    State,
    StripeView,
)
from turnscan.calibrate._select import on_board, on_platter
from turnscan.calibrate._start import (
    FEWEST_VIEWS,
    board_pose,
    same_size,
    start_camera,
    start_sheet,
)
from turnscan.calibrate._start_table import FEWEST_STEPS, start_board, start_markers
from turnscan.calibrate._steps import AngleModel, angle_model
from turnscan.errors import Degenerate, NotEnoughViews
from turnscan.rig import Camera, Marker, Pose, Rig
from turnscan.stripes import Orientation

_REJECT = 3.0  # times the usual residual of a view
_STRIPE_POINTS = 40  # neighbours along a stripe share their errors; more would only be slower
_SIGNIFICANT = 3.0  # standard deviations for a parameter to be kept
_SCALE_TRUST = 0.02  # of the nominal marker side, where nothing measures it
_LEAST_TILT = np.radians(8.0)
_UNSURE_FOCUS = 0.05
_UP = np.array([0.0, -1.0, 0.0])

Say = Callable[[str], None]


@dataclass(frozen=True)
class LaserPicture:
    """A board with a stripe on it."""

    view: BoardView
    candidates: Floats
    """(n, 2) px, from `stripe_candidates`."""


@dataclass(frozen=True)
class TablePicture:
    """What rides on the table in one picture, and the stripes there."""

    seen: MarkerView | BoardView
    candidates: dict[str, Floats]
    """Per laser lit in this picture: (n, 2) px."""
    name: str
    step: float
    """How many steps the table had been sent."""


@dataclass(frozen=True)
class CalibrationSettings:
    """What the user knows about the rig."""

    dictionary: str = "DICT_4X4_50"
    """Of the markers on the platter."""
    marker_side: float = 0.0
    """mm, nominal; compared, and trusted only where nothing else gives the scale."""
    step: float | None = None
    """rad per step number, nominal; compared."""
    margin: float | None = None
    """mm of flat board around the printed pattern; None is 1.5 squares."""
    orientation: Orientation = "vertical"
    """Of the stripes in the picture."""
    table_board: Board | None = None
    """The board that rides on the table, instead of markers."""
    lowest: float = 0.0
    """mm: height of that board's lowest corner above the platter."""


@dataclass(frozen=True)
class Rejected:
    """A picture that was not used, and why."""

    role: str
    name: str
    reason: str


@dataclass(frozen=True)
class Calibration:
    """A calibrated rig with its evidence."""

    rig: Rig
    settings: CalibrationSettings
    fit: Fit[State]
    network: RigNetwork
    rejected: tuple[Rejected, ...]
    views: tuple[str, ...]
    """Names of the pictures of ``network``: boards, then table."""
    angles: AngleModel | None
    angle_names: tuple[str, ...] = field(default=())


def calibrate_rig(
    camera: Sequence[BoardView],
    lasers: dict[str, Sequence[LaserPicture]],
    table: Sequence[TablePicture],
    settings: CalibrationSettings,
    say: Say = lambda _: None,
) -> Calibration:
    """Calibrate a rig from what was found in the pictures.

    First values stage by stage (camera; each laser's sheet; table), then one adjustment of all
    observations in pixels with the camera, the bend of the board, the sheets, the axis, the shape
    of the platter, the markers' sizes and places and every angle free. Without a stripe on the
    platter the scale of a table with markers rests on their nominal side.

    Raises NotEnoughViews, Degenerate, DidNotConverge or InputError with what to do.
    """
    rejected: list[Rejected] = []
    roles: list[tuple[str, BoardView]] = [("camera", v) for v in camera]
    for name, pictures in lasers.items():
        roles += [(f"laser {name}", p.view) for p in pictures]
    rejected += [Rejected(role, v.name, v.failure) for role, v in roles if v.failure]
    kept = _distinct([v for v in camera if not v.failure], rejected)
    with_stripe = [(name, p) for name, ps in lasers.items() for p in ps if not p.view.failure]
    _refuse_no_boards(camera, kept)
    state, kept, with_stripe = _camera_stage(kept, with_stripe, rejected)
    say(f"camera: {len(kept) + len(with_stripe)} board views")
    state, stripes = _sheet_stage(state, len(kept), with_stripe, settings, rejected)
    boards = (*kept, *(p.view for _, p in with_stripe))
    nothing: tuple[StripeView, ...] = ()
    network = RigNetwork(boards, (nothing,) * len(kept) + stripes, (), tuple(lasers))
    if lasers:
        say(f"laser: {sum(len(s) for s in stripes)} stripes on boards")
    model = None
    used: list[TablePicture] = []
    if table:
        state, network, used = _table_stage(state, network, table, settings, rejected)
        say(f"table: {len(used)} pictures")
    fit = adjust(network, state, _free(network, state))
    fit, network, dropped = _without_bad_views(fit, network, used)
    rejected += dropped
    gone = {d.name for d in dropped}
    used = [p for p in used if p.name not in gone]
    fit = _keep_significant(fit, network)
    if table:
        model = _angles(fit, network, used, settings)
    rig = _finished_rig(fit, network, settings)
    names = (*(v.name for v in network.boards), *(v.name for v in network.table))
    return Calibration(
        rig, settings, fit, network, tuple(rejected), names, model, tuple(p.name for p in used)
    )


def _refuse_no_boards(asked: Sequence[BoardView], kept: Sequence[BoardView]) -> None:
    if len(kept) >= FEWEST_VIEWS:
        return
    why = next((v for v in asked if v.failure), None)
    example = f"; {why.name}: {why.failure}" if why else ""
    raise NotEnoughViews(
        f"camera: the board was found in {len(kept)} of {len(asked)} pictures, at least "
        f"{FEWEST_VIEWS} are needed{example}",
        hint="check the size of the board (--board counts inner corners of a chessboard, squares "
        "of a ChArUco board) and that it is sharp and evenly lit",
    )


def _distinct(views: list[BoardView], rejected: list[Rejected]) -> list[BoardView]:
    """Drop pictures that show exactly what another one shows: a copy is not a second look."""
    out: list[BoardView] = []
    for v in views:
        twin = next(
            (
                o
                for o in out
                if len(o.corners) == len(v.corners)
                and np.abs(o.corners - v.corners).max(initial=0) < 0.01
            ),
            None,
        )
        if twin is None:
            out.append(v)
        else:
            rejected.append(Rejected("camera", v.name, f"a copy of {twin.name}"))
    return out


def _camera_stage(
    kept: list[BoardView],
    with_stripe: list[tuple[str, LaserPicture]],
    rejected: list[Rejected],
) -> tuple[State, list[BoardView], list[tuple[str, LaserPicture]]]:
    """Camera, poses and the board's bend from all boards; views that do not fit are dropped."""
    same_size([*kept, *(p.view for _, p in with_stripe)])
    camera, poses = start_camera(kept)
    _refuse_no_tilt(poses)
    poses = (*poses, *(board_pose(camera, p.view) for _, p in with_stripe))
    state = State(Rig(camera, (), Pose()), None, poses, np.zeros(0))
    while True:
        boards = (*kept, *(p.view for _, p in with_stripe))
        network = RigNetwork(boards, tuple(() for _ in boards), (), ())
        fit = adjust(network, state, network.free(state, camera=("k1", "k2"), bend=True))
        state = fit.state
        rms = np.array([fit.rms(BOARD, i) for i in range(len(boards))])
        bad = rms > _REJECT * float(np.median(rms))
        if not bad.any() or np.count_nonzero(~bad) < FEWEST_VIEWS:
            _refuse_unsure_focus(fit)
            return state, kept, with_stripe
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


def _refuse_no_tilt(poses: Sequence[Pose]) -> None:
    """A board that always faces the camera the same way cannot tell distance from focal length."""
    normals = np.array([T.rotation[:, 2] for T in poses])
    apart = float(np.arccos(np.clip(normals @ normals.T, -1, 1)).max())
    if apart < _LEAST_TILT:
        raise Degenerate(
            f"camera: the board stands within {np.degrees(apart):.1f}° of the same direction in "
            f"all {len(poses)} pictures, so distance and focal length cannot be told apart",
            hint="tilt the board up to 45°, to all sides",
        )


def _refuse_unsure_focus(fit: Fit[State]) -> None:
    focus = fit.state.rig.camera.fx
    sigma = float(np.sqrt(fit.covariance[0, 0]))
    if sigma > _UNSURE_FOCUS * focus:
        raise Degenerate(
            f"camera: the focal length comes out as {focus:.0f} ± {sigma:.0f} px",
            hint="add pictures of the board, tilted up to 45° to all sides",
        )


def _sheet_stage(
    state: State,
    first: int,
    with_stripe: list[tuple[str, LaserPicture]],
    settings: CalibrationSettings,
    rejected: list[Rejected],
) -> tuple[State, tuple[tuple[StripeView, ...], ...]]:
    """Which candidates are the stripe on each board, and a plane through them for every laser."""
    camera = state.rig.camera
    direction = measuring_direction(settings.orientation)
    stripes: list[tuple[StripeView, ...]] = [()] * len(with_stripe)
    sheets = []
    for name in dict.fromkeys(n for n, _ in with_stripe):
        pixels, clouds = [], []
        mine = [i for i, (n, _) in enumerate(with_stripe) if n == name]
        seen = []
        for i in mine:
            view, pose = with_stripe[i][1].view, state.poses[first + i]
            margin = 1.5 * view.board.square if settings.margin is None else settings.margin
            px = on_board(camera, with_stripe[i][1].candidates, view.board, pose, margin)
            if not len(px):
                reason = "no straight stripe on the board or its margin"
                rejected.append(Rejected(f"laser {name}", view.name, reason))
                continue
            seen.append(i)
            pixels.append(px)
            clouds.append(_on_plane_mm(camera, px, pose))
        sheet, agree = start_sheet(name, clouds)
        sheets.append(sheet)
        for i, px, good in zip(seen, pixels, agree, strict=True):
            if good:
                stripes[i] = (StripeView(name, _thinned(px), direction),)
            else:
                reason = "the line found on it does not lie in the sheet of the others"
                rejected.append(Rejected(f"laser {name}", with_stripe[i][1].view.name, reason))
    return replace(state, rig=replace(state.rig, sheets=tuple(sheets))), tuple(stripes)


def _on_plane_mm(camera: Camera, pixels: Floats, pose: Pose) -> Floats:
    rays = camera.rays(pixels)
    normal = pose.rotation[:, 2]
    points: Floats = rays * ((pose.translation @ normal) / (rays @ normal))[:, None]
    return points


def _thinned(pixels: Floats) -> Floats:
    keep = np.linspace(0, len(pixels) - 1, min(len(pixels), _STRIPE_POINTS)).round().astype(int)
    thinned: Floats = pixels[keep]
    return thinned


def _table_stage(
    state: State,
    network: RigNetwork,
    table: Sequence[TablePicture],
    settings: CalibrationSettings,
    rejected: list[Rejected],
) -> tuple[State, RigNetwork, list[TablePicture]]:
    """Axis, layout and angles; then the stripes on the platter and with them the scale."""
    camera = state.rig.camera
    layout: Layout
    used, riders = _riders(table, settings, rejected)
    if settings.table_board is not None:
        board = settings.table_board
        layout, T, angles, righted = start_board(camera, riders, board, _UP, settings.lowest)
        riders = list(righted)
    else:
        side = settings.marker_side or 1.0
        layout, T, angles = start_markers(camera, riders, side)
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
        riders = [
            _with_stripes(r, p, State(first.rig, layout, (), angles), k, settings)
            for k, (r, p) in enumerate(zip(riders, used, strict=True))
        ]
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
            f"table: {len(used)} of {len(table)} pictures show what rides on the table; at least "
            f"{FEWEST_STEPS} are needed",
            hint="check the marker dictionary or the board, and that it is sharp and uncovered",
        )
    return used, riders


def _with_stripes(
    rider: RiderView, picture: TablePicture, state: State, k: int, settings: CalibrationSettings
) -> RiderView:
    assert isinstance(state.layout, MarkerLayout)
    stripes = []
    for laser, candidates in picture.candidates.items():
        px = on_platter(
            state.rig.camera,
            candidates,
            state.layout,
            state.rig.T_camera_table,
            float(state.angles[k]),
        )
        if len(px):
            direction = measuring_direction(settings.orientation)
            stripes.append(StripeView(laser, _thinned(px), direction))
    return replace(rider, stripes=tuple(stripes))


def _free(network: RigNetwork, state: State, camera: Sequence[str] = ()) -> np.ndarray:
    lens = ("k1", "k2", "p1", "p2", *camera)
    return network.free(state, camera=lens, bend=True)


def _without_bad_views(
    fit: Fit[State], network: RigNetwork, used: list[TablePicture]
) -> tuple[Fit[State], RigNetwork, list[Rejected]]:
    """Drop table pictures whose corners are far off, and adjust again."""
    n = len(network.boards)
    rms = np.array([fit.rms(RIDER, n + k) for k in range(len(network.table))])
    if not len(rms):
        return fit, network, []
    usual = float(np.median(rms))
    bad = rms > _REJECT * usual
    bad[0] = False  # the first picture is where zero is
    if not bad.any() or np.count_nonzero(~bad) < FEWEST_STEPS:
        return fit, network, []
    dropped = [
        Rejected("table", used[k].name, f"corners {rms[k]:.2f} px rms off, the rest {usual:.2f} px")
        for k in np.flatnonzero(bad)
    ]
    table = tuple(v for v, b in zip(network.table, bad, strict=True) if not b)
    network = replace(network, table=table)
    state = replace(fit.state, angles=fit.state.angles[~bad])
    return adjust(network, state, _free(network, state), near=fit), network, dropped


def _keep_significant(fit: Fit[State], network: RigNetwork) -> Fit[State]:
    """Add k3 and the sheets' bow where they are significant; drop p1 and p2 where they are not."""
    names = network.names
    free = _free(network, fit.state)

    def matters(result: Fit[State], name: str, value: float) -> bool:
        k = names.index(name)
        return abs(value) > _SIGNIFICANT * float(np.sqrt(result.covariance[k, k]))

    p1, p2 = fit.state.rig.camera.distortion[2:4]
    if not (matters(fit, "camera.p1", p1) or matters(fit, "camera.p2", p2)):
        free[[names.index("camera.p1"), names.index("camera.p2")]] = False
        camera = fit.state.rig.camera
        d = camera.distortion * np.array([1, 1, 0, 0, 1])
        start = replace(fit.state, rig=replace(fit.state.rig, camera=replace(camera, distortion=d)))
        fit = adjust(network, start, free, near=fit)
    tried = free.copy()
    tried[names.index("camera.k3")] = True
    more = adjust(network, fit.state, tried, near=fit)
    if matters(more, "camera.k3", float(more.state.rig.camera.distortion[4])):
        fit, free = more, tried
    for sheet in fit.state.rig.sheets:
        tried = free.copy()
        tried[names.index(f"{sheet.name}.bow_aa")] = True
        more = adjust(network, fit.state, tried, near=fit)
        bow = float(more.state.rig.sheet(sheet.name).bow[0])
        if matters(more, f"{sheet.name}.bow_aa", bow):
            fit, free = more, tried
    return fit


def _angles(
    fit: Fit[State], network: RigNetwork, used: list[TablePicture], settings: CalibrationSettings
) -> AngleModel:
    own = fit.own_noise[len(network.boards) :]
    # The first picture is where zero is, by definition; it was read no better than its neighbour.
    sigmas = np.array([np.sqrt(c[0, 0]) if len(c) else np.nan for c in own])
    sigmas[0] = np.nanmedian(sigmas)
    return angle_model(fit.state.angles, sigmas, [p.step for p in used], settings.step)


def _finished_rig(fit: Fit[State], network: RigNetwork, settings: CalibrationSettings) -> Rig:
    rig, layout = fit.state.rig, fit.state.layout
    p = len(rig.parameter_names)
    covariance: Floats = fit.covariance[:p, :p]
    markers: tuple[Marker, ...] = ()
    if isinstance(layout, MarkerLayout):
        markers = layout.markers(settings.dictionary)
    elif layout is not None:
        # The fit holds the height of the board's first corner; a person has measured the lowest.
        corners, by = layout.points(np.arange(len(layout.board.points), dtype=np.int32))
        low = int(corners[:, 2].argmin())
        T, up = rig.T_camera_table, rig.T_camera_table.rotation[:, 2]
        shift = up * (float(corners[low, 2]) - settings.lowest)
        rig = replace(rig, T_camera_table=Pose(T.rotation, T.translation + shift))
        n = by.shape[2]
        carried = np.eye(p, p + n)
        carried[p - 3 : p, p:] = np.outer(up, by[low, 2])
        covariance = carried @ fit.covariance[: p + n, : p + n] @ carried.T
    return replace(rig, markers=markers, covariance=covariance)
