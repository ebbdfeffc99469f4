"""Faults of everything above and beside a lit laser, and the longest time to dark after each.

``python -m bench.safety`` runs them and writes what it measured into docs/safety.md;
``test_faults.py`` asserts each. The judge is the emulated board's own log.
"""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from fractions import Fraction
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

from tests.acquire.rig import picture_of
from turnscan.acquire import run
from turnscan.app._hub import Client, Hub
from turnscan.app._requests import Look
from turnscan.app._rig_session import RigRoom
from turnscan.arrays import Image
from turnscan.devices import _cameras
from turnscan.devices._guard_client import Deadlines
from turnscan.devices._registry import board
from turnscan.errors import DeviceTimeout, TurnscanError
from turnscan.scanner import (
    Addresses,
    Opened,
    ScanRequest,
    Series,
    examine,
    opened,
    photograph,
    prepare,
    which_laser,
)
from turnscan.simulate.controllers import (
    FabScanFirmware,
    Firmware,
    GrblFirmware,
    HorusFirmware,
    SardauscanFirmware,
    Socket,
)

PATIENCE = 300.0
"""s for a whole way to a picture, where kernels may have to be compiled first."""
DIALECTS = ("grbl", "horus", "fabscan", "sardauscan")
SCALE = 50.0
QUICK = Deadlines(acknowledge=0.6, move_extra=0.6, connect=5.0, keep_trying=20.0)


def firmware(dialect: str) -> Firmware:
    """A board of this dialect with a table."""
    if dialect == "grbl":
        return GrblFirmware({"100": 8.889, "110": 6000, "120": 800})
    kinds: dict[str, type[Firmware]] = {
        "horus": HorusFirmware,
        "fabscan": FabScanFirmware,
        "sardauscan": SardauscanFirmware,
    }
    return kinds[dialect]()


@dataclass(frozen=True)
class Span:
    """From the fault to dark, `time.monotonic`; inf where it stays lit."""

    begin: float
    dark: float

    @property
    def seconds(self) -> float:
        return max(0.0, self.dark - self.begin)


def dark_since(socket: Socket, begin: float, patience: float) -> Span:
    """When the laser that burns went dark."""
    log = socket.firmware.log
    while time.monotonic() < begin + patience and log[-1].outputs:
        time.sleep(0.001)
    return Span(begin, math.inf if log[-1].outputs else log[-1].time)


def _connected(address: str, **options: Any) -> Any:
    """A board; a machine that stalls while it connects gets another chance, it is not the test."""
    for _ in range(2):
        with suppress(DeviceTimeout):
            return board(address, **options)
    return board(address, **options)


@contextmanager
def lit(dialect: str, lease: float = 2.0, **link: Any) -> Iterator[tuple[Any, Socket]]:
    """A board with a laser that burns."""
    with Socket(firmware(dialect), scale=SCALE) as socket:
        address = f"{dialect}:{socket.path}?lasers=left,right"
        device = _connected(address, **{"deadlines": QUICK, **link})
        try:
            device.light(frozenset({"left"}), lease)
            assert socket.firmware.lit
            yield device, socket
        finally:
            with suppress(TurnscanError):
                device.close()


def until(happened: Callable[[], bool], patience: float = 30.0) -> None:
    """Wait for it."""
    end = time.monotonic() + patience
    while not happened():
        assert time.monotonic() < end, "it does not happen"
        time.sleep(0.001)


# The scanner.

_SCANNER = """
import sys, time
from turnscan.devices import burning, open_lasers
lasers = open_lasers(sys.argv[1])
with burning(lasers, frozenset({"left"})):
    print("lit", flush=True)
    time.sleep(60)
"""


def _scanner(dialect: str, how: signal.Signals) -> Span:
    with Socket(firmware(dialect), scale=SCALE) as socket:
        address = f"{dialect}:{socket.path}?lasers=left,right"
        child = subprocess.Popen([sys.executable, "-c", _SCANNER, address], stdout=subprocess.PIPE)
        assert child.stdout is not None
        try:
            assert child.stdout.readline() == b"lit\n"
            begin = time.monotonic()
            child.send_signal(how)
            return dark_since(socket, begin, 4.0)
        finally:
            child.kill()
            child.communicate()


def scanner_killed(dialect: str) -> Span:
    return _scanner(dialect, signal.SIGKILL)


def scanner_stopped(dialect: str) -> Span:
    return _scanner(dialect, signal.SIGSTOP)


# The camera: its driver hangs in the n-th picture that is taken with light.


