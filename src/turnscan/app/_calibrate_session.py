"""The calibration room: pictures of boards, taken live, become the rig of the devices."""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence

import cv2
import numpy as np
import numpy.typing as npt

from turnscan.app import _protocol as p
from turnscan.app import _requests as q
from turnscan.app._hub import Hub
from turnscan.app._jobs import Job, Jobs, Result
from turnscan.app._library import Library
from turnscan.app._live import see, stripe_of
from turnscan.app._rig_session import RigRoom
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
from turnscan.stripes import Orientation
from turnscan.workflows import CaptureOptions, Shot, photograph

COLUMNS, ROWS = 8, 6
"""Cells of the picture in which corners are counted."""
WANTED = {"camera": 8, "laser": 5, "table": 8}
"""Pictures of each kind, and with each laser, that are worth a calibration."""
_FEWEST_LINES = 20
"""Lines of the picture in which the board shows the stripe."""
_TITLES: dict[q.Stage, str] = {
    "camera": "Taking pictures of the board",
    "laser": "Taking pictures of the lasers on the board",
    "table": "Taking pictures of the table",
}


class CalibrateRoom:
    """One calibration at a time. All methods may be called from any thread."""

    def __init__(self, hub: Hub, jobs: Jobs, library: Library, rig: RigRoom) -> None:
        self._hub, self._jobs, self._library, self._rig = hub, jobs, library, rig
        self._lock = threading.RLock()
        self._board: Board | None = None
        self._settings = CalibrationSettings()
        self._text = ""
        self._shown = 0
        self._clear()

    def _clear(self) -> None:
        self.camera: dict[int, BoardView] = {}
        self.lasers: dict[int, tuple[str, LaserPicture]] = {}
        self.table: dict[int, TablePicture] = {}
        self._next = 1

    def begin(self, wish: q.BeginCalibration) -> None:
        """Start again, with these boards. Raises FormatError for a board that is none."""
        board = parse_board(wish.board)
        kind, _, rest = wish.table.partition(":")
        if kind == "markers":
            name, _, side = rest.partition(":")
            aruco_dictionary(name)
            settings = CalibrationSettings(name, _length(side), orientation=wish.orientation)
        else:
            table = parse_board(wish.table)
            settings = CalibrationSettings(
                table_board=table, lowest=wish.lowest_mm, orientation=wish.orientation
            )
        with self._lock:
            self._board, self._settings, self._text = board, settings, wish.board
            self._clear()
        self.tell()

    def capture(self, wish: q.Capture) -> Job:
        """Take pictures, and look at each as it comes, as a job; those of the table replace others.

        Raises InputError where there is no calibration, or the pictures cannot be.
        """
        self._begun()
        ends = wish.range_deg
        options = CaptureOptions(
            stage=wish.stage,
            count=wish.count,
            range_deg=None if ends is None else f"{ends[0]:.4f}:{ends[1]:.4f}",
            every=wish.every,
            laser_name=wish.laser,
            exposure=wish.seconds,
        )
        series = options.series(self._rig.connected.hardware.lasers.names)
        self._rig.look_off()

        def work(job: Job) -> Result:
            shots = len(series.angles_deg()) * max(len(series.lasers), 1)
            job.steps(shots)
            good = 0
            what = "calibration pictures are being taken"
            with self._rig.using(what, job) as bench:
                if wish.stage == "table":
                    with self._lock:
                        self.table.clear()

                def keep(shot: Shot) -> None:
                    nonlocal good
                    self._show(shot)
                    good += self._keep(wish.stage, shot)
                    self.tell()
                    job.tick()

                photograph(bench, series, keep, job.wait)
            return Result(f"{good} of {shots} pictures can be used")

        return self._jobs.start("calibrate", _TITLES[wish.stage], work)

    def _show(self, shot: Shot) -> None:
        """Tell everybody the picture that was just taken."""
        self._shown += 1
        if shot.lit is None:
            see(self._hub, self._shown, shot.dark, frozenset(), None)
        else:
            way = self._settings.orientation
            stripe = stripe_of(shot.lit, shot.dark, way)
            see(self._hub, self._shown, shot.lit, frozenset({shot.laser}), stripe, None, way)

    def forget(self, view: int) -> None:
        """Take a picture away. Raises InputError for one there is not."""
        with self._lock:
            groups: tuple[dict[int, object], ...] = (self.camera, self.lasers, self.table)  # type: ignore[assignment]
            for group in groups:
                if group.pop(view, None) is not None:
                    break
            else:
                raise InputError("no such picture")
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
            if not done.rig.lacking:
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
            raise InputError("no calibration has been started", hint="give the calibration board")
        return self._board

    def _keep(self, stage: q.Stage, shot: Shot) -> bool:
        """Look at a picture and keep what was found; whether it can be used."""
        board = self._begun()
        with self._lock:
            number = self._next
            self._next += 1
        name = f"{stage} {number}"
        if stage == "table":
            turned = self._table_picture(shot, name)
            with self._lock:
                self.table[number] = turned
            return not _why_not(turned)
        view = detect_board(shot.dark, board, name)
        if stage == "camera":
            with self._lock:
                self.camera[number] = view
            return not view.failure
        light = _light(shot, view, self._settings.orientation)
        with self._lock:
            self.lasers[number] = shot.laser, LaserPicture(view, light)
        return bool(len(light))

    def _table_picture(self, shot: Shot, name: str) -> TablePicture:
        light: dict[str, Floats] = {}
        if shot.lit is not None:
            channel = _channel(shot.lit, shot.dark)
            way = self._settings.orientation
            light[shot.laser] = stripe_candidates(shot.lit, shot.dark, channel, way)
        board, step = self._settings.table_board, float(shot.stop)
        if board is not None:
            return TablePicture(detect_board(shot.dark, board, name), light, name, step)
        markers = detect_markers(shot.dark, self._settings.dictionary)
        return TablePicture(markers, light, name, step)


