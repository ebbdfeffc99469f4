"""The scan room: a plan taken with the devices of the rig room, told as it goes."""

from __future__ import annotations

import contextlib
import math
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from turnscan import acquire
from turnscan.app import _protocol as p
from turnscan.app import _requests as q
from turnscan.app._hub import Hub
from turnscan.app._jobs import Job, Jobs, Result
from turnscan.app._library import Library
from turnscan.app._live import Growing, Taken
from turnscan.app._rig_room import RigRoom
from turnscan.errors import InputError
from turnscan.rig import Rig
from turnscan.scan import Scan
from turnscan.scanner import (
    Opened,
    Wishes,
    acquisition_of,
    check_space,
    exact_degrees,
    forget_bad,
    hardware_to_resume,
    prepare,
    steps_left,
)

State = Literal["running", "paused", "complete", "aborted", "failed"]


class ScanRoom:
    """At most one scan at a time. All methods may be called from any thread."""

    def __init__(
        self,
        hub: Hub,
        jobs: Jobs,
        library: Library,
        rig: RigRoom,
        open_scans: Callable[[], frozenset[str]],
    ) -> None:
        self._hub, self._jobs, self._library, self._rig = hub, jobs, library, rig
        self._open_scans = open_scans
        self._lock = threading.Lock()
        self._control: acquire.Control | None = None

    def start(self, wish: q.ScanPlan) -> Job:
        """Take a scan, as a job.

        Raises InputError for a name or a plan that cannot be, and where nothing is connected or
        another scan is under way.
        """
        at, _ = self._rig.connected
        path, wishes = self._library.new_path(wish.name), _wishes(wish)

        def take(taking: _Taking, bench: Opened) -> acquire.Outcome:
            ready = prepare(at, bench, wishes, self._rig.rig)
            with ready.create(path) as scan:
                return taking.run(scan, ready.plan, bench.hardware, ready.rig, ready.first)

        return self._begin(f"Scanning {path.stem}", path, take)

    def resume(self, path: Path, wish: q.Resume) -> Job:
        """Take what an interrupted scan is missing, as a job, which fails where nobody knows how.

        Raises InputError where nothing is connected or another scan is under way.
        """
        _ = self._rig.connected
        at = None if wish.at_deg is None else math.radians(wish.at_deg)

        def take(taking: _Taking, bench: Opened) -> acquire.Outcome:
            with Scan.resume(path) as scan:
                plan = acquisition_of(scan).plan
                if wish.retake:
                    forget_bad(scan)
                left = steps_left(plan, scan)
                if not left:
                    return acquire.Outcome(complete=True, frames=0, missing=0)
                check_space(scan, plan, left)
                hardware = hardware_to_resume(plan, scan, bench.hardware, at)
                return taking.run(scan, plan, hardware, scan.rig)

        return self._begin(f"Resuming {path.stem}", path, take)

    def _begin(
        self, title: str, path: Path, take: Callable[[_Taking, Opened], acquire.Outcome]
    ) -> Job:
        control = acquire.Control()
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
                    outcome = take(_Taking(self._hub, self._library, job, control), bench)
            finally:
                self._control = None
                self._rig.tell()
                self._hub.tell(p.Scans(scans=self._library.entries(self._open_scans())))
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
    def _running(self) -> acquire.Control:
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


@dataclass(frozen=True)
class _Taking:
    """A scan that is being taken, and whom to tell of it."""

    hub: Hub
    library: Library
    job: Job
    control: acquire.Control

    def run(
        self,
        scan: Scan,
        plan: acquire.Plan,
        hardware: acquire.Hardware,
        rig: Rig | None,
        first: acquire.FirstLook | None = None,
    ) -> acquire.Outcome:
        """Take every frame that the file does not have, with live pictures and points."""
        left = steps_left(plan, scan)
        self.job.steps(left)
        name = self.library.name_of(scan.path)
        reason = "" if first is None else first.threshold_reason
        story = _Story(self.hub, name, left, self.job, reason)
        growing = Growing(self.hub, name, rig, scan.plan.orientation)
        growing.colour(scan.plan.weights)

        def listen(event: acquire.Event) -> None:
            if isinstance(event, acquire.Taken):
                angle = plan.angle(event.step)
                growing.put(Taken(event.step, event.laser, angle, event.lit, event.dark))
            else:
                story.tell(event)

        try:
            return acquire.run(
                plan, hardware, scan, first=first, listener=listen, control=self.control
            )
        finally:
            growing.close()


class _Story:
    """What is told of a scan that is being taken."""

    def __init__(self, hub: Hub, name: str, steps: int, job: Job, reason: str) -> None:
        self._hub, self._name, self._job = hub, name, job
        self._total, self._done, self._missing = steps, 0, 0
        self._left: float | None = None
        self._say("running", reason)

    def tell(self, event: acquire.Event) -> None:
        """Tell an event, where anybody would want to know."""
        match event:
            case acquire.StepDone():
                self._done, self._left = event.done, event.seconds_left
                self._job.at(event.done)
                self._say("running")
            case acquire.Missing():
                self._missing += 1
                where = f"step {event.step} of laser {event.laser}"
                self._say("running", f"{where} is missing: {event.cause}")
            case acquire.Paused():
                self._say("paused", "lasers dark, table at rest")
            case acquire.WentOn():
                self._say("running")
            case acquire.Ended():
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


def _wishes(wish: q.ScanPlan) -> Wishes:
    return Wishes(
        steps=wish.steps,
        range_deg=exact_degrees(wish.from_deg, wish.to_deg),
        lasers=wish.lasers,
        exposures=wish.seconds,
        gain=wish.gain,
        keep=wish.keep,
        threshold=wish.threshold,
        orientation=wish.orientation,
        texture=wish.texture,
        texture_every=wish.texture_every,
        lamps=wish.lamps,
    )
