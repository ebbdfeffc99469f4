"""What nobody confirms is repeated, told, and never forgotten; each protection left out is seen."""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.safety import faults
from tests.safety.conftest import no_guard_left
from tests.safety.faults import QUICK, dark_since, firmware, lit, until
from turnscan.devices import _validated_camera
from turnscan.devices._guard_client import GuardedLink
from turnscan.devices._registry import board
from turnscan.errors import (
    DeviceAlarm,
    DeviceTimeout,
    InterlockOpen,
    LaserStateUnknown,
    TurnscanError,
)
from turnscan.simulate.controllers import Socket

Mutant = Callable[[str, str], Path]


def test_a_guard_killed_while_closing_before_a_deaf_board_is_told() -> None:
    with lit("grbl") as (device, socket):
        os.kill(device._link.guard_pid, signal.SIGSTOP)
        socket.firmware._deaf_until = math.inf
        told: list[TurnscanError] = []

        def close() -> None:
            try:
                device.close()
            except TurnscanError as e:
                told.append(e)

        closing = threading.Thread(target=close)
        closing.start()
        until(device._link._closing.is_set)
        os.kill(device._link.guard_pid, signal.SIGKILL)
        closing.join(20.0)
        assert [type(e) for e in told] == [LaserStateUnknown]
        assert "keeps trying" in str(told[0])
        assert socket.firmware.lit
        begin = time.monotonic()
        socket.firmware._deaf_until = 0.0  # and it does
        assert dark_since(socket, begin, 6.0).seconds < 2.5


def test_a_board_that_was_deaf_is_told_and_then_confirmed() -> None:
    with lit("grbl", lease=0.2) as (device, socket):
        socket.firmware._deaf_until = math.inf
        until(lambda: device._link._failure is not None)
        with pytest.raises(LaserStateUnknown, match="keeps trying"):
            device.light(frozenset({"left"}), 1.0)
        assert device._link._maybe_lit.is_set()
        socket.firmware._deaf_until = 0.0
        until(lambda: not device._link._maybe_lit.is_set())
        assert not socket.firmware.lit
        device.close()  # all is well again


SCANNER = """
import sys
from turnscan.devices import burning, open_lasers
from turnscan.errors import LaserStateUnknown
lasers = open_lasers(sys.argv[1])
lasers.light(frozenset({"left"}), 2.0)
print("lit", flush=True)
sys.stdin.readline()
try:
    lasers.close()
except LaserStateUnknown as e:
    print(e, flush=True)
"""


def test_the_person_is_told_and_the_guard_goes_on_after_the_scanner_has_ended() -> None:
    with Socket(firmware("grbl"), scale=faults.SCALE) as socket:
        child = subprocess.Popen(
            [sys.executable, "-c", SCANNER, f"grbl:{socket.path}?lasers=left"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        assert child.stdout is not None
        assert child.stdout.readline() == b"lit\n"
        socket.firmware._deaf_until = math.inf
        # The pipes end with the scanner: the guard, which goes on, keeps nobody waiting.
        said, warned = child.communicate(b"\n", timeout=20.0)
        assert b"cut the power" in said
        assert b"turnscan keeps trying for 10 minutes" in said
        assert b"the laser may be lit" in warned
        assert socket.firmware.lit
        begin = time.monotonic()
        socket.firmware._deaf_until = 0.0
        assert dark_since(socket, begin, 6.0).seconds < 2.5
        # Without a port it would go on for ten minutes.
        assert no_guard_left([socket.path])


def test_a_silent_board_may_be_lit_from_before(monkeypatch: pytest.MonkeyPatch) -> None:
    """Scanner and guard were killed together, and the board hears nothing."""
    with lit("grbl") as (device, socket):
        socket.firmware._deaf_until = math.inf
        monkeypatch.setattr(GuardedLink, "_rescue", lambda self: None)
        os.kill(device._link.guard_pid, signal.SIGKILL)
        until(device._link._ended.is_set)
        with pytest.raises(DeviceTimeout, match="may still be lit: cut its power"):
            board(f"grbl:{socket.path}", deadlines=QUICK)
        assert socket.firmware.lit


def test_a_guard_that_keeps_trying_gives_way_to_the_next_scan() -> None:
    with lit("grbl") as (device, socket):
        socket.firmware._deaf_until = math.inf
        with pytest.raises(LaserStateUnknown):
            device.close()
        until(lambda: device._link._keeps_trying.is_set())
        with pytest.raises(TurnscanError) as met:  # it gets the port, and meets the deaf board
            board(f"grbl:{socket.path}", deadlines=QUICK)
        assert "in use" not in str(met.value)
        socket.firmware._deaf_until = 0.0
        until(lambda: not socket.firmware.lit)
        board(f"grbl:{socket.path}", deadlines=QUICK).close()


def go_on(device: Any) -> None:
    """With the work, until something ends it."""
    while True:
        device.light(frozenset({"right"}), 2.0)


@pytest.mark.parametrize("pause", [0.0, 1.0])
def test_a_door_has_one_outcome_wherever_its_message_is_cut(pause: float) -> None:
    """Always the interlock, also where its end comes before the answer to the next order."""
    message = b"[MSG:Check Door]\r\n"
    with lit("grbl") as (device, socket):
        for cut in range(1, len(message)):
            socket.firmware.say(message[:cut])
            until(lambda: not socket.firmware._out)
            socket.firmware.say(message[cut:], pause)
            with pytest.raises(InterlockOpen):
                go_on(device)
            assert not socket.firmware.lit
            with pytest.raises(DeviceAlarm, match="door"):
                device.light(frozenset({"left"}), 2.0)
            device.acknowledge()
            device.light(frozenset({"left"}), 2.0)


def test_signals_that_were_ignored_or_blocked_end_the_guard_all_the_same() -> None:
    """As under ``nohup``, or from a program that blocks what it does not want to hear."""
    old = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM})
    try:
        assert faults.guard_terminated("grbl").seconds < 1.5  # the lease is 2 s
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
        signal.signal(signal.SIGTERM, old)


