"""The calibration room: pictures of boards, taken live, become the rig of the devices."""

from __future__ import annotations

from turnscan.app import _protocol as p
from turnscan.app import _requests as q
from turnscan.app._hub import Hub
from turnscan.app._jobs import Job, Jobs, Result
from turnscan.app._library import Library
from turnscan.app._live import see
from turnscan.app._rig_session import RigRoom
from turnscan.errors import InputError
from turnscan.workflows import (
    CELL_COLUMNS,
    CELL_ROWS,
    CaptureOptions,
    LiveCalibration,
    Shot,
    photograph,
    seen_stripe,
)

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
        self._shown = 0

    def begin(self, wish: q.BeginCalibration) -> None:
        """Start again, with these boards. Raises FormatError for a board that is none."""
        self._live = LiveCalibration(wish.board, wish.table, wish.lowest_mm, wish.orientation)
        self.tell()

    def capture(self, wish: q.Capture) -> Job:
        """Take pictures, and look at each as it comes, as a job; those of the table replace others.

        Raises InputError where there is no calibration, or the pictures cannot be.
        """
        live = self._begun()
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
                    live.forget_table()

                def keep(shot: Shot) -> None:
                    nonlocal good
                    self._show(shot, live)
                    good += live.keep(wish.stage, shot)
                    self.tell()
                    job.tick()

                photograph(bench, series, keep, job.wait)
            return Result(f"{good} of {shots} pictures can be used")

        return self._jobs.start("calibrate", _TITLES[wish.stage], work)

    def _show(self, shot: Shot, live: LiveCalibration) -> None:
        """Tell everybody the picture that was just taken."""
        self._shown += 1
        if shot.lit is None:
            see(self._hub, self._shown, shot.dark, frozenset(), None)
        else:
            way = live.orientation
            stripe = seen_stripe(shot.lit, shot.dark, way)
            see(self._hub, self._shown, shot.lit, frozenset({shot.laser}), stripe, None, way)

    def forget(self, view: int) -> None:
        """Take a picture away. Raises InputError for one there is not."""
        if self._live is None:
            raise InputError("no such picture")
        self._live.forget(view)
        self.tell()

    def finish(self, wish: q.FinishCalibration) -> Job:
        """Calibrate, keep the rig as a file of the folder, and use it from now on, as a job."""
        calibrate = self._begun().frozen()
        path = self._library.new_file(wish.name, ".json")

        def work(job: Job) -> Result:
            done = calibrate(job.check)
            job.check()
            self._library.write(path, done.json.encode())
            if not done.rig.lacking:
                self._rig.use_rig(done.rig, path.name)
            return Result(f"{path.name}: {done.text}", findings=done.findings)

        return self._jobs.start("calibrate", "Calibrating", work)

    def tell(self) -> None:
        """Tell everybody how far it is."""
        if self._live is None:
            return
        state = self._live.state()
        self._hub.tell(
            p.Calibration(
                board=state.board,
                views=[
                    p.CalibrationView(
                        view=v.number,
                        stage=v.stage,
                        laser=v.laser,
                        name=v.name,
                        failure=v.failure,
                        corners=v.corners,
                    )
                    for v in state.views
                ],
                coverage=state.coverage,
                columns=CELL_COLUMNS,
                rows=CELL_ROWS,
                cells=list(state.cells),
                missing=list(state.missing),
            )
        )

    def _begun(self) -> LiveCalibration:
        if self._live is None:
            raise InputError("no calibration has been started", hint="give the calibration board")
        return self._live
