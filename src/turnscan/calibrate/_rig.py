"""The story of a calibration: camera, sheets, table, then everything together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from turnscan.arrays import Bools, Floats
from turnscan.calibrate._adjust import Fit, adjust, one_step
from turnscan.calibrate._board import BoardView
from turnscan.calibrate._evidence import CalibrationSettings, LaserPicture, Rejected, TablePicture
from turnscan.calibrate._filter_sites import site_pattern
from turnscan.calibrate._layout import MarkerLayout
from turnscan.calibrate._observations import RIDER, RigNetwork
from turnscan.calibrate._procedure import (
    REJECT,
    KnownRig,
    Stages,
    camera_stage,
    distinct,
    known_camera_stage,
    refuse_no_boards,
    same_picture,
    sheet_stage,
    table_stage,
    with_rest,
)
from turnscan.calibrate._start_table import FEWEST_STEPS
from turnscan.calibrate._state import State, StripeView
from turnscan.calibrate._steps import AngleModel, angle_model
from turnscan.calibrate._thickness import sheet_thickness
from turnscan.calibrate._wobble import HOPELESS, with_wobble
from turnscan.rig import Marker, Pose, Rig, Wobble

Say = Callable[[str], None]


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
    angle_names: tuple[str, ...] = ()
    stages: Stages = field(default_factory=lambda: Stages(()))
    """Which stages had pictures, and what was known of the others."""


def calibrate_rig(
    camera: Sequence[BoardView],
    lasers: dict[str, Sequence[LaserPicture]],
    table: Sequence[TablePicture] | Callable[[], Sequence[TablePicture]],
    settings: CalibrationSettings,
    say: Say = lambda _: None,
    known: KnownRig | None = None,
) -> Calibration:
    """Calibrate a rig, or stages of one, from what was found in the pictures.

    What a colour filter draws of corners is taken off all boards first, where those of camera and
    lasers show it (`site_pattern`). First values stage by stage (camera; each laser's sheet;
    table), then one adjustment of all observations in pixels with the camera, the bend of the
    board, the sheets, the axis, the shape of the platter, the markers' sizes and places and every
    angle free. Without a stripe on the platter the scale of a table with markers rests on their
    nominal side.

    ``table`` may also be what reads the pictures of the table: it is asked once camera and sheets
    are known, so that pictures that show none are refused before hundreds are read.

    Stages without pictures are those of ``known``, held by the uncertainty that they have there
    (exactly where it has none); what nobody knows stays open (`Rig.lacking`).

    Raises NotEnoughViews, Degenerate, DidNotConverge or InputError with what to do.
    """
    rejected: list[Rejected] = []
    drawn = site_pattern([*camera, *(p.view for some in lasers.values() for p in some)])
    if drawn is not None:
        camera = [drawn.without(v) for v in camera]
        lasers = {name: drawn.without_in(some) for name, some in lasers.items()}
    roles: list[tuple[str, BoardView]] = [("camera", v) for v in camera]
    for name, pictures in lasers.items():
        roles += [(f"laser {name}", p.view) for p in pictures]
    rejected += [Rejected(role, v.name, v.failure) for role, v in roles if v.failure]
    kept = distinct([v for v in camera if not v.failure], rejected)
    with_stripe = [(name, p) for name, ps in lasers.items() for p in ps if not p.view.failure]
    if camera or known is None:
        refuse_no_boards(camera, kept)
        state, kept, with_stripe = camera_stage(kept, with_stripe, rejected)
        state = with_rest(state, known)
    else:
        state, with_stripe = known_camera_stage(known.rig, with_stripe, rejected)
    shown = (*kept, *(p.view for _, p in with_stripe))
    if shown:
        say(f"camera: {len(_merged(shown, ())[1])} board views")
    stripes: tuple[tuple[StripeView, ...], ...] = ()
    lit: tuple[LaserPicture, ...] = ()
    if lasers:
        state, stripes, lit = sheet_stage(state, len(kept), with_stripe, settings, rejected, known)
        say(f"laser: {sum(len(s) for s in stripes)} stripes on boards")
    nothing: tuple[StripeView, ...] = ()
    names = tuple(s.name for s in state.rig.sheets)
    where, boards, on_them = _merged(shown, (nothing,) * len(kept) + stripes)
    state = replace(state, poses=tuple(state.poses[where.index(k)] for k in range(len(boards))))
    network = RigNetwork(boards, on_them, (), names)
    used: list[TablePicture] = []
    turned = table() if callable(table) else table
    if turned:
        turned = turned if drawn is None else drawn.without_on_table(turned)
        state, network, used = table_stage(state, network, turned, settings, rejected)
        say(f"table: {len(used)} pictures")
    given = (*(("camera",) if camera else ()), *lasers, *(("table",) if turned else ()))
    done = _adjusted(state, network, used, settings, rejected, Stages(given, known))
    seen = [
        (picture, stripe, done.fit.state.poses[k])
        for picture, some, k in zip(lit, stripes, where[len(kept) :], strict=False)
        for stripe in some
    ]
    rig = replace(_with_thickness(done.rig, seen), evidence=_evidence(done.stages))
    return replace(done, rig=rig)


def _merged(
    views: Sequence[BoardView], stripes: Sequence[tuple[StripeView, ...]]
) -> tuple[list[int], tuple[BoardView, ...], tuple[tuple[StripeView, ...], ...]]:
    """The views that are not one picture given twice, with the stripes on them, and which of these
    each is.

    Two lasers lit on one board share its picture without light, and what is given for the camera
    may be given for a laser, too: its corners are seen once.
    """
    where, one, on_it = list[int](), list[BoardView](), list[tuple[StripeView, ...]]()
    for k, view in enumerate(views):
        some = stripes[k] if k < len(stripes) else ()
        twin = next((j for j, other in enumerate(one) if same_picture(view, other)), len(one))
        if twin == len(one):
            one.append(view)
            on_it.append(())
        where.append(twin)
        on_it[twin] += some
    return where, tuple(one), tuple(on_it)


def _evidence(stages: Stages) -> tuple[str, ...]:
    """The scans that refined what is held. Sheets and axis that start again owe them nothing, and
    such a scan may then count again."""
    known = stages.known
    if known is None or not (known.counts or set(stages.held) - {"camera"}):
        return ()
    return known.rig.evidence


def _with_thickness(rig: Rig, boards: Sequence[tuple[LaserPicture, StripeView, Pose]]) -> Rig:
    """The rig with the thickness of the sheets that boards tell."""
    sheets = []
    for sheet in rig.sheets:
        found = sheet_thickness(rig, sheet.name, boards)
        sheets.append(sheet if found is None else replace(sheet, thickness=found))
    return replace(rig, sheets=tuple(sheets))


def _adjusted(
    state: State,
    network: RigNetwork,
    used: list[TablePicture],
    settings: CalibrationSettings,
    rejected: list[Rejected],
    stages: Stages,
) -> Calibration:
    """Everything together, without the pictures that do not fit."""
    moves = state.rig.wobble is not None
    network = replace(network, prior=stages.prior(state.rig), wobble=moves)
    fit = adjust(network, state, stages.free(network, state))
    fit, network, dropped = _without_bad_views(fit, network, used, stages)
    rejected += dropped
    gone = {d.name for d in dropped}
    used = [p for p in used if p.name not in gone]
    fit, free = _keep_significant(fit, network, stages)
    fit, network = with_wobble(fit, network, stages, free)
    model = _angles(fit, network, used, settings) if used else None
    rig = _finished_rig(fit, network, settings)
    names = (*(v.name for v in network.boards), *(v.name for v in network.table))
    angle_names = tuple(p.name for p in used)
    return Calibration(
        rig, settings, fit, network, tuple(rejected), names, model, angle_names, stages
    )


def _without_bad_views(
    fit: Fit[State], network: RigNetwork, used: list[TablePicture], stages: Stages
) -> tuple[Fit[State], RigNetwork, list[Rejected]]:
    """Drop table pictures whose corners are far off, and adjust again."""
    n = len(network.boards)
    rms = np.array([fit.rms(RIDER, n + k) for k in range(len(network.table))])
    if not len(rms):
        return fit, network, []
    usual = float(np.median(rms))
    bad = rms > REJECT * usual
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
    return adjust(network, state, stages.free(network, state), near=fit), network, dropped


def _keep_significant(
    fit: Fit[State], network: RigNetwork, stages: Stages
) -> tuple[Fit[State], Bools]:
    """Add k3 and the sheets' bow where they earn it; drop p1 and p2 where they do not. With it,
    what is free.

    Wald's statistic of k parameters is what they lower χ² by; Bayes' information criterion asks for
    k·ln n of n observations.
    """
    free = stages.free(network, fit.state)

    def matters(result: Fit[State], names: Sequence[str], values: Floats) -> bool:
        k = [network.names.index(name) for name in names]
        gain = float(values @ np.linalg.solve(result.covariance[np.ix_(k, k)], values))
        return bool(gain > len(k) * np.log(_observations(result)))

    tangential = ["camera.p1", "camera.p2"]
    camera_given = "camera" in stages.given
    if camera_given and not matters(fit, tangential, fit.state.rig.camera.distortion[2:4]):
        free[[network.names.index(name) for name in tangential]] = False
        camera = fit.state.rig.camera
        d = camera.distortion * np.array([1, 1, 0, 0, 1])
        start = replace(fit.state, rig=replace(fit.state.rig, camera=replace(camera, distortion=d)))
        fit = adjust(network, start, free, near=fit)
    asked: dict[str, Callable[[State], float]] = {"camera.k3": _k3} if camera_given else {}
    for sheet in fit.state.rig.sheets:
        if sheet.name in stages.given:
            asked[f"{sheet.name}.bow_aa"] = partial(_bow, sheet.name)
    for name, value in asked.items():
        more = _tried(network, fit, free, name, value(fit.state))
        if more and matters(more[0], [name], np.array([value(more[0].state)])):
            fit, free = more
    return fit, free


def _observations(fit: Fit[State]) -> int:
    return sum(len(b.residual) for b in fit.blocks)


def _bow(laser: str, state: State) -> float:
    return float(state.rig.sheet(laser).bow[0])


def _k3(state: State) -> float:
    return float(state.rig.camera.distortion[4])


def _tried(
    network: RigNetwork, fit: Fit[State], free: Bools, name: str, value: float
) -> tuple[Fit[State], Bools] | None:
    """The fit with one more parameter, and what is free in it; None where already a linear step
    shows that it does not matter."""
    k = network.names.index(name)
    tried = free.copy()
    tried[k] = True
    moved, sigma = one_step(network, fit, tried)
    if abs(value + moved[k]) < HOPELESS * np.sqrt(np.log(_observations(fit))) * sigma[k]:
        return None
    return adjust(network, fit.state, tried, near=fit), tried


def _angles(
    fit: Fit[State], network: RigNetwork, used: list[TablePicture], settings: CalibrationSettings
) -> AngleModel:
    own = fit.own_noise[len(network.boards) :]
    # The first picture is where zero is, by definition; it was read no better than its neighbour.
    sigmas = np.array([np.sqrt(c[0, 0]) if len(c) else np.nan for c in own])
    sigmas[0] = np.nanmedian(sigmas)
    return angle_model(
        fit.state.angles, sigmas, [p.step for p in used], settings.step, [p.name for p in used]
    )


def _finished_rig(fit: Fit[State], network: RigNetwork, settings: CalibrationSettings) -> Rig:
    rig, layout = fit.state.rig, fit.state.layout
    p = len(rig.parameter_names)
    covariance: Floats = fit.covariance[:p, :p]
    markers: tuple[Marker, ...] = rig.markers if layout is None else ()
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
        if rig.wobble is not None:
            height = float(corners[low, 2]) - settings.lowest
            rig = replace(rig, wobble=rig.wobble.lifted(height))
            tilt = p - 6 - len(Wobble.NAMES)
            carried[[tilt + 2, tilt + 3], [tilt + 1, tilt]] = height, -height
        covariance = carried @ fit.covariance[: p + n, : p + n] @ carried.T
    known = rig.table_known or layout is not None
    return replace(rig, markers=markers, covariance=covariance, table_known=known)
