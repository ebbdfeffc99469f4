"""The calibration room: pictures of boards, taken live, become the rig of the devices."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from turnscan.app import _protocol as p
from turnscan.app import _requests as q
from turnscan.app._encode_picture import jpeg
from turnscan.app._envelope import Array
from turnscan.app._hub import Hub
from turnscan.app._jobs import Job, Jobs, Result, remarks
from turnscan.app._library import Library
from turnscan.app._live import Board, see
from turnscan.app._rig_session import RigRoom
from turnscan.errors import CalibrationError, InputError
from turnscan.remedy import plain_words
from turnscan.workflows import (
    CELL_COLUMNS,
    CELL_ROWS,
    CalibrationState,
    CaptureOptions,
    LiveCalibration,
    LiveRig,
    Shot,
    photograph,
    seen_stripe,
    verification_history,
)

_SMALL = 640
"""px: width of the pictures that are kept for a look."""

_TITLES: dict[q.Stage, str] = {
    "camera": "Taking pictures of the board",
    "laser": "Taking pictures of the lasers on the board",
    "table": "Taking pictures of the table",
}


class CalibrateRoom:
    """One calibration at a time. All methods may be called from any thread."""

    def __init__(self, hub: Hub, jobs: Jobs, library: Library, rig: RigRoom) -> None:
        self._hub, self._jobs, self._library, self._rig = hub, jobs, library, rig
        self._live: LiveCalibration | None = None
        self._verdict: p.CalibrationVerdict | None = None
        self._pictures: dict[int, bytes] = {}
        """JPEG, by the number of the view."""
        self._shown = 0
        self._telling = threading.Lock()
        """What was said last is how far it is."""

    def begin(self, request: q.BeginCalibration) -> None:
        """Start again, with these boards. Raises FormatError for a board that is none, InputError
        for a print of it that cannot be used."""
        self._live = live = LiveCalibration(
            request.board, request.table, request.lowest_mm, request.orientation, request.rulers_mm
        )
        self._verdict = None
        self._pictures.clear()
        self._rig.find_board = lambda picture: Board(*live.seen(picture))
        self.tell()

    def capture(self, request: q.Capture) -> Job:
        """Take pictures, and look at each as it comes, as a job; those of the table replace others.

        Afterwards all there is is adjusted, for advice on what to take next. Raises InputError
        where there is no calibration, or the pictures cannot be.
        """
        live = self._begun()
        ends = request.range_deg
        options = CaptureOptions(
            stage=request.stage,
            count=request.count,
            range_deg=None if ends is None else f"{ends[0]:.4f}:{ends[1]:.4f}",
            every=request.every,
            laser_name=request.laser,
            exposure=request.seconds,
        )
        series = options.series(self._rig.connected.hardware.lasers.names)
        self._rig.look_off()

        def work(job: Job) -> Result:
            shots = len(series.angles_deg()) * max(len(series.lasers), 1)
            job.steps(shots)
            good = 0
            what = "calibration pictures are being taken"
            with self._rig.using(what, job) as bench:
                if request.stage == "table":
                    live.forget_table()

                def keep(shot: Shot) -> None:
                    nonlocal good
                    view = live.keep(request.stage, shot)
                    good += not view.failure
                    self._show(shot, live, view.number)
                    self.tell()
                    job.tick()

                photograph(bench, series, keep, job.wait)
            live.consider(job.check)
            self.tell()
            return Result(f"{good} of {shots} pictures can be used")

        return self._jobs.start("calibrate", _TITLES[request.stage], work)

    def _show(self, shot: Shot, live: LiveCalibration, view: int) -> None:
        """Tell everybody the picture that was just taken, and keep it small."""
        self._shown += 1
        small = jpeg(shot.dark if shot.lit is None else shot.lit, _SMALL)
        if small is not None:
            self._pictures[view] = bytes(small)
        corners, failure = live.corners_of(view)
        board = Board(corners, failure, view)
        if shot.lit is None:
            see(self._hub, self._shown, shot.dark, frozenset(), None, board=board)
        else:
            way, lit = live.orientation, frozenset({shot.laser})
            stripe = seen_stripe(shot.lit, shot.dark, way)
            see(self._hub, self._shown, shot.lit, lit, stripe, None, way, board)

    def picture(self, view: int) -> bytes:
        """A picture of the calibration as JPEG. Raises InputError for one there is not."""
        try:
            return self._pictures[view]
        except KeyError:
            raise InputError("no such picture") from None

    def forget(self, view: int) -> None:
        """Take a picture away. Raises InputError for one there is not."""
        if self._live is None:
            raise InputError("no such picture")
        self._live.forget(view)
        self._pictures.pop(view, None)
        self.tell()

    def finish(self, request: q.FinishCalibration) -> Job:
        """Calibrate, keep the rig as a file of the folder, and use it from now on, as a job.

        The report is kept beside it, also where the rig is not worth being kept.
        """
        live = self._begun()
        path = self._library.new_file(request.name, ".json")
        page = self._library.new_file(f"{request.name.removesuffix('.json')}-report", ".html")

        def work(job: Job) -> Result:
            try:
                done = live.finish(job.check)
            except CalibrationError as e:
                self._judge("refused", e.message, plain_words(e.hint))
                raise
            job.check()
            self._library.write(page, done.report.encode())
            if done.refusal is None:
                self._library.write(path, done.json.encode())
            if done.verdict != "refused":
                self._rig.use_rig(done.rig, path.name)
            return self._result(done, path, page)

        return self._jobs.start("calibrate", "Calibrating", work)

    def _result(self, done: LiveRig, path: Path, page: Path) -> Result:
        file = self._library.name_of(page)
        refusal, written = done.refusal, path.name if done.refusal is None else ""
        text = done.text if refusal is None else refusal.message
        hint = "" if refusal is None else plain_words(refusal.hint)
        if refusal is None and done.rig.lacking:
            text = f"{' and '.join(done.rig.lacking)} of this rig is not calibrated yet"
            hint = "take the pictures that are missing, then calibrate again"
        found = remarks(done.findings, self._hub.hide)
        self._judge(done.verdict, text, hint, written, file, found)
        said = f"{path.name}: {text}" if written else f"not kept: {text}"
        files = [p.ResultFile(file=file, name=page.name, scan=False)]
        return Result(said, findings=done.findings, files=files)

    def _judge(
        self,
        verdict: p.Verdict,
        text: str,
        hint: str,
        rig: str = "",
        report: str | None = None,
        findings: Sequence[p.Remark] = (),
    ) -> None:
        self._verdict = p.CalibrationVerdict(
            verdict=verdict, text=text, hint=hint, rig=rig, report=report, findings=list(findings)
        )
        self.tell()

    def tell(self) -> None:
        """Tell everybody how far it is."""
        with self._telling:
            live = self._live
            if live is not None:
                self._hub.tell(*_told(live.state(), self._verdict))

    def _begun(self) -> LiveCalibration:
        if self._live is None:
            raise InputError("no calibration has been started", hint="give the calibration board")
        return self._live


def _told(
    state: CalibrationState, verdict: p.CalibrationVerdict | None
) -> tuple[p.Calibration, dict[str, Array]]:
    advice, space = state.advice, state.space
    axis = None if space is None else space.axis
    message = p.Calibration(
        board=state.board,
        views=[
            p.CalibrationView(
                view=v.number,
                stage=v.stage,
                laser=v.laser,
                name=v.name,
                failure=v.failure,
                corners=v.corners,
                rms_px=v.rms_px,
            )
            for v in state.views
        ],
        coverage=state.coverage,
        columns=CELL_COLUMNS,
        rows=CELL_ROWS,
        cells=list(state.cells),
        width=state.size[0],
        height=state.size[1],
        missing=list(state.missing),
        undetermined=[] if advice is None else list(advice.undetermined),
        advice_stage="" if advice is None else advice.stage,
        advice="" if advice is None else advice.text,
        verdict=verdict,
        reach=[] if space is None else list(space.reach),
        axis=[] if axis is None else [*axis[0].tolist(), *axis[1].tolist()],
    )
    placed = np.zeros((0, 4)) if space is None else space.corners
    return message, {
        "marked": state.marked.astype(np.float32),
        "placed": placed.astype(np.float32),
    }


def verifications(number: int, path: Path) -> p.Verifications:
    """The history of verifications, in the words of the protocol. Raises as `verify`."""
    return p.Verifications(
        id=number,
        histories=[
            p.VerificationRuns(
                artefact=h.artefact,
                rig=h.rig_key,
                trends=[
                    p.VerificationTrend(
                        name=t.name,
                        times=[datetime.fromtimestamp(at, UTC).isoformat() for at in t.times],
                        values=list(t.values),
                        noise=[2 * u for u in t.noise],
                        limit=t.limit,
                        alarm=t.alarm,
                    )
                    for t in h.trends
                ],
            )
            for h in verification_history(path)
        ],
    )
