"""D10: the kit for driver authors passes for ours, simulated and over the wire, and it bites."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from tests.devices.boards import DIALECTS, OUTPUTS, PATIENT, UNITS, firmware, plugged
from turnscan.devices import Lasers, Turntable
from turnscan.devices._manual import ManualTurntable
from turnscan.devices._registry import board
from turnscan.errors import DeviceDisconnected, DeviceRefused
from turnscan.simulate import SimLasers, SimTurntable, simulated
from turnscan.simulate.controllers import Socket
from turnscan.testing import check_lasers, check_turntable


@pytest.fixture(params=DIALECTS)
def wired(request: pytest.FixtureRequest) -> Iterator[tuple[str, Socket]]:
    with Socket(firmware(request.param), scale=100.0) as socket:
        yield request.param, socket


def opener(dialect: str, socket: Socket) -> Callable[[], Any]:
    @contextmanager
    def opened() -> Iterator[Any]:
        device = board(f"{dialect}:{socket.path}?lasers=a,b", deadlines=PATIENT)
        if device.alarm:
            device.acknowledge()
        try:
            yield device
        finally:
            device.close()

    return opened


def test_our_turntables(wired: tuple[str, Socket]) -> None:
    dialect, socket = wired
    check_turntable(
        opener(dialect, socket),
        microstep=2 * math.pi / UNITS[dialect],
        true_angle=lambda: socket.firmware.turns * 2 * math.pi,
    )


def test_our_lasers(wired: tuple[str, Socket]) -> None:
    dialect, socket = wired
    outputs = [o.partition(":")[0] for o in OUTPUTS[dialect]]
    names = dict(zip(outputs, "ab", strict=True))
    check_lasers(
        opener(dialect, socket),
        burning=lambda: frozenset(names[output] for output in socket.firmware.lit),
    )


def test_the_simulated_ones() -> None:
    devices = simulated("sim:cup?perfect=yes")

    @contextmanager
    def table() -> Iterator[SimTurntable]:
        yield devices.turntable

    @contextmanager
    def lasers() -> Iterator[SimLasers]:
        try:
            yield devices.lasers
        finally:
            devices.lasers.off()

    check_turntable(table, microstep=1e-6, true_angle=lambda: devices.world.commanded)
    check_lasers(lasers, burning=lambda: devices.world.lit)


def test_a_person() -> None:
    @contextmanager
    def opened() -> Iterator[ManualTurntable]:
        table = ManualTurntable(lambda question: "")
        yield table
        table.close()

    check_turntable(opened, microstep=1e-6)


class Table:
    """A table of ours with one defect."""

    def __init__(self, defect: str) -> None:
        self.defect, self.there, self.closed = defect, 0.0, False

    def move_to(self, angle: float, timeout: float) -> float:
        if self.closed and self.defect != "closed":
            raise DeviceDisconnected("closed")
        if not math.isfinite(angle):
            if self.defect == "nan":
                return angle
            raise DeviceRefused("no angle")
        if self.defect == "late":
            time.sleep(0.0 if timeout > 0.01 else 7.1)
        drift = 1e-4 if self.defect == "drift" else 0.0
        self.there = angle + drift + (0.01 if self.defect == "lies" else 0.0)
        return angle + (0.01 if self.defect == "inexact" else 0.0)

    def stop(self) -> None:
        if self.defect == "stop":
            raise DeviceRefused("cannot")

    def close(self) -> None:
        self.closed = True


def _check(defect: str) -> None:
    table = Table(defect)

    @contextmanager
    def opened() -> Iterator[Turntable]:
        table.closed = False
        if defect == "opening":
            table.there += 0.5
        yield table
        table.close()

    truth: Callable[[], float] = lambda: table.there  # noqa: E731
    if defect == "drift":  # a little more with every move
        moves = iter(range(10**6))
        inner = table.move_to

        def move_to(angle: float, timeout: float) -> float:
            reached = inner(angle, timeout)
            table.there = angle + 1e-5 * next(moves)
            return reached

        table.move_to = move_to  # type: ignore[method-assign]
    check_turntable(opened, microstep=1e-4, true_angle=truth)


def test_the_kit_passes_a_good_table() -> None:
    _check("none")


@pytest.mark.parametrize("defect", ["nan", "late", "drift", "inexact", "stop", "closed", "opening"])
def test_the_kit_finds_a_bad_table(defect: str) -> None:
    with pytest.raises(AssertionError):
        _check(defect)


class Lamps:
    """Lasers with one defect."""

    names = ("a", "b")

    def __init__(self, defect: str) -> None:
        self.defect, self.lit, self.end = defect, frozenset[str](), math.inf

    def light(self, lit: frozenset[str], lease: float) -> None:
        if self.defect != "names" and lit - set(self.names):
            raise DeviceRefused("no such laser")
        if self.defect != "leases" and not 0 < lease < math.inf:
            raise DeviceRefused("no lease")
        self.lit = self.lit | lit if self.defect == "adds" else lit
        self.end = math.inf if self.defect == "for ever" else time.monotonic() + lease

    def renew(self, lease: float) -> None:
        if self.defect == "renews all":
            self.lit = frozenset(self.names)
        if self.defect != "renews none":
            self.end = time.monotonic() + lease

    def off(self) -> None:
        if self.defect != "off":
            self.lit = frozenset()

    def burning(self) -> frozenset[str]:
        return self.lit if time.monotonic() < self.end else frozenset()


@pytest.mark.parametrize(
    "defect",
    ["names", "leases", "adds", "for ever", "off", "closing", "renews all", "renews none", ""],
)
def test_the_kit_finds_bad_lasers(defect: str) -> None:
    lamps = Lamps(defect)

    @contextmanager
    def opened() -> Iterator[Lasers]:
        try:
            yield lamps
        finally:
            if defect != "closing":
                lamps.lit = frozenset()

    if not defect:
        check_lasers(opened, burning=lamps.burning)
        return
    with pytest.raises(AssertionError):
        check_lasers(opened, burning=lamps.burning)


def test_plugged_is_left_dark() -> None:
    with plugged("grbl") as (device, socket):
        device.light(frozenset({"a"}), 1.0)
        fw = socket.firmware
    assert not fw.lit
