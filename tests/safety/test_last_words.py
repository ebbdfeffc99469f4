"""What a guard that is no longer needed says to the person is said, to its last word."""

from __future__ import annotations

import contextlib
import json
import math
import os
import pty
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.safety.conftest import no_guard_left
from tests.safety.faults import SCALE, firmware, until
from turnscan.devices._guard_client import GUARD_SCRIPT
from turnscan.simulate.controllers import Socket

BEGIN, DARK, GIVEN_UP = b"keeps trying to reach it", b"the laser is dark", b"given up"


def settings(port: str, keep_trying: float, scanner: int) -> str:
    """Of a guard that takes over from one that died."""
    return json.dumps({
        "port": port, "dialect": "grbl", "outputs": ["m3:1000"], "baud": 115200, "dtr": False,
        "connect": 1.0, "confirm": 0.05, "library": "", "keep_trying": keep_trying, "rescue": True,
        "scanner": scanner,
    })  # fmt: skip


def rescuer(port: str, keep_trying: float, errors: int) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-I", str(GUARD_SCRIPT), settings(port, keep_trying, os.getpid())],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=errors,
    )  # fmt: skip


def said_by(guard: subprocess.Popen[bytes], terminal: int) -> bytes:
    """All that it said, once it has ended."""
    said = bytearray()
    with contextlib.suppress(OSError):  # of a terminal that nobody has open any more
        while data := os.read(terminal, 4096):
            said += data
    os.close(terminal)
    guard.wait(60.0)
    return bytes(said)


def test_that_it_gives_up_is_said_each_time(tmp_path: Path) -> None:
    """Twenty at once, so that the machine is busy: the port never comes back."""
    guards = []
    for k in range(20):
        ours, theirs = pty.openpty()
        guards.append((rescuer(str(tmp_path / f"nothing{k}"), 1.0, theirs), ours))
        os.close(theirs)
    said = [said_by(guard, ours) for guard, ours in guards]
    assert [(BEGIN in text, GIVEN_UP in text) for text in said] == [(True, True)] * 20
    assert {guard.returncode for guard, _ in guards} == {4}


def to_a_file(folder: Path, act: Callable[[], None]) -> bytes:
    with (folder / "said").open("wb+") as file:
        return _said(file.fileno(), lambda: (folder / "said").read_bytes(), act)


def to_a_pipe(folder: Path, act: Callable[[], None]) -> bytes:
    ours, theirs = os.pipe()
    said = bytearray()

    def listen() -> None:
        while data := os.read(ours, 4096):
            said.extend(data)

    threading.Thread(target=listen, daemon=True).start()
    try:
        return _said(theirs, lambda: bytes(said), act)
    finally:
        os.close(theirs)


SOCKETS: list[Socket] = []


def _said(errors: int, said: Callable[[], bytes], act: Callable[[], None]) -> bytes:
    guard = rescuer(SOCKETS[-1].path, 20.0, errors)
    until(lambda: BEGIN in said())
    act()
    guard.wait(60.0)
    until(lambda: said().count(b"\n") == 2, 5.0)
    return said()


@pytest.mark.parametrize("where", [to_a_file, to_a_pipe])
def test_a_second_message_is_not_lost(
    where: Callable[[Path, Callable[[], None]], bytes], tmp_path: Path
) -> None:
    with Socket(firmware("grbl"), scale=SCALE) as socket:
        SOCKETS.append(socket)
        socket.firmware._deaf_until = math.inf

        def hear() -> None:
            socket.firmware._deaf_until = 0.0

        assert DARK in where(tmp_path, hear)


STARTER = """
import subprocess, sys
subprocess.Popen([sys.executable, "-I", *sys.argv[1:]], stdin=subprocess.DEVNULL,
                 stdout=subprocess.DEVNULL)
"""


def test_who_reads_the_scanners_messages_does_not_wait_for_a_guard_that_goes_on() -> None:
    """Also where the scanner has ended before that guard began."""
    with Socket(firmware("grbl"), scale=SCALE) as socket:
        socket.firmware._deaf_until = math.inf
        child = subprocess.Popen(
            [
                sys.executable,
                "-c",
                STARTER,
                str(GUARD_SCRIPT),
                settings(socket.path, 30.0, os.getpid()),
            ],
            stderr=subprocess.PIPE,
        )
        _, said = child.communicate(timeout=20.0)
        assert BEGIN in said
        socket.firmware._deaf_until = 0.0
        assert no_guard_left([socket.path])
