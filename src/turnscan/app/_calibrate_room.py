"""The calibration room: pictures of boards, taken live, become the rig of the devices."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from turnscan.app import _protocol as p
from turnscan.app import _requests as q
from turnscan.app._hub import Hub
from turnscan.app._jobs import Job, Jobs, Result
from turnscan.app._library import Library
from turnscan.app._rig_room import RigRoom
from turnscan.arrays import Floats, Image
from turnscan.calibrate import (
    Board,
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
    stripe_candidates,
)
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.rig import rig_to_json
from turnscan.station import USUAL_SECONDS, Examination

COLUMNS, ROWS = 8, 6
"""Cells of the picture in which corners are counted."""
WANTED = {"camera": 8, "laser": 5, "table": 8}
"""Pictures of each kind that are worth a calibration."""


class CalibrateRoom:
    """One calibration at a time. All methods may be called from any thread."""

    def __init__(self, hub: Hub, jobs: Jobs, library: Library, rig: RigRoom) -> None:
        self._hub, self._jobs, self._library, self._rig = hub, jobs, library, rig
        self._lock = threading.RLock()
        self._board: Board | None = None
        self._settings = CalibrationSettings()
        self._text = ""
        self._clear()

    def _clear(self) -> None:
        self.camera: dict[int, BoardView] = {}
        self.lasers: dict[int, tuple[str, LaserPicture]] = {}
        self.table: dict[int, TablePicture] = {}
        self._next = 1

    def begin(self, wish: q.BeginCalibration) -> None:
        """Begin anew, with these boards. Raises FormatError for a board that is none."""
        board = parse_board(wish.board)
        kind, _, rest = wish.table.partition(":")
        if kind == "markers":
            name, _, side = rest.partition(":")
            aruco_dictionary(name)
            settings = CalibrationSettings(dictionary=name, marker_side=_length(side))
        else:
            table = parse_board(wish.table)
            settings = CalibrationSettings(table_board=table, lowest=wish.lowest_mm)
        with self._lock:
            self._board, self._settings, self._text = board, settings, wish.board
            self._clear()
        self.tell()

    def capture(self, wish: q.Capture) -> None:
        """Take a picture of the board, and for ``laser`` one with each laser, too."""
        board = self._begun()
        self._rig.look_off()
        with self._rig.using("a picture is being taken") as bench:
            look = Examination(bench.hardware, wish.seconds or bench.seconds or USUAL_SECONDS, 1.0)
            with look.shooter.dark_at_the_end():
                dark = look.picture()
                view = detect_board(dark, board, f"{wish.stage} {self._next}")
                if wish.stage == "camera":
                    self._keep_camera(view)
                else:
                    for name in bench.hardware.lasers.names:
                        lit = dark if view.failure else look.picture(name)
                        self._keep_laser(name, view, lit, dark)
        self.tell()

    def turn(self, wish: q.CaptureTable) -> Job:
        """Turn what rides on the table once round, a picture each step, as a job."""
        self._begun()
        self._rig.look_off()

        def work(job: Job) -> Result:
            job.steps(wish.steps)
            with self._rig.using("the table is being turned") as bench:
                seconds = wish.seconds or bench.seconds or USUAL_SECONDS
                look = Examination(bench.hardware, seconds, 1.0)
                with self._lock:
                    self.table.clear()
                with look.shooter.dark_at_the_end():
                    for k in range(wish.steps):
                        angle = 2 * math.pi * k / wish.steps
                        bench.hardware.turntable.move_to(angle, look.shooter.move_timeout)
                        dark = look.picture()
                        light: dict[str, Floats] = {}
                        if wish.laser is not None:
                            lit = look.picture(wish.laser)
                            light[wish.laser] = stripe_candidates(lit, dark, _channel(lit, dark))
                        self._keep_table(dark, light, k)
                        job.tick()
                        self.tell()
            seen = sum(not _why_not(t) for t in self.table.values())
            return Result(f"{seen} of {wish.steps} pictures can be used")

        return self._jobs.start("calibrate", "Turning the table", work)

    def forget(self, view: int) -> None:
        """Take a picture away. Raises InputError for one there is not."""
        with self._lock:
            groups: tuple[dict[int, object], ...] = (self.camera, self.lasers, self.table)  # type: ignore[assignment]
            for group in groups:
                if group.pop(view, None) is not None:
                    break
            else:
                raise InputError("there is no such picture")
        self.tell()

    def finish(self, wish: q.FinishCalibration) -> Job:
        """Calibrate, keep the rig as a file of the folder, and use it from now on, as a job."""
        self._begun()
        path = self._library.new_file(wish.name, ".json")
        with self._lock:
            camera, table = list(self.camera.values()), list(self.table.values())
            names = dict.fromkeys(name for name, _ in self.lasers.values())
            lasers: dict[str, Sequence[LaserPicture]] = {
                n: [picture for name, picture in self.lasers.values() if name == n] for n in names
            }
            settings = self._settings

        def work(job: Job) -> Result:
            done = calibrate_rig(camera, lasers, table, settings, lambda text: job.check())
            found = figures(done)
            job.check()
            self._library.write(path, rig_to_json(done.rig).encode())
            self._rig.use_rig(done.rig, path.name)
            unused = [
                Finding("calibrate.not-used", "note", r.reason, f"{r.role}: {r.name}")
                for r in done.rejected
            ]
            text = f"{path.name}: camera {found.camera_rms_px:.3f} px rms, coverage "
            text += f"{100 * found.coverage:.0f} %"
            for place, u in list(found.radius_k2_mm.items())[:1]:
                text += f"; at {place} mm a radius ± {u:.2f} mm (k = 2)"
            return Result(text, findings=[*findings_of(done, found), *unused])

        return self._jobs.start("calibrate", "Calibrating", work)

    def tell(self) -> None:
        """Tell everybody how far it is."""
        with self._lock:
            boards = [v for v in self.camera.values() if not v.failure]
            boards += [pic.view for _, pic in self.lasers.values() if not pic.view.failure]
            views = [_view(k, "camera", "", v.failure, len(v.corners), v.name)
                     for k, v in self.camera.items()]  # fmt: skip
            for k, (name, pic) in self.lasers.items():
                why = pic.view.failure
                if not why and not len(pic.candidates):
                    why = f"no stripe of laser {name} on the board"
                views.append(_view(k, "laser", name, why, len(pic.view.corners), pic.view.name))
            for k, t in self.table.items():
                views.append(_view(k, "table", "", _why_not(t), len(t.seen.corners), t.name))
        size = boards[0].size if boards else (1, 1)
        share = coverage([v.corners for v in boards], *size) if boards else 0.0
        self._hub.tell(
            p.Calibration(
                board=self._text,
                views=views,
                coverage=share,
                columns=COLUMNS,
                rows=ROWS,
                cells=_cells([v.corners for v in boards], size),
                missing=_missing(views),
            )
        )

    def _begun(self) -> Board:
        if self._board is None:
            raise InputError("no calibration was begun", hint="say which board there is")
        return self._board

    def _number(self) -> int:
        number = self._next
        self._next += 1
        return number

    def _keep_camera(self, view: BoardView) -> None:
        with self._lock:
            self.camera[self._number()] = view

    def _keep_laser(self, name: str, view: BoardView, lit: Image, dark: Image) -> None:
        light: Floats = np.zeros((0, 2))
        if not view.failure:
            weights = None
            if lit.ndim == 3:
                excess = laser_weights(lit, dark, view.corners)
                weights = None if excess is None else np.eye(3)[int(excess.argmax())]
            light = stripe_candidates(lit, dark, weights)
        with self._lock:
            self.lasers[self._number()] = name, LaserPicture(view, light)

    def _keep_table(self, dark: Image, light: dict[str, Floats], step: int) -> None:
        name, board = f"table {step + 1}", self._settings.table_board
        if board is None:
            seen = TablePicture(
                detect_markers(dark, self._settings.dictionary), light, name, float(step)
            )
        else:
            seen = TablePicture(detect_board(dark, board, name), light, name, float(step))
        with self._lock:
            self.table[self._number()] = seen


def _view(
    number: int, stage: q.Stage, laser: str, failure: str, corners: int, name: str
) -> p.CalibrationView:
    return p.CalibrationView(
        view=number, stage=stage, laser=laser, name=name, failure=failure, corners=corners
    )


def _why_not(picture: TablePicture) -> str:
    seen = picture.seen
    if isinstance(seen, BoardView):
        return seen.failure
    return "" if len(seen.corners) else "none of the markers is readable"


def _missing(views: list[p.CalibrationView]) -> list[str]:
    """What is still wanted, in words."""
    out = []
    words = {
        "camera": "pictures of the board held in other ways, tilted and in every corner",
        "laser": "pictures of the board with the stripe on it, near and far",
        "table": "pictures of what rides on the table: turn it",
    }
    for stage, wanted in WANTED.items():
        have = len({v.name for v in views if v.stage == stage and not v.failure})
        if have < wanted:
            out.append(f"{wanted - have} more {words[stage]}")
    return out


def _cells(corners: list[Floats], size: tuple[int, int]) -> list[int]:
    """Corners in each cell of the picture, row by row."""
    every = np.concatenate([np.zeros((0, 2)), *corners])
    grid, _, _ = np.histogram2d(
        every[:, 1], every[:, 0], bins=(ROWS, COLUMNS), range=((0, size[1]), (0, size[0]))
    )
    counts: npt.NDArray[np.int64] = grid.astype(np.int64)
    return [int(n) for n in counts.ravel()]


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
        raise InputError(f"markers: {text!r} is no side in mm", hint="write markers:DICT_4X4_50:30")
    return value
