"""LiveCalibration: pictures of boards, looked at as they are taken, become a rig."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Image
from turnscan.calibrate import (
    Advice,
    Board,
    BoardView,
    Calibration,
    CalibrationSettings,
    Charuco,
    LaserPicture,
    TablePicture,
    advice_of,
    aruco_dictionary,
    calibrate_rig,
    coverage,
    detect_board,
    detect_markers,
    figures,
    findings_of,
    laser_weights,
    parse_board,
    refuse_poor,
    stripe_light,
    white_margin,
)
from turnscan.errors import CalibrationError, InputError
from turnscan.findings import Finding
from turnscan.rig import Rig, rig_to_json
from turnscan.scanner import Shot
from turnscan.stripes import Orientation
from turnscan.workflows._calibration._calibrate_report import report_html

CELL_COLUMNS, CELL_ROWS = 8, 6
"""Cells of the picture in which corners are counted."""
_WANTED = {"camera": 8, "laser": 5, "table": 8}
"""Pictures of each kind, and with each laser, that are worth a calibration."""
_FEWEST_LINES = 20
"""Lines of the picture in which the board shows the stripe."""
_RULER = 100.0
"""mm: the rulers that are printed beside a target."""
_PRINT_ERROR, _PRINT_SKEW = 0.05, 0.005
"""Largest relative error of a print that is corrected, and largest difference of its two sides."""
CalibrationStage = Literal["camera", "laser", "table"]
Verdict = Literal["good", "usable", "refused"]
"""No warnings; warnings, but worth a scan; not worth one."""


@dataclass(frozen=True)
class SeenView:
    """A picture of a calibration, looked at."""

    number: int
    stage: CalibrationStage
    laser: str
    """Lit in it; empty for none."""
    name: str
    failure: str
    """Why it cannot be used; empty where it can."""
    corners: int
    rms_px: float | None = None
    """How far its corners are off in the last adjustment; None before one."""


@dataclass(frozen=True)
class CalibrationState:
    """How far a calibration is."""

    board: str
    views: tuple[SeenView, ...]
    coverage: float
    """Share of the cells of the picture in which a corner of the board was seen."""
    cells: tuple[int, ...]
    """Corners in each of `CELL_ROWS` × `CELL_COLUMNS` cells, row by row."""
    missing: tuple[str, ...]
    """What is still wanted, in words."""
    advice: Advice | None
    """What is undetermined, and which pictures would help most; None before an adjustment."""
    size: tuple[int, int]
    """Width and height of the pictures, px."""
    marked: Floats
    """(n, 3): every corner of the board that was seen, u and v px, and the number of its view."""
    space: SpaceCovered | None
    """Where the boards were; None before an adjustment."""


@dataclass(frozen=True)
class SpaceCovered:
    """Where boards were held, as the last adjustment has it, in the frame of the camera."""

    corners: Floats
    """(n, 4): every corner of the board in the hand, x, y, z mm, and the number of its view."""
    reach: tuple[float, float]
    """Half of the picture's width and height at a distance of one."""
    axis: tuple[Floats, Floats] | None
    """(3,) mm and (3,): the table's middle and its axis of rotation; None before it is known."""


@dataclass(frozen=True)
class LiveRig:
    """The rig of a calibration, and what there is to know about it."""

    rig: Rig
    json: str
    """The same as the text of a rig file."""
    text: str
    """How well it fits, in words."""
    findings: tuple[Finding, ...]
    """Those of the calibration, then every picture that was not used, and why."""
    verdict: Verdict
    refusal: CalibrationError | None
    """Why it is not worth a scan."""
    report: str
    """HTML."""


