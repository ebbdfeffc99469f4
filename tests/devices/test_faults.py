"""D1: every fault at every step, over a real pseudo-terminal, through the guard."""

from __future__ import annotations

import contextlib
import time
from typing import Any

import pytest

from tests.devices.boards import DIALECTS, QUICK, SCALE, firmware
from turnscan.devices._registry import board
from turnscan.errors import (
    DeviceAlarm,
    DeviceDisconnected,
    DeviceError,
    DeviceGarbled,
    DeviceRefused,
    DeviceRestarted,
    DeviceTimeout,
    LaserStateUnknown,
    SafetyError,
    TurnscanError,
)
from turnscan.simulate.controllers import Fault, Socket

EXPECTED: dict[str, tuple[type[TurnscanError], ...]] = {
    "unplug": (DeviceDisconnected, LaserStateUnknown),
    "silence": (DeviceTimeout,),
    "deaf": (DeviceTimeout, LaserStateUnknown),
    "garbage": (DeviceGarbled,),
    "half line": (DeviceTimeout, DeviceGarbled),
    "doubled": (DeviceGarbled,),
    "late": (DeviceTimeout,),
    "alarm": (DeviceAlarm,),
    "error": (DeviceRefused,),
    "reboot": (DeviceRestarted,),
    "slow": (DeviceTimeout,),
    "babble": (DeviceGarbled,),
}
# FabScanPi answers all alike and shows no banner: what it lacks is seen, not what befell it.
FABSCAN: dict[str, tuple[type[TurnscanError], ...]] = {
    **dict.fromkeys(
        ("silence", "late", "garbage", "reboot", "babble"), (DeviceTimeout, DeviceGarbled)
    ),
    "deaf": (DeviceTimeout, DeviceGarbled, LaserStateUnknown),
}
HOW_LONG = {"unplug": 0.02, "deaf": 0.15 * SCALE, "babble": 0.05 * SCALE}
CASES = [("grbl", kind, 40) for kind in EXPECTED]
CASES += [
    (dialect, kind, 6)
    for dialect in DIALECTS[1:]
    for kind in EXPECTED
    # FabScanPi and Sardauscan know neither alarms nor refusals.
    if dialect == "horus" or kind not in ("alarm", "error")
]


class Scan:
    """A scan that a person resumes after every fault."""

    def __init__(self, dialect: str, socket: Socket) -> None:
        self.dialect, self.socket = dialect, socket
        self.device: Any = None
        self.connect()

    def connect(self) -> None:
        if self.device is not None:
            with contextlib.suppress(TurnscanError):
                self.device.close()
        address = f"{self.dialect}:{self.socket.path}?lasers=a,b"
        for _ in range(5):
            # A busy machine may be late with the first answers.
            with contextlib.suppress(DeviceTimeout):
                self.device = board(address, deadlines=QUICK)
                return
        self.device = board(address, deadlines=QUICK)

    def step(self) -> None:
        device = self.device
        device.move_to(device.angle + 0.05, 5.0)
        device.light(frozenset({"a"}), 2.0)
        device.light(frozenset(), 2.0)
        device.move_to(device.angle, 5.0)

    def go_on(self) -> int:
        """A step with which nothing is wrong; how often a busy machine did not answer in time.

        Half of an answer that a reboot cut off may come so late that the next order gets it.
        """
        for late in range(3):
            try:
                self.step()
                return late
            except (DeviceTimeout, DeviceGarbled, LaserStateUnknown):
                self.recover()
        raise AssertionError("it does not go on")

    def recover(self) -> None:
        """As a person would: wait, plug in, look, acknowledge; then the step once more."""
        time.sleep(0.03)
        for _ in range(20):
            try:
                if self.device._link._failure is not None:
                    self.connect()
                self.device.acknowledge()
                return
            except (DeviceError, SafetyError):
                time.sleep(0.05)
        raise AssertionError("it cannot be resumed")


@pytest.mark.parametrize(("dialect", "kind", "steps"), CASES)
def test_every_fault_at_every_step(dialect: str, kind: str, steps: int) -> None:
    named = late = 0
    with Socket(firmware(dialect), scale=SCALE) as socket, contextlib.ExitStack() as at_the_end:
        scan, board_ = Scan(dialect, socket), socket.firmware
        at_the_end.callback(lambda: scan.device.close())  # the one it has by then
        expected = EXPECTED[kind]
        if dialect == "fabscan":
            expected = FABSCAN.get(kind, expected)
        for step in range(steps):
            on = "move" if step % 2 == 0 or kind == "slow" else "light"
            count = board_._moves if on == "move" else board_._lights
            how_long = HOW_LONG.get(kind, 0.1)
            if kind == "late":  # a move may take what it takes, and that is board time
                how_long = (0.25 if dialect == "grbl" or on == "light" else 1.2) * SCALE
            fault = Fault(count + 1, kind, how_long, number=step % 8 + 1, on=on)  # type: ignore[arg-type]
            board_.faults.append(fault)
            begin = time.monotonic()
            try:
                scan.step()
            except expected:
                took = time.monotonic() - begin
                named += 1
                time.sleep(0.002)
                if board_.lit:
                    time.sleep(0.1)
                assert not board_.lit, f"lit 100 ms after {kind} at step {step}"
                assert took < 5.0, f"{kind} at step {step} took {took:.1f} s"
                if kind == "late":  # nobody acknowledges within a blink
                    time.sleep(max(0.0, how_long / SCALE - took))
                scan.recover()
            except (DeviceTimeout, LaserStateUnknown):  # a busy machine: an answer came too late
                late += 1
                scan.recover()
            else:
                assert kind in ("slow", "doubled"), f"{kind} at step {step} went unnoticed"
                scan.device._lines.clear()
            if any(f is fault for f in board_.faults):  # a busy machine was late before it
                board_.faults.clear()
                late += 1
            late += scan.go_on()
    # An answer has a tenth of a second; a machine that stalls for longer takes some with it.
    assert late <= max(2, steps // 3), f"{late} answers did not come in time, without a fault"
    wanted = steps - late
    assert named >= wanted or kind in ("slow", "doubled"), f"{named} of {steps} named"
    if kind == "doubled":
        assert named >= 0.9 * steps


def test_there_are_enough_cases() -> None:
    assert sum(steps for dialect, _, steps in CASES if dialect == "grbl") >= 480


def test_a_driver_that_ignores_what_it_is_told_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """The mutant: any line counts as ok."""
    from turnscan.devices import _board
    from turnscan.devices._replies import Kind, Sentence, sentence

    def credulous(line: bytes) -> Sentence:
        try:
            said = sentence(line)
        except DeviceGarbled:
            return Sentence(Kind.OK, "ok")
        return Sentence(Kind.OK, "ok") if said.kind is Kind.ERROR else said

    monkeypatch.setattr(_board, "sentence", credulous)
    with pytest.raises(AssertionError, match=r"went unnoticed"):
        test_every_fault_at_every_step("horus", "error", 40)
