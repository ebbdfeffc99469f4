"""Who steps in for lasers, whatever goes wrong in it: nothing that fails ends the trying."""

from __future__ import annotations

import math
import os
import signal
import struct
import subprocess
import termios
import time
import tty
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from tests.devices.guards import mutated
from tests.metronome import Metronome
from tests.safety.faults import _pulled, dark_since, lit, until
from turnscan.devices import _guard, _guard_client
from turnscan.devices._dialects import foreign_as_oserror, open_port
from turnscan.devices._discover import probe_port
from turnscan.devices._guard import LAPSED
from turnscan.devices._guard_client import GuardedLink
from turnscan.errors import LaserStateUnknown, LeaseEnded, SafetyError, TurnscanError
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
        guard.kill()
        guard.wait(20.0)


def test_to_step_in_may_fail_and_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    with lit("grbl") as (device, _):
        monkeypatch.setattr(GuardedLink, "_rescue", lambda self: 1 / 0)
        os.kill(device._link.guard_pid, 9)
        until(device._link._ended.is_set)
        with pytest.raises(SafetyError, match="replacing it failed"):
            device.move_to(0.1, 1.0)


# Ports that hang up while they are opened or flushed


def test_a_port_that_hangs_up_raises_no_foreign_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """pyserial lets ``termios.error`` through, which is no OSError."""
    master, slave = os.openpty()
    tty.setraw(slave)
    path = os.ttyname(slave)
    os.close(slave)
    port = open_port(path, 115200, False)
    os.close(master)
    with pytest.raises(OSError, match="error: "), foreign_as_oserror():
        port.reset_input_buffer()
    port.close()
    master, slave = os.openpty()
    tty.setraw(slave)
    os.close(slave)

    def flush(*_: object) -> None:
        raise termios.error(5, "Input/output error")

    monkeypatch.setattr(termios, "tcflush", flush)
    with pytest.raises(OSError, match="Input/output"):
        open_port(os.ttyname(master), 115200, False)
    assert "Input/output" in probe_port(os.ttyname(master)).why_not
    os.close(master)


@pytest.mark.parametrize("error", [termios.error, OSError, RuntimeError])
def test_a_rescue_survives_whatever_a_port_raises(
    error: type[Exception], monkeypatch: pytest.MonkeyPatch, metronome: Metronome
) -> None:
    real, left = open_port, [3]

    def flaky(*port: Any) -> Any:
        left[0] -= 1
        if left[0] >= 0:
            raise error(5, "Input/output error")
        return real(*port)

    with lit("grbl") as (device, socket):
        monkeypatch.setattr(_guard, "open_port", flaky)
        begin = time.monotonic()
        os.kill(device._link.guard_pid, 9)
        span = dark_since(socket, begin, 20.0)
        assert metronome.served(span.begin, span.dark) < 1.0
        until(device._link._ended.is_set)
        assert left[0] < 0


FLAKY = """
    def open(self) -> Any:
        _OPENED.append(0)
        if len(_OPENED) in (2, 3, 4):
            raise RuntimeError("Input/output error")
"""


def test_a_guard_goes_on_whatever_a_port_raises(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The cable is out, the scanner has gone, and the port is not at once what it was."""
    old = "    def open(self) -> Any:\n"
    script = mutated(tmp_path, old, FLAKY)
    guard = tmp_path / "_guard.py"
    guard.write_text(
        guard.read_text().replace("_SOON = 1.0\n", "_SOON = 1.0\n_OPENED: list[int] = []\n")
    )
    monkeypatch.setattr(GuardedLink, "_rescue", lambda self: None)
    with lit("grbl", script=script) as (device, socket):
        _pulled(socket, 2.0)
        with suppress(TurnscanError):
            device.close()
        assert socket.firmware.lit
        until(Path(socket.path).exists)
        assert dark_since(socket, time.monotonic(), 20.0).seconds < 10.0
        assert device._link._guard.wait(20.0) == 0


@pytest.mark.parametrize("times", [1, 3])
def test_another_guard_that_does_not_start_is_tried_again(
    times: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The cable is out, the guard killed, and there is no memory for another."""
    real, left = GuardedLink._start_rescuer, [times]

    def start(self: GuardedLink) -> subprocess.Popen[bytes]:
        left[0] -= 1
        if left[0] >= 0:
            raise OSError(24, "Too many open files")
        return real(self)

    monkeypatch.setattr(_guard_client.GuardedLink, "_start_rescuer", start)
    with lit("grbl") as (device, socket):
        _pulled(socket, 4.5)
        os.kill(device._link.guard_pid, 9)
        until(device._link._ended.is_set)
        assert socket.firmware.lit
        until(Path(socket.path).exists)
        assert dark_since(socket, time.monotonic(), 20.0).seconds < 10.0
        until(lambda: not device._link._maybe_lit.is_set())


# What the link knows of its lasers, whichever frames cross


def by_itself(link: Any, result: int) -> None:
    """The guard tells of a dark that nobody had asked for."""
    link._take(b"A", struct.pack("<IBH", 0, result, 0))


def test_a_lapse_that_crosses_an_order_to_light(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is lit counts as lit, so that a guard that hangs is found."""
    with lit("sardauscan") as (device, socket):
        link = device._link
        real = link._frame

        def crossed(kind: bytes, payload: bytes = b"", darks: int | None = None) -> None:
            if kind == b"L":
                by_itself(link, LAPSED)
                assert link._maybe_lit.is_set()
            real(kind, payload, darks)

        monkeypatch.setattr(link, "_frame", crossed)
        with pytest.raises(LeaseEnded):  # which the driver answers by a dark
            link.light(0b10, 2.0)
        assert socket.firmware.lit == {"1"}
        assert link._maybe_lit.is_set()
        os.kill(link.guard_pid, signal.SIGSTOP)
        assert dark_since(socket, time.monotonic(), 20.0).seconds < 15.0


def test_a_lapse_after_an_order_to_light() -> None:
    with lit("sardauscan") as (device, _):
        link = device._link
        by_itself(link, LAPSED)
        assert not link._maybe_lit.is_set()
        link._lapsed = False
        device.light(frozenset({"left"}), 2.0)
        assert link._maybe_lit.is_set()
        device.off()
        assert not link._maybe_lit.is_set()
