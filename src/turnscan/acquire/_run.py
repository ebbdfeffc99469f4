"""A plan on devices into a scan file: what is there already is not taken again."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from turnscan.acquire import _events as events
from turnscan.acquire._capture import Hardware, Shooter
from turnscan.acquire._control import Control
from turnscan.acquire._look import FirstLook
from turnscan.acquire._plan import Plan
from turnscan.acquire._sink import Sink
from turnscan.acquire._watch import LaserWatch
from turnscan.acquire._writer import Writer
from turnscan.arrays import Image
from turnscan.devices import StopSwitch
from turnscan.errors import DeviceError, DeviceTimeout, LaserStateUnknown, TurnscanError
from turnscan.scan import Frame, Setting

_LOST_IN_A_ROW = 5
"""Pictures that may fail to come, one after the other, before the camera counts as gone."""


@dataclass(frozen=True)
class Outcome:
    """How a run ended that no error ended."""

    complete: bool
    """False where somebody aborted it."""
    frames: int
    """Stored by this run."""
    missing: int
    """Recorded as missing by this run."""


def run(
    plan: Plan,
    hardware: Hardware,
    sink: Sink,
    *,
    first: FirstLook | None = None,
    listener: events.Listener = lambda event: None,
    control: Control | None = None,
    clock: Callable[[], float] = time.time,
) -> Outcome:
    """Take every frame of the plan that ``sink`` does not have.

    Frames are packed and stored by a thread of their own while the table turns and the next picture
    is taken; a `Stored` event means that a frame is on the disk. A picture that does not come is
    asked for once more, then recorded as missing with its cause, and the scan goes on.

    Lasers are lit only while a picture is exposed, and are dark when this returns or raises,
    however it does; then the table is stopped and the frame in the writer's hands is stored.

    Raises InputError for a laser there is not, DeviceTimeout where the camera gives five pictures
    on end no more, LaserStateUnknown where pictures contradict what the lasers were told, and
    DeviceError, SafetyError or ScanError as devices and sink do.
    """
    job = _Job(plan, hardware, sink, first, listener, control or Control(), clock)
    try:
        outcome = job.work()
    except BaseException as e:
        job.tell(events.Ended(False, str(e) or type(e).__name__))
        raise
    job.tell(events.Ended(outcome.complete, "complete" if outcome.complete else "aborted"))
    return outcome


class _Aborted(Exception):
    """Somebody wants an end; never leaves this module."""


class _Job:
    """One run."""

    def __init__(
        self,
        plan: Plan,
        hardware: Hardware,
        sink: Sink,
        first: FirstLook | None,
        listener: events.Listener,
        control: Control,
        clock: Callable[[], float],
    ) -> None:
        self._switch = switch = StopSwitch(hardware.lasers, hardware.turntable)
        self._hw = replace(hardware, lasers=switch.lasers, turntable=switch.turntable)
        self._plan, self._sink = plan, sink
        self._given = dict(first.pictures) if first else {}
        self._listener, self._control, self._clock = listener, control, clock
        self._telling = threading.Lock()
        self._shooter = Shooter(plan, self._hw)
        self._watch = LaserWatch(plan, sink.plan)
        self._darks: dict[int, tuple[Image | None, str]] = {}
        self._dark_of = -1
        self._lost = self._frames = self._missing = 0
        self._paused = 0.0

    def tell(self, event: events.Event) -> None:
        """One event at a time, whichever thread it comes from."""
        with self._telling:
            self._listener(event)

    def work(self) -> Outcome:
        """All steps; see `run`."""
        self._shooter.check_names()
        todo = [step for step in range(self._plan.steps) if self._wanted(step)]
        self.tell(events.Started(self._plan.steps, len(todo)))
        self._control.on_abort(self._stop)
        self._writer = Writer()
        try:
            with self._shooter.dark_at_the_end():
                complete = self._steps(todo)
                self._writer.finish()
        finally:
            self._control.on_abort(lambda: None)
            self._writer.close()
        return Outcome(complete, self._frames, self._missing)

    def _stop(self) -> None:
        """Dark and at rest, from any thread. Raises nothing: the thread of the scan will."""
        with contextlib.suppress(TurnscanError):
            self._switch.press()

    def _steps(self, todo: list[int]) -> bool:
        began = time.monotonic()
        try:
            for done, step in enumerate(todo, 1):
                self._step(step)
                per_step = (time.monotonic() - began - self._paused) / done
                left = per_step * (len(todo) - done)
                self.tell(events.StepDone(step, done, len(todo), left))
            if todo and self._plan.dark_every:
                self._look_dark(len(self._plan.exposures) - 1)
        except _Aborted:
            return False
        except DeviceError:
            if self._control.aborted:  # a move that was stopped, an exposure in the dark
                return False
            raise
        return True

    def _wanted(self, step: int) -> list[tuple[str, int]]:
        """Sets and exposures that are to be taken; ("", -1) is the texture."""
        out = [
            (name, k)
            for k in range(len(self._plan.exposures))
            for name in self._plan.sets
            if not self._sink.has(name, step, k)
        ]
        if self._plan.has_texture(step) and not self._sink.has_texture(step):
            out.append(("", -1))
        return out

    def _step(self, step: int) -> None:
        wanted = self._wanted(step)
        every = self._plan.dark_every
        home = step - step % every if every else -1
        if home not in (-1, step, self._dark_of):
            # Taken up in the middle: the dark picture of this group is taken where it was.
            self._move(home)
            for k in sorted({k for _, k in wanted if k >= 0}):
                self._dark(home, k)
        reached = self._move(step)
        for name, k in wanted:
            self._may_go_on()
            if k < 0:
                self._texture(step)
                continue
            exposure = self._shooter.configure(self._plan.exposures[k])
            dark, cause = (None, "")
            if every:
                dark, cause = self._dark(home, k)
            lit, why = self._shot(step, name, k)
            self._check_aborted()  # it may have gone dark in the middle of this picture
            if lit is None or (every and dark is None):
                self._store_missing(step, name, k, why or cause)
                continue
            if dark is not None:
                self._watch.lit(name, k, lit, dark)
            self._store(step, name, k, lit, dark, reached, exposure)

    def _move(self, step: int) -> float:
        """The angle reached, NaN where it is the one commanded."""
        self._may_go_on()
        angle = self._plan.angle(step)
        self.tell(events.Moving(step, angle))
        reached = self._hw.turntable.move_to(angle, self._shooter.move_timeout)
        self._shooter.settle()
        return math.nan if reached == angle else reached

    def _dark(self, home: int, exposure: int) -> tuple[Image | None, str]:
        """The dark picture of a group of steps, taken when it is first asked for."""
        if home != self._dark_of:
            self._darks.clear()
            self._dark_of = home
        if exposure not in self._darks:
            if home == 0 and ("", exposure) in self._given:
                self._darks[exposure] = self._given.pop(("", exposure)), ""
            else:
                self._darks[exposure] = self._look_dark(exposure)
        return self._darks[exposure]

    def _look_dark(self, exposure: int) -> tuple[Image | None, str]:
        """A dark picture. Raises LaserStateUnknown where two consecutive ones show a stripe."""
        self._shooter.configure(self._plan.exposures[exposure])
        picture, cause = self._shooter.picture(frozenset())
        laser = None if picture is None else self._watch.still_lit(exposure, picture)
        if laser is not None:
            self._hw.lasers.off()
            picture, cause = self._shooter.picture(frozenset())
            laser = None if picture is None else self._watch.still_lit(exposure, picture)
        if laser is not None:
            raise LaserStateUnknown(
                f"laser {laser!r}: pictures taken after it was switched off still show its stripe",
                hint="cut the power of the lasers",
            )
        self._count_lost(picture)
        return picture, cause

    def _shot(self, step: int, name: str, exposure: int) -> tuple[Image | None, str]:
        if step == 0 and (name, exposure) in self._given:
            return self._given.pop((name, exposure)), ""
        picture, cause = self._shooter.picture(self._plan.sets[name])
        self._count_lost(picture)
        return picture, cause

    def _count_lost(self, picture: Image | None) -> None:
        self._lost = 0 if picture is not None else self._lost + 1
        if self._lost >= _LOST_IN_A_ROW:
            raise DeviceTimeout(
                f"camera: no picture received, {self._lost} times in a row",
                hint="check camera and cable, then resume",
            )

    def _texture(self, step: int) -> None:
        texture = self._plan.texture
        assert texture is not None
        seconds, gain = self._shooter.configure(texture.exposure)
        picture, _ = self._shooter.picture(frozenset(texture.lamps))
        self._check_aborted()
        self._count_lost(picture)
        if picture is None:
            return  # not there; the next resume tries again
        taken, angle = picture, self._plan.angle(step)
        at, settings = self._clock(), _settings(seconds, gain)
        self._writer.submit(lambda: self._sink.add_texture(step, taken, angle, at, settings))

    def _store(
        self,
        step: int,
        name: str,
        exposure: int,
        lit: Image,
        dark: Image | None,
        reached: float,
        accepted: tuple[float, float],
    ) -> None:
        frame = Frame(
            step, name, lit, dark, exposure, commanded=self._plan.angle(step), measured=reached,
            time=self._clock(), settings=_settings(*accepted),
        )  # fmt: skip
        self.tell(events.Taken(step, name, exposure, lit, dark))
        self._frames += 1

        def store() -> None:
            self._sink.add(frame)
            self.tell(events.Stored(step, name, exposure))

        self._writer.submit(store)

    def _store_missing(self, step: int, name: str, exposure: int, cause: str) -> None:
        self._missing += 1
        angle = self._plan.angle(step)

        def store() -> None:
            self._sink.add_missing(step, name, cause, angle, exposure)
            self.tell(events.Missing(step, name, exposure, cause))

        self._writer.submit(store)

    def _may_go_on(self) -> None:
        if self._control.paused and not self._control.aborted:
            self._hw.lasers.off()
            self.tell(events.Paused())
            since = time.monotonic()
            self._control.wait()
            self._paused += time.monotonic() - since
            self.tell(events.WentOn())
        self._check_aborted()

    def _check_aborted(self) -> None:
        if self._control.aborted:
            raise _Aborted


def _settings(seconds: float, gain: float) -> dict[str, Setting]:
    """What the camera accepted; NaN is what it does not tell."""
    given: dict[str, Setting] = {"seconds": seconds, "gain": gain}
    return {k: v for k, v in given.items() if not math.isnan(float(v))}
