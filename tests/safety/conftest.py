"""A forking scanner, a plugged-in board of each dialect, and guards with a defect."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.devices.guards import mutated
from tests.metronome import Metronome, metronome
from tests.safety.faults import DIALECTS, SCALE, firmware
from turnscan.simulate.controllers import Socket

__all__ = ["metronome"]


@dataclass
class Ending:
    """How a scan ended, seen from the board."""

    lit: bool
    """Whether a laser burned when the end began."""
    seconds: float
    """From the end's beginning to dark; 0 where it was dark, inf where it stayed lit."""
    served: float
    """The same, without the time in which this machine had no processor to spare."""


def no_guard_left(ports: list[str]) -> bool:
    """Whether within 30 s no process holds one of these ports any more."""
    end = time.monotonic() + 30.0
    while time.monotonic() < end:
        lines = []
        for process in Path("/proc").glob("[0-9]*/cmdline"):
            with suppress(OSError):
                lines.append(process.read_bytes())
        if not any(
            port.encode() in line and b"_guard.py" in line for line in lines for port in ports
        ):
            return True
        time.sleep(0.02)
    return False


class Scanner:
    """The forking scanner, driven from outside."""

    def __init__(self, metronome: Metronome) -> None:
        self._metronome = metronome
        self._process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("scanner.py"))],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip

    def close(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait(timeout=10.0)
        self._process.stdout.close()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        return json.loads(self._process.stdout.readline())  # type: ignore[no-any-return]

    def _begin(self, address: str, order: dict[str, Any]) -> dict[str, Any]:
        """Let a child scan up to its moment, or to its end: what it told."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"address": address, **order}) + "\n")
        self._process.stdin.flush()
        told: dict[str, Any] = {"pid": 0, "now": None, "done": False, "error": ""}
        while told["now"] is None and not told["done"]:
            told |= self._answer()
        return told

    def end(self, socket: Socket, dialect: str, patience: float = 2.5, **order: Any) -> Ending:
        """Let a child scan and end; watch the board's own log, then see that it stays dark."""
        address = f"{dialect}:{socket.path}?lasers=a,b"
        for _ in range(3):  # on a busy machine a deadline may pass before the moment comes
            assert no_guard_left([socket.path])
            told = self._begin(address, order)
            if told["now"] is not None:
                break
        now, pid, done = told["now"], told["pid"], told["done"]
        assert now is not None, f"the moment did not come {told['error']}"
        log = socket.firmware.log
        try:
            while time.monotonic() < now + patience and log[-1].outputs:
                time.sleep(0.002)
            lit_all_along = bool(log[-1].outputs)  # the frozen process is ended below: its link too
            while not done and not pid:
                answer = self._answer()
                pid, done = answer.get("pid", pid), answer.get("done", done)
            if order["how"] in ("SIGSTOP", "deadlock", "GIL"):
                time.sleep(0.02)
                os.kill(pid, signal.SIGKILL)
            while not done:
                done = self._answer().get("done", False)
        finally:
            entries = [entry for entry in log if entry.time <= now]
        burning = bool(entries[-1].outputs)
        if lit_all_along:
            return Ending(burning, float("inf"), float("inf"))
        end = max(now, log[-1].time)
        return Ending(burning, end - now, self._metronome.served(now, end))


@pytest.fixture(scope="module")
def scanner(metronome: Metronome) -> Iterator[Scanner]:
    it = Scanner(metronome)
    yield it
    it.close()


@pytest.fixture
def sockets() -> Iterator[dict[str, Socket]]:
    with ExitStack() as stack:
        yield {d: stack.enter_context(Socket(firmware(d), scale=SCALE)) for d in DIALECTS}


@pytest.fixture
def mutant(tmp_path: Path) -> Callable[..., Path]:
    """A guard with a defect: its sources with one passage replaced."""

    return lambda old, new: mutated(tmp_path, old, new)