class LiveCalibration:
    """One calibration. All methods may be called from any thread."""

    def __init__(
        self,
        board: str,
        table: str,
        lowest: float = 0.0,
        orientation: Orientation = "vertical",
        rulers: tuple[float, float] = (_RULER, _RULER),
    ) -> None:
        """With these boards: ``board`` in the hand, ``table`` a board or markers on the table.

        ``lowest``: mm, height of the lowest corner of the board on the table. ``rulers``: what the
        two printed rulers of 100 mm measure; the board is as much larger than its text says, and so
        is the one on the table, where it is the same. Raises FormatError for a board that is none,
        InputError for a print that cannot be used.
        """
        self._board = printed_board(parse_board(board), rulers)
        kind, _, rest = table.partition(":")
        if kind == "markers":
            name, _, side = rest.partition(":")
            aruco_dictionary(name)
            settings = CalibrationSettings(name, _length(side), orientation=orientation)
        else:
            same = table == board
            settings = CalibrationSettings(
                table_board=self._board if same else parse_board(table),
                lowest=lowest,
                orientation=orientation,
            )
        self._settings, self._text = settings, board
        self._lock = threading.RLock()
        self._camera: dict[int, BoardView] = {}
        self._lasers: dict[int, tuple[str, LaserPicture]] = {}
        self._table: dict[int, TablePicture] = {}
        self._next = 1
        self._advice: Advice | None = None
        self._space: SpaceCovered | None = None
        self._rms: dict[str, float] = {}
        """px, by the names of the views in the last adjustment."""

    @property
    def orientation(self) -> Orientation:
        """Of the stripe in the pictures."""
        return self._settings.orientation

    def seen(self, picture: Image) -> tuple[Floats, str]:
        """(n, 2) px: corners of the board in a picture that is not kept; and why there are none."""
        view = detect_board(picture, self._board)
        return view.corners, view.failure

    def keep(self, stage: CalibrationStage, shot: Shot) -> SeenView:
        """Look at a picture, and keep what was found in it."""
        with self._lock:
            number = self._next
            self._next += 1
        name = f"{stage} {number}"
        if stage == "table":
            turned = self._table_picture(shot, name)
            with self._lock:
                self._table[number] = turned
            return self._of_table(number, turned)
        view = detect_board(shot.dark, self._board, name)
        if stage == "camera":
            with self._lock:
                self._camera[number] = view
            return self._of_camera(number, view)
        margin = None if view.failure else white_margin(shot.dark, view)
        lit = _lit_board(shot, view, margin, self._settings.orientation)
        with self._lock:
            self._lasers[number] = shot.laser, lit
        return self._of_laser(number, shot.laser, lit)

    def corners_of(self, number: int) -> tuple[Floats, str]:
        """(n, 2) px: corners of the board in a picture that was kept; and why there are none."""
        with self._lock:
            view = self._camera.get(number)
            if number in self._lasers:
                view = self._lasers[number][1].view
            turned = self._table.get(number)
        if view is not None:
            return view.corners, view.failure
        if turned is None:
            raise InputError("no such picture")
        corners: Floats = np.asarray(turned.seen.corners, float).reshape(-1, 2)
        return corners, _why_not(turned)

    def forget_table(self) -> None:
        """Take all pictures of the table away: a new turn replaces them."""
        with self._lock:
            self._table.clear()

    def forget(self, number: int) -> None:
        """Take a picture away. Raises InputError for one there is not."""
        with self._lock:
            groups: tuple[dict[int, object], ...] = (self._camera, self._lasers, self._table)  # type: ignore[assignment]
            for group in groups:
                if group.pop(number, None) is not None:
                    return
        raise InputError("no such picture")

    def state(self) -> CalibrationState:
        """How far it is."""
        with self._lock:
            boards = {k: v for k, v in self._camera.items() if not v.failure}
            boards |= {k: p.view for k, (_, p) in self._lasers.items() if not p.view.failure}
            views = [self._of_camera(k, v) for k, v in self._camera.items()]
            views += [self._of_laser(k, name, pic) for k, (name, pic) in self._lasers.items()]
            views += [self._of_table(k, t) for k, t in self._table.items()]
            advice, space = self._advice, self._space
        size = next(iter(boards.values())).size if boards else (1, 1)
        corners = [v.corners for v in boards.values()]
        marked = [np.insert(v.corners, 2, k, axis=1) for k, v in boards.items()]
        return CalibrationState(
            board=self._text,
            views=tuple(views),
            coverage=coverage(corners, *size) if boards else 0.0,
            cells=_cells(corners, size),
            missing=tuple(_missing(views)),
            advice=advice,
            size=size,
            marked=np.concatenate([np.zeros((0, 3)), *marked]),
            space=space,
        )

    def consider(self, check: Callable[[], None]) -> None:
        """Adjust what there is, for advice on what to take next; ``check`` is called now and then.

        Pictures that do not tell anything yet leave the advice to say so.
        """
        try:
            done = self._adjusted(check)
        except CalibrationError as e:
            with self._lock:
                self._advice = Advice((), "camera", f"{e.message}: {e.hint}")
            return
        self._learn(done)

    def _learn(self, done: Calibration) -> None:
        with self._lock:
            self._advice = advice_of(done.rig, done)
            self._space = self._space_of(done)
            self._rms = {
                name: float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
                for k, name in enumerate(done.views)
                if (parts := [b.residual for b in done.fit.blocks if b.view == k])
            }

    def _space_of(self, done: Calibration) -> SpaceCovered:
        numbers = {v.name: k for k, v in self._camera.items()}
        numbers |= {p.view.name: k for k, (_, p) in self._lasers.items()}
        placed = [
            np.insert(pose.apply(view.points), 3, numbers[view.name], axis=1)
            for view, pose in zip(done.network.boards, done.fit.state.poses, strict=True)
            if view.name in numbers
        ]
        camera, T = done.rig.camera, done.rig.T_camera_table
        width, height = done.network.boards[0].size if done.network.boards else (0, 0)
        reach = (width / 2 / camera.fx, height / 2 / camera.fy)
        axis = (T.translation, T.rotation[:, 2]) if done.rig.table_known else None
        return SpaceCovered(np.concatenate([np.zeros((0, 4)), *placed]), reach, axis)

    def _adjusted(self, check: Callable[[], None]) -> Calibration:
        with self._lock:
            camera, table = list(self._camera.values()), list(self._table.values())
            names = dict.fromkeys(name for name, _ in self._lasers.values())
            lasers: dict[str, Sequence[LaserPicture]] = {
                n: [picture for name, picture in self._lasers.values() if name == n] for n in names
            }
        return calibrate_rig(camera, lasers, table, self._settings, lambda text: check())

    def finish(self, check: Callable[[], None]) -> LiveRig:
        """The calibration of the pictures there are now; ``check`` is called now and then.

        Raises CalibrationError where the pictures do not tell a rig, and what ``check`` raises.
        """
        done = self._adjusted(check)
        self._learn(done)
        found = figures(done)
        refusal: CalibrationError | None = None
        try:
            refuse_poor(done, found)
        except CalibrationError as e:
            refusal = e
        unused = [
            Finding("calibrate.not-used", "note", r.reason, f"{r.role}: {r.name}")
            for r in done.rejected
        ]
        text = f"camera {found.camera_rms_px:.3f} px rms, coverage {100 * found.coverage:.0f} %"
        for place, u in list(found.radius_k2_mm.items())[:1]:
            text += f"; at {place} mm a radius ± {u:.2f} mm (k = 2)"
        said = findings_of(done, found)
        verdict: Verdict = "usable" if any(f.severity != "note" for f in said) else "good"
        if refusal is not None or done.rig.lacking:
            verdict = "refused"
        page = report_html(done, found, advice_of(done.rig, done), said, {})
        return LiveRig(
            done.rig, rig_to_json(done.rig), text, (*said, *unused), verdict, refusal, page
        )

    def _of_camera(self, number: int, view: BoardView) -> SeenView:
        rms = self._rms.get(view.name)
        return SeenView(number, "camera", "", view.name, view.failure, len(view.corners), rms)

    def _of_laser(self, number: int, laser: str, picture: LaserPicture) -> SeenView:
        view, why = picture.view, picture.view.failure
        if not why and not len(picture.candidates):
            why = f"no stripe of laser {laser} on the board"
        rms = self._rms.get(view.name)
        return SeenView(number, "laser", laser, view.name, why, len(view.corners), rms)

    def _of_table(self, number: int, picture: TablePicture) -> SeenView:
        rms, n = self._rms.get(picture.name), len(picture.seen.corners)
        return SeenView(number, "table", "", picture.name, _why_not(picture), n, rms)

    def _table_picture(self, shot: Shot, name: str) -> TablePicture:
        light: dict[str, Floats] = {}
        if shot.lit is not None:
            channel = _channel(shot.lit, shot.dark)
            way = self._settings.orientation
            light[shot.laser] = stripe_light(shot.lit, shot.dark, channel, way).places
        board, step = self._settings.table_board, float(shot.stop)
        if board is not None:
            return TablePicture(detect_board(shot.dark, board, name), light, name, step)
        markers = detect_markers(shot.dark, self._settings.dictionary)
        return TablePicture(markers, light, name, step)


