"""LiveCalibration: pictures of boards, looked at as they are taken, become a rig."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt

from turnscan.arrays import Floats, Image
from turnscan.calibrate import (
    BoardView,
    CalibrationSettings,
    LaserPicture,
    TablePicture,
    aruco_dictionary,
    calibrate_rig,
    coverage,
    detect_board,
    detect_markers,
    figures,
    findings_of,
    laser_weights,
    parse_board,
    stripe_light,
    white_margin,
)
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.rig import Rig, rig_to_json
from turnscan.scanner import Shot
from turnscan.stripes import Orientation

CELL_COLUMNS, CELL_ROWS = 8, 6
"""Cells of the picture in which corners are counted."""
_WANTED = {"camera": 8, "laser": 5, "table": 8}
"""Pictures of each kind, and with each laser, that are worth a calibration."""
_FEWEST_LINES = 20
"""Lines of the picture in which the board shows the stripe."""
CalibrationStage = Literal["camera", "laser", "table"]


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


class LiveCalibration:
    """One calibration. All methods may be called from any thread."""

    def __init__(
        self, board: str, table: str, lowest: float = 0.0, orientation: Orientation = "vertical"
    ) -> None:
        """With these boards: ``board`` in the hand, ``table`` a board or markers on the table.

        ``lowest``: mm, height of the lowest corner of the board on the table. Raises FormatError
        for a board that is none.
        """
        self._board = parse_board(board)
        kind, _, rest = table.partition(":")
        if kind == "markers":
            name, _, side = rest.partition(":")
            aruco_dictionary(name)
            settings = CalibrationSettings(name, _length(side), orientation=orientation)
        else:
            settings = CalibrationSettings(
                table_board=parse_board(table), lowest=lowest, orientation=orientation
            )
        self._settings, self._text = settings, board
        self._lock = threading.RLock()
        self._camera: dict[int, BoardView] = {}
        self._lasers: dict[int, tuple[str, LaserPicture]] = {}
        self._table: dict[int, TablePicture] = {}
        self._next = 1

    @property
    def orientation(self) -> Orientation:
        """Of the stripe in the pictures."""
        return self._settings.orientation

    def keep(self, stage: CalibrationStage, shot: Shot) -> bool:
        """Look at a picture and keep what was found; whether it can be used."""
        with self._lock:
            number = self._next
            self._next += 1
        name = f"{stage} {number}"
        if stage == "table":
            turned = self._table_picture(shot, name)
            with self._lock:
                self._table[number] = turned
            return not _why_not(turned)
        view = detect_board(shot.dark, self._board, name)
        if stage == "camera":
            with self._lock:
                self._camera[number] = view
            return not view.failure
        light, widths = _light(shot, view, self._settings.orientation)
        margin = None if view.failure else white_margin(shot.dark, view)
        with self._lock:
            self._lasers[number] = shot.laser, LaserPicture(view, light, margin, widths)
        return bool(len(light))

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
            boards = [v for v in self._camera.values() if not v.failure]
            boards += [pic.view for _, pic in self._lasers.values() if not pic.view.failure]
            views = [
                SeenView(k, "camera", "", v.name, v.failure, len(v.corners))
                for k, v in self._camera.items()
            ]
            for k, (name, pic) in self._lasers.items():
                why = pic.view.failure
                if not why and not len(pic.candidates):
                    why = f"no stripe of laser {name} on the board"
                views.append(SeenView(k, "laser", name, pic.view.name, why, len(pic.view.corners)))
            for k, t in self._table.items():
                views.append(SeenView(k, "table", "", t.name, _why_not(t), len(t.seen.corners)))
        size = boards[0].size if boards else (1, 1)
        corners = [v.corners for v in boards]
        return CalibrationState(
            board=self._text,
            views=tuple(views),
            coverage=coverage(corners, *size) if boards else 0.0,
            cells=_cells(corners, size),
            missing=tuple(_missing(views)),
        )

    def frozen(self) -> Callable[[Callable[[], None]], LiveRig]:
        """The calibration of the pictures there are now; it calls what it is given now and then.

        It raises CalibrationError where the pictures do not tell a rig, and what that raises.
        """
        with self._lock:
            camera, table = list(self._camera.values()), list(self._table.values())
            names = dict.fromkeys(name for name, _ in self._lasers.values())
            lasers: dict[str, Sequence[LaserPicture]] = {
                n: [picture for name, picture in self._lasers.values() if name == n] for n in names
            }

        def calibrated(check: Callable[[], None]) -> LiveRig:
            done = calibrate_rig(camera, lasers, table, self._settings, lambda text: check())
            found = figures(done)
            unused = [
                Finding("calibrate.not-used", "note", r.reason, f"{r.role}: {r.name}")
                for r in done.rejected
            ]
            text = f"camera {found.camera_rms_px:.3f} px rms, coverage {100 * found.coverage:.0f} %"
            for place, u in list(found.radius_k2_mm.items())[:1]:
                text += f"; at {place} mm a radius ± {u:.2f} mm (k = 2)"
            said = (*findings_of(done, found), *unused)
            return LiveRig(done.rig, rig_to_json(done.rig), text, said)

        return calibrated

    def _table_picture(self, shot: Shot, name: str) -> TablePicture:
        light: dict[str, Floats] = {}
        if shot.lit is not None:
            channel = _channel(shot.lit, shot.dark)
            way = self._settings.orientation
            light[shot.laser] = stripe_light(shot.lit, shot.dark, channel, way)[0]
        board, step = self._settings.table_board, float(shot.stop)
        if board is not None:
            return TablePicture(detect_board(shot.dark, board, name), light, name, step)
        markers = detect_markers(shot.dark, self._settings.dictionary)
        return TablePicture(markers, light, name, step)


def _light(shot: Shot, view: BoardView, orientation: Orientation) -> tuple[Floats, Floats]:
    """The stripe's candidates (n, 2) px of a picture and their widths; none where it misses the
    board."""
    nothing: tuple[Floats, Floats] = np.zeros((0, 2)), np.zeros(0)
    if view.failure or shot.lit is None:
        return nothing
    weights = None
    if shot.lit.ndim == 3:
        excess = laser_weights(shot.lit, shot.dark, view.corners)
        weights = None if excess is None else np.eye(3)[int(excess.argmax())]
    light, widths = stripe_light(shot.lit, shot.dark, weights, orientation)
    mask = np.zeros(shot.lit.shape[:2], np.uint8)
    cv2.fillConvexPoly(mask, cv2.convexHull(view.corners.round().astype(np.int32)), 1)
    u, v = light.round().astype(int).T
    return (light, widths) if np.count_nonzero(mask[v, u]) >= _FEWEST_LINES else nothing


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