@dataclass
class Hang:
    """A camera that will hang, and when it did."""

    board: Firmware
    nth: int
    seconds: float = 0.02
    began: float = 0.0
    over: threading.Event = field(default_factory=threading.Event)
    count: int = 0
    lasts: float = 30.0
    """s for which it hangs, where nobody ends it before."""


HANGS: dict[str, Hang] = {}


class HangingCamera:
    """``hang:NAME``, for the time of a test a driver like any other."""

    def __init__(self, address: str) -> None:
        self._hang = HANGS[address]
        self._shots = 0

    def configure(self, seconds: float, gain: float) -> tuple[float, float]:
        self._hang.seconds = seconds
        return seconds, gain

    def grab(self, timeout: float) -> Image:
        hang, self._shots = self._hang, self._shots + 1
        time.sleep(hang.seconds)
        burns = frozenset({"left"} if hang.board.lit else ())
        hang.count += bool(burns)
        if burns and hang.count == hang.nth:
            hang.began = time.monotonic()
            hang.over.wait(hang.lasts)
            raise DeviceTimeout("the camera has hung")
        return picture_of(0.0, burns, hang.seconds, self._shots)


def _scan(at: Addresses, bench: Opened, folder: Path) -> None:
    ready = prepare(bench, ScanRequest(steps=4, exposures=(0.02,), settle=0.0))
    with ready.create(folder / "a.turnscan") as scan:
        run(ready.plan, bench.hardware, scan, first=ready.first)


def _long_exposure(at: Addresses, bench: Opened, folder: Path) -> None:
    prepare(bench, ScanRequest(steps=4, exposures=(LONG,), settle=0.0))


def _auto_exposure(at: Addresses, bench: Opened, folder: Path) -> None:
    prepare(bench, ScanRequest(steps=4, auto_exposure=True))


def _capture(at: Addresses, bench: Opened, folder: Path) -> None:
    photograph(bench, Series(1, (Fraction(0), Fraction(360)), 0.0, ("left",), 0.02), lambda _: None)


def _doctor(at: Addresses, bench: Opened, folder: Path) -> None:
    examine(bench, 0.02, still=True)


def _which(at: Addresses, bench: Opened, folder: Path) -> None:
    which_laser(bench, 0.02)


LONG = 0.6
"""s of a long exposure."""
_PATHS: dict[str, tuple[int, Callable[[Addresses, Opened, Path], None]]] = {
    "scan": (3, _scan),
    "auto-exposure": (1, _auto_exposure),
    "capture": (1, _capture),
    "doctor": (1, _doctor),
    "devices": (1, _which),
}


def _hung(name: str, nth: int, dialect: str, way: Callable[[Addresses, Path], None]) -> Span:
    """The time from a picture that hangs to dark, in the way that production takes it.

    On a busy machine the board may answer too late, and the way end before its picture is taken.
    """
    for _ in range(8):
        span = _hung_once(name, nth, dialect, way)
        if span is not None:
            return span
    raise AssertionError(f"{name}: it ends before a picture hangs")


def _hung_once(
    name: str, nth: int, dialect: str, way: Callable[[Addresses, Path], None]
) -> Span | None:
    """None where the way ended before the picture that was to hang."""
    with (
        Socket(firmware(dialect), scale=SCALE) as socket,
        tempfile.TemporaryDirectory() as folder,
    ):
        turntable = f"{dialect}:{socket.path}?lasers=left,right"
        at = Addresses(f"hang:{name}", turntable, turntable)
        hang = HANGS[at.camera] = Hang(socket.firmware, nth)

        def work() -> None:
            with suppress(TurnscanError):
                way(at, Path(folder))

        thread = threading.Thread(target=work)
        thread.start()
        until(lambda: hang.began > 0.0 or not thread.is_alive(), PATIENCE)
        if not hang.began > 0.0:
            return None
        span = dark_since(socket, hang.began, 6.0)
        hang.over.set()
        thread.join(PATIENCE)
        assert not thread.is_alive()
        return span


def _opening(path: Callable[[Addresses, Opened, Path], None]) -> Callable[[Addresses, Path], None]:
    def way(at: Addresses, folder: Path) -> None:
        with opened(at) as bench:
            path(at, bench, folder)

    return way


def _live_view(at: Addresses, folder: Path) -> None:
    library: Any = SimpleNamespace(rigs=lambda: ())
    hub = Hub()
    # An operator: without one, live pictures end by themselves.
    hub.join(Client(remote=False, browser=""))
    room = RigRoom(hub, Any, library, lambda: True)  # type: ignore[arg-type]
    room.connect(at.camera, at.turntable, at.lasers)
    room.look(Look(id=1, on=True, lit=("left",)))
    # On a busy machine the board may answer too late, and the pictures end before one hangs.
    hang = HANGS[at.camera]
    until(lambda: hang.over.is_set() or not (hang.began or room._looking.is_set()), PATIENCE)
    room.close()


