"""The scan room: a plan taken with the devices of the rig room, reported as it goes."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from turnscan import workflows
from turnscan.app import _protocol as p
from turnscan.app import _requests as q
from turnscan.app._hub import Hub
from turnscan.app._jobs import Job, Jobs, Result
from turnscan.app._library import Library
from turnscan.app._live import Growing, Taken
from turnscan.app._rig_session import RigRoom
from turnscan.errors import InputError
from turnscan.workflows import Opened, PlannedScan, ScanOptions, TakenScan, scan_events

State = Literal["running", "paused", "complete", "aborted", "failed"]


class ScanRoom:
    """At most one scan at a time. All methods may be called from any thread."""

    def __init__(
        self,
        hub: Hub,
        jobs: Jobs,
        library: Library,
        rig: RigRoom,
        tell_scans: Callable[[], None],
    ) -> None:
        self._hub, self._jobs, self._library, self._rig = hub, jobs, library, rig
        self._tell_scans = tell_scans
        self._lock = threading.Lock()
        self._control: workflows.ScanControl | None = None

    def start(self, request: q.ScanPlan) -> Job:
        """Take a scan, as a job.

        Raises InputError for a name or a plan that cannot be, and where nothing is connected or
        another scan is under way.
        """
        _ = self._rig.connected
        path, options = self._library.new_path(request.name), _options(request)

        def take(taking: _Taking, bench: Opened) -> TakenScan:
            return workflows.scan(
                path, options, devices=bench, rig=self._rig.rig, planned=taking.planned,
                listener=taking.hear, control=taking.control,
            )  # fmt: skip

        return self._begin(f"Scanning {path.stem}", path, take)

    def resume(self, path: Path, request: q.Resume) -> Job:
        """Take what an interrupted scan is missing, as a job, which fails where that is impossible.

        Raises InputError where nothing is connected or another scan is under way.
        """
        _ = self._rig.connected

        def take(taking: _Taking, bench: Opened) -> TakenScan:
            return workflows.resume(
                path, devices=bench, at_deg=request.at_deg, retake=request.retake,
                planned=taking.planned, listener=taking.hear, control=taking.control,
            )  # fmt: skip

        return self._begin(f"Resuming {path.stem}", path, take)

    def _begin(self, title: str, path: Path, take: Callable[[_Taking, Opened], TakenScan]) -> Job:
        control = workflows.ScanControl()
        with self._lock:
            if self._control is not None:
                raise InputError(
                    "a scan is running", hint="wait until it has finished, or abort it"
                )
            self._control = control
        self._rig.look_off()

        def work(job: Job) -> Result:
            job.on_cancel = control.abort
            try:
                with self._rig.using("a scan is running", job) as bench, self._told():
                    taking = _Taking(self._hub, self._library, job, control)
                    try:
                        outcome = take(taking, bench)
                    finally:
                        taking.close()
            finally:
                self._control = None
                self._rig.tell()
                self._tell_scans()
            lost = f", {outcome.missing} missing" if outcome.missing else ""
            end = "whole" if outcome.complete else "aborted; missing frames can be taken later"
            return Result(f"{path.stem}: {outcome.frames} frames taken{lost}; {end}")

        return self._jobs.start("scan", title, work)

    def pause(self) -> None:
        """Wait after the picture that is being taken. Raises InputError for no scan."""
        self._running.pause()

    def go_on(self) -> None:
        """End the pause. Raises InputError for no scan."""
        self._running.go_on()

    def abort(self) -> None:
        """End the scan; what was taken is kept. Raises InputError for no scan."""
        self._running.abort()

    @property
    def _running(self) -> workflows.ScanControl:
        if self._control is None:
            raise InputError("no scan is running")
        return self._control

    @contextlib.contextmanager
    def _told(self) -> Iterator[None]:
        self._rig.busy = True
        try:
            yield
        finally:
            self._rig.busy = False


@dataclass
class _Taking:
    """A scan that is being taken, and whom to tell of it."""

    hub: Hub
    library: Library
    job: Job
    control: workflows.ScanControl
    _story: _Story | None = None
    _growing: Growing | None = None
    _planned: PlannedScan | None = None

    def planned(self, scan: PlannedScan) -> None:
        """Begin to tell of it, with live pictures and points."""
        self.job.steps(scan.left)
        name = self.library.name_of(scan.path)
        self._story = _Story(self.hub, name, scan.left, self.job, scan.threshold_reason)
        plan = scan.scan.plan
        looker = workflows.GrowingScan(scan.rig, plan.orientation, plan.weights)
        self._growing = Growing(self.hub, name, looker, plan.orientation)
        self._planned = scan

    def hear(self, event: scan_events.Event) -> None:
        """Tell an event, or show its picture."""
        if self._planned is None or self._story is None or self._growing is None:
            return
        if isinstance(event, scan_events.Taken):
            angle = self._planned.plan.angle(event.step)
            self._growing.put(Taken(event.step, event.laser, angle, event.lit, event.dark))
        else:
            self._story.tell(event)

    def close(self) -> None:
        """Show what is waiting."""
        if self._growing is not None:
            self._growing.close()


class _Story:
    """What is reported of a scan that is being taken."""

    def __init__(self, hub: Hub, name: str, steps: int, job: Job, reason: str) -> None:
        self._hub, self._name, self._job = hub, name, job
        self._total, self._done, self._missing = steps, 0, 0
        self._left: float | None = None
        self._say("running", reason)

    def tell(self, event: scan_events.Event) -> None:
        """Tell an event, where anybody would want to know."""
        match event:
            case scan_events.StepDone():
                self._done, self._left = event.done, event.seconds_left
                self._job.at(event.done)
                self._say("running")
            case scan_events.Missing():
                self._missing += 1
                where = f"step {event.step} of laser {event.laser}"
                self._say("running", f"{where} is missing: {event.cause}")
            case scan_events.Paused():
                self._say("paused", "lasers dark, table at rest")
            case scan_events.WentOn():
                self._say("running")
            case scan_events.Ended():
                ends: dict[str, State] = {"complete": "complete", "aborted": "aborted"}
                self._say(ends.get(event.why, "failed"), event.why)
            case _:
                pass

    def _say(self, state: State, text: str = "") -> None:
        self._hub.tell(
            p.Scanning(
                scan=self._name,
                state=state,
                done=self._done,
                total=self._total,
                seconds_left=self._left,
                missing=self._missing,
                text=" ".join(text.split())[:300],
            )
        )


def _options(request: q.ScanPlan) -> ScanOptions:
    """The options of the workflow; angles to a ten-thousandth of a degree."""
    return ScanOptions(
        steps=request.steps,
        range_deg=f"{request.from_deg:.4f}:{request.to_deg:.4f}",
        laser_names=None if request.lasers is None else ",".join(request.lasers),
        exposures=request.seconds,
        gain=request.gain,
        keep=request.keep,
        threshold=request.threshold,
        orientation=request.orientation,
        texture=request.texture,
        texture_every=request.texture_every,
        lamps=request.lamps,
    )
