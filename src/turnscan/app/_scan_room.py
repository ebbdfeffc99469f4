"""The scan room: a plan taken with the devices of the rig room, told as it goes."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator
from fractions import Fraction
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
from turnscan.station import Addresses, Opened, Prepared, Wishes, prepare

State = Literal["running", "paused", "complete", "aborted", "failed"]


class ScanRoom:
    """At most one scan at a time. All methods may be called from any thread."""

    def __init__(self, hub: Hub, jobs: Jobs, library: Library, rig: RigRoom) -> None:
        self._hub, self._jobs, self._library, self._rig = hub, jobs, library, rig
        self._lock = threading.Lock()
        self._control: acquire.Control | None = None
        rig.on_stop(self._abort)

    def start(self, wish: q.ScanPlan) -> Job:
        """Take a scan, as a job.

        Raises InputError for a name or a plan that cannot be, and where nothing is connected or
        another scan is under way.
        """
        at, _ = self._rig.connected
        path, wishes = self._library.new_path(wish.name), _wishes(wish)
        control = acquire.Control()
        with self._lock:
            if self._control is not None:
                raise InputError("a scan is being taken", hint="wait for its end, or abort it")
            self._control = control
        self._rig.look_off()

        def work(job: Job) -> Result:
            job.on_cancel = control.abort
            try:
                with self._rig.using("a scan is being taken") as bench, self._told():
                    return self._take(job, control, path, at, bench, wishes)
            finally:
                self._control = None
                self._rig.tell()

        return self._jobs.start("scan", f"Scanning {path.stem}", work)

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
            raise InputError("no scan is being taken")
        return self._control

    def _abort(self) -> None:
        control = self._control
        if control is not None:
            control.abort()

    @contextlib.contextmanager
    def _told(self) -> Iterator[None]:
        self._rig.busy = True
        try:
            yield
        finally:
            self._rig.busy = False

    def _take(
        self,
        job: Job,
        control: acquire.Control,
        path: Path,
        at: Addresses,
        bench: Opened,
        wishes: Wishes,
    ) -> Result:
        ready = prepare(at, bench, wishes, self._rig.rig)
        job.steps(ready.plan.steps)
        with ready.create(path) as scan:
            name = self._library.name_of(path)
            story = _Story(self._hub, name, ready, job)
            growing = Growing(self._hub, name, ready.rig, ready.first.scan_plan.orientation)
            growing.colour(ready.first.scan_plan.weights)

            def listen(event: acquire.Event) -> None:
                if isinstance(event, acquire.Taken):
                    angle = ready.plan.angle(event.step)
                    growing.put(Taken(event.step, event.laser, angle, event.lit, event.dark))
                else:
                    story.tell(event)

            try:
                outcome = acquire.run(
                    ready.plan, bench.hardware, scan,
                    first=ready.first, listener=listen, control=control,
                )  # fmt: skip
            finally:
                growing.close()
        self._hub.tell(p.Scans(scans=self._library.entries(frozenset())))
        lost = f", {outcome.missing} missing" if outcome.missing else ""
        end = "whole" if outcome.complete else "aborted; turnscan resume takes the rest"
        return Result(f"{path.stem}: {outcome.frames} frames taken{lost}; {end}")


class _Story:
    """What is told of a scan that is being taken."""

    def __init__(self, hub: Hub, name: str, ready: Prepared, job: Job) -> None:
        self._hub, self._name, self._job = hub, name, job
        self._total, self._done, self._missing = ready.plan.steps, 0, 0
        self._left: float | None = None
        self._say("running", ready.first.threshold_reason)

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
    """Degrees as exact fractions, to a ten-thousandth."""
    ends = (
        Fraction(round(wish.from_deg * 10000), 10000),
        Fraction(round(wish.to_deg * 10000), 10000),
    )
    return Wishes(
        steps=wish.steps,
        range_deg=ends,
        lasers=wish.lasers,
        exposures=wish.seconds,
        gain=wish.gain,
        keep=wish.keep,
        threshold=wish.threshold,
    )