@contextmanager
def hanging_cameras() -> Iterator[None]:
    """``hang:NAME`` is an address."""
    known = _cameras._known()
    ours = EntryPoint("hang", f"{__name__}:HangingCamera", _cameras.GROUP)
    with mock.patch.object(_cameras, "_known", return_value={**known, "hang": ours}):
        yield


def camera_hangs(dialect: str) -> Span:
    """In each way that production lights a laser, side by side: the longest."""
    ways = {name: (nth, _opening(path)) for name, (nth, path) in _PATHS.items()}
    ways["live view"] = (3, _live_view)
    with hanging_cameras(), ThreadPoolExecutor(len(ways)) as pool:
        spans = [
            pool.submit(_hung, f"{dialect} {name}", nth, dialect, way)
            for name, (nth, way) in ways.items()
        ]
        return max((span.result() for span in spans), key=lambda s: s.seconds)


def long_exposure_hangs(dialect: str) -> Span:
    with hanging_cameras():
        return _hung(f"{dialect} long", 1, dialect, _opening(_long_exposure))


# The guard.


def _guard_signalled(dialect: str, number: signal.Signals) -> Span:
    with lit(dialect) as (device, socket):
        begin = time.monotonic()
        os.kill(device._link.guard_pid, number)
        return dark_since(socket, begin, 6.0)


def guard_killed(dialect: str) -> Span:
    return _guard_signalled(dialect, signal.SIGKILL)


def guard_terminated(dialect: str) -> Span:
    return _guard_signalled(dialect, signal.SIGTERM)


def guard_stopped(dialect: str) -> Span:
    """And nobody asks it for anything."""
    return _guard_signalled(dialect, signal.SIGSTOP)


def guard_stopped_when_asked(dialect: str) -> Span:
    with lit(dialect) as (device, socket):
        os.kill(device._link.guard_pid, signal.SIGSTOP)
        begin = time.monotonic()
        device.off()
        return dark_since(socket, begin, 6.0)


def _while_closing(dialect: str, *signals: signal.Signals) -> Span:
    with lit(dialect) as (device, socket):
        guard = device._link.guard_pid
        os.kill(guard, signal.SIGSTOP)

        def close() -> None:
            with suppress(TurnscanError):
                device.close()

        closing = threading.Thread(target=close)
        begin = time.monotonic()
        closing.start()
        until(device._link._closing.is_set)
        for number in signals:
            begin = time.monotonic()
            os.kill(guard, number)
        closing.join(30.0)
        assert not closing.is_alive()
        return dark_since(socket, begin, 0.0)


def guard_killed_while_closing(dialect: str) -> Span:
    return _while_closing(dialect, signal.SIGKILL)


def guard_stopped_while_closing(dialect: str) -> Span:
    return _while_closing(dialect)


# The cable and the board.


def board_deaf(dialect: str) -> Span:
    """While the lease runs out and for three tries; from the moment at which it hears again."""
    with lit(dialect, lease=0.2) as (device, socket):
        socket.firmware._deaf_until = math.inf
        until(lambda: device._link._failure is not None)
        time.sleep(0.3)
        assert socket.firmware.lit
        begin = time.monotonic()
        socket.firmware._deaf_until = 0.0
        return dark_since(socket, begin, 10.0)


def _pulled(socket: Socket, seconds: float) -> None:
    socket.firmware.unplug(seconds, powered=True)
    until(lambda: not Path(socket.path).exists())


def cable_out(dialect: str) -> Span:
    """From the moment at which it is in again; the scanner has gone before."""
    with lit(dialect) as (device, socket):
        _pulled(socket, 3.0)
        with suppress(TurnscanError):
            device.close()
        assert socket.firmware.lit
        until(Path(socket.path).exists)
        return dark_since(socket, time.monotonic(), 6.0)


def cable_out_guard_killed(dialect: str) -> Span:
    """Longer than the scanner tries by itself."""
    with lit(dialect) as (device, socket):
        _pulled(socket, 4.5)
        os.kill(device._link.guard_pid, signal.SIGKILL)
        with suppress(TurnscanError):
            device.close()
        assert socket.firmware.lit
        until(Path(socket.path).exists)
        return dark_since(socket, time.monotonic(), 6.0)


