"""Who steps in for lasers, whatever goes wrong in it: nothing that fails ends the trying."""

from __future__ import annotations

import math
import os
import subprocess
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from tests.safety.conftest import Metronome
from tests.safety.faults import dark_since, lit, until
from turnscan.devices._link import GuardedLink
from turnscan.errors import LaserStateUnknown, SafetyError
from turnscan.simulate.controllers import Socket


def has_open(process: int, socket: Socket) -> bool:
    """Whether that process has the port open."""
    port = os.path.realpath(socket.path)
    for number in Path(f"/proc/{process}/fd").iterdir():
        with suppress(OSError):
            if os.readlink(number) == port and Path(socket.path).exists():
                return True
    return False


def test_a_cable_that_comes_loose_six_times() -> None:
    """The guard keeps trying each time, and the scanner does not lose track of it."""
    with lit("grbl") as (device, socket):
        link, board = device._link, socket.firmware
        board._deaf_until = math.inf
        for _ in range(6):
            until(lambda: has_open(link.guard_pid, socket))
            board.unplug(0.2, powered=True)
            until(lambda: not Path(socket.path).exists())
            until(lambda: Path(socket.path).exists())
        until(lambda: has_open(link.guard_pid, socket))
        assert link._listener.is_alive()
        with pytest.raises(LaserStateUnknown, match="keeps trying"):
            device.off()
        assert board.lit
        begin = time.monotonic()
        board._deaf_until = 0.0
        assert dark_since(socket, begin, 20.0).seconds < 15.0
        until(lambda: not link._maybe_lit.is_set())


@pytest.mark.parametrize("error", [RuntimeError, KeyError, ValueError])
def test_a_listener_that_fails_steps_in(
    error: type[Exception], monkeypatch: pytest.MonkeyPatch, metronome: Metronome
) -> None:
    with lit("grbl") as (device, socket):

        def fail(self: GuardedLink, kind: bytes, payload: bytes) -> None:
            raise error("a mistake")

        monkeypatch.setattr(GuardedLink, "_take", fail)
        begin = time.monotonic()
        span = dark_since(socket, begin, 20.0)
        assert metronome.served(span.begin, span.dark) < 1.5
        until(device._link._ended.is_set)
        with pytest.raises(SafetyError, match="guard died"):
            device.light(frozenset({"left"}), 1.0)


def test_a_guard_that_cannot_be_killed_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """It holds the port, so nobody can darken: then whoever waits hears of it, and soon."""
    with lit("grbl") as (device, socket):
        link = device._link
        guard: Any = link._guard

        def wait(timeout: float | None = None) -> int:
            raise subprocess.TimeoutExpired("guard", timeout or 0.0)

        with monkeypatch.context() as patch:
            patch.setattr(guard, "wait", wait)
            patch.setattr(guard, "kill", lambda: None)
            link._take = lambda *_: 1 / 0
            until(link._ended.is_set)
            assert link._failure is not None
        until(lambda: not socket.firmware.lit)  # its lease, at the latest


def test_to_step_in_may_fail_and_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    with lit("grbl") as (device, _):
        monkeypatch.setattr(GuardedLink, "_rescue", lambda self: 1 / 0)
        os.kill(device._link.guard_pid, 9)
        until(device._link._ended.is_set)
        with pytest.raises(SafetyError, match="to step in for it failed"):
            device.move_to(0.1, 1.0)