def printed_board(board: Board, rulers: tuple[float, float]) -> Board:
    """A board as it came out of the printer, by what its rulers of 100 mm measure there.

    Raises InputError for a print that is far from its size, or not as large one way as the other.
    """
    across, down = (length / _RULER for length in rulers)
    scale = (across + down) / 2
    if abs(across - down) > _PRINT_SKEW * scale:
        raise InputError(
            f"the print is {rulers[0]:g} mm one way and {rulers[1]:g} mm the other, for 100 mm",
            hint="print it again at 100 %, without fitting it to the page",
        )
    if abs(scale - 1) > _PRINT_ERROR:
        raise InputError(
            f"the printed rulers of 100 mm measure {rulers[0]:g} and {rulers[1]:g} mm",
            hint="print it again at 100 %, without fitting it to the page",
        )
    if isinstance(board, Charuco):
        return replace(board, square=board.square * scale, marker=board.marker * scale)
    return replace(board, square=board.square * scale)


def _lit_board(
    shot: Shot, view: BoardView, margin: Floats | None, orientation: Orientation
) -> LaserPicture:
    """A board with the stripe's candidates; none where the stripe misses the board."""
    nothing = LaserPicture(view, np.zeros((0, 2)), margin, np.zeros(0))
    if view.failure or shot.lit is None:
        return nothing
    weights = None
    if shot.lit.ndim == 3:
        excess = laser_weights(shot.lit, shot.dark, view.corners)
        weights = None if excess is None else np.eye(3)[int(excess.argmax())]
    light = stripe_light(shot.lit, shot.dark, weights, orientation)
    mask = np.zeros(shot.lit.shape[:2], np.uint8)
    cv2.fillConvexPoly(mask, cv2.convexHull(view.corners.round().astype(np.int32)), 1)
    u, v = light.places.round().astype(int).T
    met = np.count_nonzero(mask[v, u]) >= _FEWEST_LINES
    return LaserPicture.of(view, light, margin) if met else nothing