def _said(dialect: str, message: bytes, piece: int = 0) -> Span:
    """From the moment at which the last part of the message leaves the board."""
    with lit(dialect) as (_, socket):
        socket.cable.piece, socket.cable.gap = piece, 0.02
        carried, sent = socket.cable.arrived, bytearray()
        reported: list[float] = []

        def arrived(now: float) -> bytes:
            data = carried(now)
            sent.extend(data)
            if message in sent and not reported:
                reported.append(time.monotonic())
            return data

        with mock.patch.object(socket.cable, "arrived", arrived):
            socket.firmware.say(message)
            until(lambda: bool(reported))
            return dark_since(socket, reported[0], 3.0)


def door(dialect: str) -> Span:
    """On a board whose door does not put the laser out."""
    return _said(dialect, b"[MSG:Check Door]\r\n")


def door_in_two_parts(dialect: str) -> Span:
    return _said(dialect, b"[MSG:Check Door]\r\n", piece=13)


def alarm_in_two_parts(dialect: str) -> Span:
    return _said(dialect, b"ALARM:1\r\n", piece=3)


def garbage(dialect: str) -> Span:
    with lit(dialect) as (device, socket):
        begin = time.monotonic()
        device._link._guard.stdin.write(b"not a frame at all")
        return dark_since(socket, begin, 3.0)


def refused_line(dialect: str) -> Span:
    """A line that a dialect does not list, while a laser burns."""
    with lit(dialect) as (device, socket):
        begin = time.monotonic()
        with suppress(TurnscanError):
            device._link.write(b"M?3 S1000\n")
        return dark_since(socket, begin, 3.0)


@dataclass(frozen=True)
class Case:
    """A row of the table."""

    fault: str
    does: str
    limit: float
    """s to dark that are promised."""
    run: Callable[[str], Span]
    dialects: tuple[str, ...] = DIALECTS
    """On which it is tried."""
    waits: bool = False
    """Whether it mostly waits, so that the boards may do so side by side."""

    @property
    def id(self) -> str:
        """Of its test."""
        return self.run.__name__

    def spans(self) -> list[Span]:
        """One for each board."""
        if not self.waits:
            return [self.run(dialect) for dialect in self.dialects]
        with ThreadPoolExecutor(len(self.dialects)) as pool:
            return [*pool.map(self.run, self.dialects)]


_LEASE = "the lease of 2 s runs out"
_TAKES_OVER = "the scanner ends the guard, opens the port and sends dark"
CASES = (
    Case("scanner killed", "the guard's input ends", 0.1, scanner_killed),
    Case("scanner stopped", _LEASE, 2.1, scanner_stopped, waits=True),
    Case(
        "camera hangs: scan, live view, capture, doctor, auto-exposure, devices",
        _LEASE, 2.1, camera_hangs, ("grbl",), waits=True,
    ),
    Case(
        f"camera hangs in an exposure of {LONG:g} s", "the lease runs out after twice the exposure",
        2.0 + 2 * LONG + 0.1, long_exposure_hangs, ("horus", "fabscan"), waits=True,
    ),
    Case("guard killed", "the scanner opens the port and sends dark", 0.2, guard_killed),
    Case("guard terminated (SIGTERM)", "dark, then it ends", 0.1, guard_terminated),
    Case("guard stopped or hanging", _TAKES_OVER, 1.5, guard_stopped, waits=True),
    Case("the same, and dark is asked for", _TAKES_OVER, 1.5, guard_stopped_when_asked, waits=True),
    Case("guard killed while closing", "the same", 0.2, guard_killed_while_closing),
    Case("guard stopped while closing", "the same", 1.5, guard_stopped_while_closing, waits=True),
    Case(
        "board deaf when the lease runs out", "dark is repeated every second; from when it hears",
        2.5, board_deaf, waits=True,
    ),
    Case(
        "cable out, board powered, scanner gone", "tries for 10 min; from when it is in again",
        1.0, cable_out, waits=True,
    ),
    Case(
        "the same, guard killed", "a guard of its own tries", 1.0, cable_out_guard_killed,
        waits=True,
    ),
    Case("door", "dark by the guard", 0.1, door, ("grbl",)),
    Case("door, reported in two parts", "the same", 0.1, door_in_two_parts, ("grbl",)),
    Case("alarm, reported in two parts", "the same", 0.1, alarm_in_two_parts, ("grbl",)),
    Case("bytes at the guard that are no order", "dark, then it ends", 0.1, garbage),
    Case("a line that is not on the list", "dark, then it ends", 0.1, refused_line),
)  # fmt: skip