# Left out in turn.


@pytest.fixture
def guard_is(mutant: Mutant, monkeypatch: pytest.MonkeyPatch) -> Callable[[str, str], None]:
    """Let every guard have a defect."""

    def make(old: str, new: str) -> None:
        script, inner = mutant(old, new), GuardedLink.__init__
        monkeypatch.setattr(
            GuardedLink, "__init__", lambda self, *a, **k: inner(self, *a, **k, script=script)
        )

    return make


REPEATS = "self._again = 0.0 if self._sure else time.monotonic() + AGAIN"
LINGERS = "end = begin + (max(self._set.keep_trying, _SOON) if self._maybe else _SOON)"


@pytest.mark.parametrize(
    ("old", "new", "case", "then"),
    [
        (REPEATS, "self._again = 0.0", faults.board_deaf, "_watch"),
        (LINGERS, "end = begin + _SOON", faults.cable_out, "_see_off"),
        ("(self._tail + data)[-256:]", "data", faults.door_in_two_parts, ""),
        ("(self._tail + data)[-256:]", "data", faults.alarm_in_two_parts, ""),
    ],
    ids=["repeats no dark", "leaves", "hears no parts of the door", "nor of an alarm"],
)  # fmt: skip
def test_a_guard_with_a_defect_is_found(
    old: str, new: str, case: Callable[[str], faults.Span], then: str,
    guard_is: Callable[[str, str], None], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Without the scanner's protection (``then``), which would step in for it."""
    guard_is(old, new)
    if then:
        monkeypatch.setattr(GuardedLink, then, blind)
    assert case("grbl").seconds > next(c for c in faults.CASES if c.run is case).limit


def blind(link: GuardedLink) -> None:
    """Of how its guard ends."""
    link._guard.wait(timeout=30.0)


def test_a_guard_that_leaves_signals_as_they_were_is_found(
    guard_is: Callable[[str, str], None],
) -> None:
    guard_is("signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})", "pass")
    with pytest.raises(AssertionError):
        test_signals_that_were_ignored_or_blocked_end_the_guard_all_the_same()


def test_a_link_that_does_not_watch_its_guard_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(GuardedLink, "_watch", lambda self: None)
    assert faults.guard_stopped("grbl").seconds == math.inf


def test_a_link_that_believes_any_end_of_its_guard_is_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(GuardedLink, "_see_off", blind)
    assert faults.guard_killed_while_closing("grbl").seconds == math.inf


def test_a_wait_that_counts_as_a_sign_of_life_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_validated_camera, "_SHORT", 0.0)
    monkeypatch.setattr(_validated_camera, "_EXPOSURES", 1000.0)
    assert faults.camera_hangs("grbl").seconds > 2.1