def _why_not(picture: TablePicture) -> str:
    seen = picture.seen
    if isinstance(seen, BoardView):
        return seen.failure
    return "" if len(seen.corners) else "none of the markers is readable"


def _missing(views: Sequence[SeenView]) -> list[str]:
    """What is still wanted, in words."""
    out = []
    words = {
        "camera": "pictures of the board in other poses, tilted and in every corner",
        "laser": "pictures of the board with each stripe on it, near and far",
        "table": "pictures of the table with its markers or board: turn it",
    }
    for stage, wanted in _WANTED.items():
        ours = [v for v in views if v.stage == stage]
        lasers = {v.laser for v in ours} or {""}
        have = min(sum(v.laser == name and not v.failure for v in ours) for name in lasers)
        if have < wanted:
            out.append(f"{wanted - have} more {words[stage]}")
    return out


def _cells(corners: Sequence[Floats], size: tuple[int, int]) -> tuple[int, ...]:
    """Corners in each cell of the picture, row by row."""
    every = np.concatenate([np.zeros((0, 2)), *corners])
    grid, _, _ = np.histogram2d(
        every[:, 1], every[:, 0], bins=(CELL_ROWS, CELL_COLUMNS), range=((0, size[1]), (0, size[0]))
    )
    counts: npt.NDArray[np.int64] = grid.astype(np.int64)
    return tuple(int(n) for n in counts.ravel())


def _channel(lit: Image, dark: Image) -> Floats | None:
    """The colour channel that the laser adds most to; None for grey pictures."""
    if lit.ndim == 2:
        return None
    added = (lit.astype(np.float32) - dark).clip(0).mean(axis=(0, 1))
    weights: Floats = np.eye(3)[int(added.argmax())]
    return weights


def _length(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < 1e5:
        raise InputError(
            f"markers: {text!r} is not a side length in mm", hint="write markers:DICT_4X4_50:30"
        )
    return value