def _view(
    number: int, stage: q.Stage, laser: str, failure: str, corners: int, name: str
) -> p.CalibrationView:
    return p.CalibrationView(
        view=number, stage=stage, laser=laser, name=name, failure=failure, corners=corners
    )


def _light(shot: Shot, view: BoardView, orientation: Orientation) -> Floats:
    """(n, 2) px: the stripe's candidates of a picture; none where it misses the board."""
    nothing: Floats = np.zeros((0, 2))
    if view.failure or shot.lit is None:
        return nothing
    weights = None
    if shot.lit.ndim == 3:
        excess = laser_weights(shot.lit, shot.dark, view.corners)
        weights = None if excess is None else np.eye(3)[int(excess.argmax())]
    light = stripe_candidates(shot.lit, shot.dark, weights, orientation)
    mask = np.zeros(shot.lit.shape[:2], np.uint8)
    cv2.fillConvexPoly(mask, cv2.convexHull(view.corners.round().astype(np.int32)), 1)
    u, v = light.round().astype(int).T
    return light if np.count_nonzero(mask[v, u]) >= _FEWEST_LINES else nothing


def _why_not(picture: TablePicture) -> str:
    seen = picture.seen
    if isinstance(seen, BoardView):
        return seen.failure
    return "" if len(seen.corners) else "none of the markers is readable"


def _missing(views: list[p.CalibrationView]) -> list[str]:
    """What is still wanted, in words."""
    out = []
    words = {
        "camera": "pictures of the board in other poses, tilted and in every corner",
        "laser": "pictures of the board with each stripe on it, near and far",
        "table": "pictures of the table with its markers or board: turn it",
    }
    for stage, wanted in WANTED.items():
        ours = [v for v in views if v.stage == stage]
        lasers = {v.laser for v in ours} or {""}
        have = min(sum(v.laser == name and not v.failure for v in ours) for name in lasers)
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
        raise InputError(
            f"markers: {text!r} is not a side length in mm", hint="write markers:DICT_4X4_50:30"
        )
    return value
