"""The rig room: devices that are connected, live pictures of them, and the doctor."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

from turnscan.app import _protocol as p
from turnscan.app import _requests as q
from turnscan.app._hub import Client, Hub
from turnscan.app._jobs import Job, Jobs, Result, remarks
from turnscan.app._library import Library
from turnscan.app._live import Board, see
from turnscan.arrays import Image
from turnscan.errors import InputError, SafetyError, TurnscanError
from turnscan.workflows import (
    DEFAULT_DEVICE,
    DeviceOptions,
    DoctorOptions,
    KnownRig,
    Opened,
    StoppableDevices,
    doctor,
    find_devices,
    live_pictures,
    seen_stripe,
    stoppable_devices,
)

ALONE_SECONDS = 3.0
"""s without an operator after which live pictures end and the lasers are dark."""
IDLE_SECONDS = 600.0
"""s after which an operator who asks for nothing counts as gone."""
_TELL_EVERY = 1.0
_WATCH_EVERY = 0.25
_PATIENCE = 2.0
"""s to wait for devices that are just being put down."""
_NOTHING = p.DeviceState(state="none", text="not connected")


class RigRoom:
    """One set of devices. All methods may be called from any thread.

    One thing at a time is done with them: looking, turning, the doctor, or a scan. `stop` waits for
    nothing.
    """

    def __init__(
        self, hub: Hub, jobs: Jobs, library: Library, may_light: Callable[[], bool]
    ) -> None:
        self._hub, self._jobs, self._library, self._may_light = hub, jobs, library, may_light
        self.rig: KnownRig | None = None
        """That of a file or of a calibration; None takes that of a simulated rig."""
        self._rig_name = ""
        self._using = threading.Lock()
        self._telling = threading.Lock()
        """What was sent last is the present state: nothing older comes after it."""
        self._stops = 0
        """How often `stop` was called: what waited for the devices meanwhile is not begun."""
        self._job: Job | None = None
        """That of whoever uses the devices."""
        self._devices: StoppableDevices | None = None
        self._stack = ExitStack()
        self._camera = self._table = _NOTHING
        self._angle: float | None = None
        self._changing_look = threading.Lock()
        """Of two requests about live pictures, the later one counts."""
        self._looking = threading.Event()
        self._looker: threading.Thread | None = None
        self._what = ""
        self.find_board: Callable[[Image], Board] | None = None
        """What finds the board of the calibration in a live picture; None before there is one."""
        self.busy = False
        """Whether a scan is running: then the state of the devices is sent each second."""
        self._closed = threading.Event()
        threading.Thread(target=self._watch, name="watch", daemon=True).start()

    # Devices

    def find(self, id: int, probe: bool) -> p.Found:
        """What is connected to the computer; ports are opened where ``probe`` is wanted."""
        seen = find_devices(probe=probe)
        found = [p.FoundDevice(address=a[:200], text=a[:200], role="camera") for a in seen.cameras]
        answers = {answer.path: answer for answer in seen.answers}
        for port in seen.ports:
            address, text = "", port.description or "a serial port"
            if port.path in answers:
                answer = answers[port.path]
                address, text = answer.address, answer.address or answer.why_not
            found.append(p.FoundDevice(address=address or port.path, text=text[:200], role="board"))
        text = "a simulated rig: camera, table and lasers in one"
        found.append(p.FoundDevice(address=DEFAULT_DEVICE, text=text, role="board"))
        text = "the same, with a hand-held board for calibration"
        address = f"{DEFAULT_DEVICE}&hand=charuco"
        found.append(p.FoundDevice(address=address, text=text, role="board"))
        return p.Found(id=id, devices=found, notes=remarks(seen.findings, self._hub.hide))

    def connect(self, camera: str, turntable: str, lasers: str) -> None:
        """Open devices; those connected before are let go. Raises InputError, DeviceError."""
        self.look_off()
        with self._alone("devices are being connected"):
            self._let_go()
            wanted = DeviceOptions(camera, turntable, lasers)
            try:
                self._devices = self._stack.enter_context(stoppable_devices(wanted))
            except BaseException:
                self._let_go()
                raise
            self._camera = p.DeviceState(state="ready", text=camera[:200])
            self._table = p.DeviceState(state="ready", text=turntable[:200])
        self.tell()

    def disconnect(self) -> None:
        """Lasers dark, and let the devices go."""
        self.look_off()
        with self._alone("devices are being connected"):
            self._let_go()
        self.tell()

    def use_rig(self, rig: KnownRig, name: str) -> None:
        """Take this rig for scans from now on."""
        self.rig, self._rig_name = rig, name
        self.tell()

    def turn(self, degrees: float) -> None:
        """Turn the table. Raises DeviceError."""
        with self.using() as bench:
            reached = bench.hardware.turntable.move_to(math.radians(degrees), 120.0)
            self._angle = math.degrees(reached)
        self.tell()

    def stop(self) -> None:
        """Lasers dark and table stopped at once, whatever is under way, which ends.

        Nothing lights or turns any more until somebody begins anew. Raises DeviceError and
        SafetyError where that cannot be confirmed.
        """
        self._stops += 1
        self._looking.clear()
        devices, job = self._devices, self._job
        if job is not None:
            job.cancel()  # first, so that it knows why its orders are refused
        if devices is not None:
            try:
                devices.switch.press()
            finally:
                self.tell()

    @property
    def connected(self) -> Opened:
        """The devices and where they are. Raises InputError where there are none."""
        return self._there()

    def close(self) -> None:
        """End everything; lasers dark. Raises SafetyError where they may be lit still."""
        self._closed.set()
        with contextlib.suppress(TurnscanError):
            self.stop()
        self.look_off()
        alone = self._using.acquire(timeout=_PATIENCE)  # what does not end does not keep them lit
        try:
            self._let_go()
        except SafetyError:
            raise
        except TurnscanError:
            pass  # a device that fails is no reason to stay
        finally:
            if alone:
                self._using.release()

    def tell(self, to: Client | None = None) -> None:
        """Tell everybody, or one, how the devices are."""
        rigs = list(self._library.rigs())  # before the lock: it looks at a folder
        with self._telling:
            self._hub.tell(self._state(rigs), to=to)

    def _state(self, rigs: list[str]) -> p.Devices:
        devices = self._devices
        at = None if devices is None else devices.opened.at
        lasers = [] if devices is None else devices.lasers.states
        return p.Devices(
            addresses=[] if at is None else [at.camera, at.turntable, at.lasers],
            camera=self._camera,
            table=self._table,
            angle_deg=self._angle,
            lasers=[
                p.LaserState(name=x.name, lit=x.lit, age_seconds=round(x.age, 2)) for x in lasers
            ],
            looking=self._looking.is_set(),
            rig=self.rig is not None or (devices is not None and devices.opened.rig is not None),
            rig_name=self._rig_name,
            rigs=rigs,
        )

    # Looking

    def look(self, request: q.Look) -> None:
        """Begin live pictures, or change how they are taken. Raises InputError."""
        with self._changing_look:
            self._end_look()
            bench = self._there()
            unknown = set(request.lit) - set(bench.hardware.lasers.names)
            if unknown:
                there = ", ".join(bench.hardware.lasers.names)
                raise InputError(f"no laser {min(unknown)!r}", hint=f"there is {there}")
            self._looking.set()
            self._looker = threading.Thread(
                target=self._look, args=(request,), name="look", daemon=True
            )
            self._looker.start()

    def look_off(self) -> None:
        """End live pictures; the lasers are dark when this returns."""
        self._looking.clear()  # at once, whoever is changing them
        with self._changing_look:
            self._end_look()

    def _end_look(self) -> None:
        self._looking.clear()
        looker, self._looker = self._looker, None
        if looker is not None:
            looker.join(30.0)

    def _look(self, request: q.Look) -> None:
        lit, number = frozenset(request.lit), 0
        try:
            with self.using() as bench:
                pictures = live_pictures(
                    bench, lit, request.seconds, request.gain, self._looking.is_set
                )
                with contextlib.closing(pictures):
                    for picture in pictures:
                        number += 1
                        way, find = request.orientation, self.find_board if request.board else None
                        stripe = seen_stripe(picture, None, way) if lit else None
                        board = None if find is None else find(picture)
                        see(self._hub, number, picture, lit, stripe, None, way, board)
        except TurnscanError as e:
            if self._looking.is_set() or isinstance(e, SafetyError):  # not what a stop broke off
                self._camera = p.DeviceState(state="failed", text=str(e)[:300])
        finally:
            self._looking.clear()
            self.tell()

    def _watch(self) -> None:
        """Darkness where no browser shows pictures any more; and how the devices are."""
        told = 0.0
        while not self._closed.wait(_WATCH_EVERY):
            if self._looking.is_set() and not self._attended():
                self._looking.clear()
                devices = self._devices
                if devices is not None:
                    with contextlib.suppress(TurnscanError):  # the looking thread meets it too
                        devices.opened.hardware.lasers.off()
                self.tell()
            busy = self._looking.is_set() or self.busy
            if self._devices is not None and busy and time.monotonic() - told > _TELL_EVERY:
                told = time.monotonic()
                self.tell()

    def _attended(self) -> bool:
        limit = ALONE_SECONDS if self._hub.operator is None else IDLE_SECONDS
        return self._hub.unattended < limit and (self._hub.operator is None or self._may_light())

    # The doctor

    def doctor(self, still: bool, seconds: float | None) -> Job:
        """Look the devices over, as a job. Raises InputError where nothing is connected."""
        self.look_off()
        self._there()

        def work(job: Job) -> Result:
            with self.using("the doctor is running", job) as bench:
                options = DoctorOptions(exposure=seconds, still=still)
                seen = doctor(bench, options, rig=self.rig, progress=job.progress)
            text = "\n".join(seen.conclusion)
            return Result(text, findings=seen.findings)

        return self._jobs.start("doctor", "Checking the devices", work)

    @contextlib.contextmanager
    def using(self, what: str = "the devices are busy", job: Job | None = None) -> Iterator[Opened]:
        """The devices, for one alone; ``job`` is cancelled by `stop`.

        Raises InputError where others have them, or for none.
        """
        with self._alone(what, job):
            yield self._there()

    @contextlib.contextmanager
    def _alone(self, what: str, job: Job | None = None) -> Iterator[None]:
        stops = self._stops
        if not self._using.acquire(timeout=_PATIENCE):
            raise InputError(self._what, hint="wait until it has finished, or stop it")
        self._what, self._job = what, job
        try:
            self._release(stops)
            yield
        finally:
            self._job = None
            self._using.release()

    def _release(self, stops: int) -> None:
        """Let the devices obey again. Raises InputError where there were more stops since."""
        devices = self._devices
        if devices is not None:
            devices.switch.release()
        if self._stops != stops:
            if devices is not None:
                devices.switch.press()
            raise InputError("stopped before it started", hint="start it again")

    def _there(self) -> Opened:
        if self._devices is None:
            raise InputError("no devices are connected", hint="connect them first")
        return self._devices.opened

    def _let_go(self) -> None:
        """Close the devices, whatever they make of it; the first error leaves."""
        stack, self._stack = self._stack, ExitStack()
        try:
            stack.close()
        finally:
            self._devices = None  # not before: until then STOP presses their switch
            self._camera = self._table = _NOTHING
            self._angle = None
