"""S1, S2: however the scanner ends, the board's own log says dark: at once, or with the lease."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from tests.safety.conftest import DIALECTS, Scanner
from turnscan.simulate.controllers import Socket

MOMENTS = 20
SUDDEN = (
    "exception", "MemoryError", "sys.exit", "_exit", "SIGINT", "SIGINT x2", "SIGINT x3",
    "SIGTERM", "SIGHUP", "SIGKILL", "SIGSEGV", "SIGABRT",
)  # fmt: skip
HANGING = ("SIGSTOP", "deadlock", "GIL")
LEASE = 0.15


def _moments(k: int) -> tuple[str, int]:
    """Dialects take turns; moments spread over connecting, moving, lighting and exposing."""
    return DIALECTS[k % 4], 1 + 2 * k


def no_guard_left(ports: list[str]) -> bool:
    """Whether within 2 s no process holds one of these ports any more."""
    end = time.monotonic() + 2.0
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


@pytest.mark.parametrize("how", SUDDEN)
def test_dark_at_once(how: str, scanner: Scanner, sockets: dict[str, Socket]) -> None:
    endings = []
    for k in range(MOMENTS):
        dialect, moment = _moments(k)
        endings.append(scanner.end(sockets[dialect], dialect, how=how, moment=moment))
    seconds = sorted(e.seconds for e in endings)
    lit = sum(e.lit for e in endings)
    print(f"{how}: {len(endings)} ends, {lit} lit; dark after {seconds[-1] * 1e3:.0f} ms at worst")
    assert lit >= MOMENTS / 3
    assert seconds[-2] < 0.1, seconds
    assert seconds[-1] < 0.5, seconds  # one in twenty may meet a busy machine
    assert no_guard_left([socket.path for socket in sockets.values()])


@pytest.mark.parametrize("how", HANGING)
def test_dark_with_the_lease(how: str, scanner: Scanner, sockets: dict[str, Socket]) -> None:
    endings = []
    for k in range(MOMENTS):
        dialect, moment = _moments(k)
        endings.append(
            scanner.end(sockets[dialect], dialect, how=how, moment=moment, lease=LEASE, pulse=LEASE)
        )
    seconds = sorted(e.seconds for e in endings)
    assert sum(e.lit for e in endings) >= MOMENTS / 3
    assert seconds[-2] < LEASE + 0.1, seconds
    assert seconds[-1] < LEASE + 0.5, seconds


def test_by_default_a_stopped_scanner_is_dark_in_two_seconds(
    scanner: Scanner, sockets: dict[str, Socket]
) -> None:
    ending = scanner.end(
        sockets["grbl"], "grbl", patience=4.0, how="SIGSTOP", moment="lit",
        lease=60.0,
    )  # fmt: skip
    assert ending.lit
    assert 0.5 < ending.seconds < 2.1


@pytest.mark.parametrize("how", SUDDEN)
def test_dark_while_connecting(how: str, scanner: Scanner, sockets: dict[str, Socket]) -> None:
    for k, dialect in enumerate(DIALECTS):
        ending = scanner.end(
            sockets[dialect], dialect, how=how, moment=1 + k, while_connecting=True
        )
        assert not ending.lit
        assert ending.seconds == 0.0


@pytest.mark.parametrize(
    ("how", "old", "new"),
    [
        # A guard that just leaves.
        ("SIGKILL", "        if self._port is not None:\n            self._dark(0, DONE)\n", ""),
        # One that counts neither lease nor pulse.
        ("SIGSTOP", "            if self._lit and time.monotonic() >= min(", "            if min("),
    ],
)
def test_without_the_protection_it_stays_lit(
    how: str, old: str, new: str,
    scanner: Scanner, sockets: dict[str, Socket], mutant: Callable[..., Path],
) -> None:  # fmt: skip
    if how == "SIGSTOP":
        new = "            if False and self._lit and time.monotonic() >= min("
    script = mutant(old, new)
    ending = scanner.end(
        sockets["grbl"], "grbl", how=how, moment="lit", lease=LEASE,
        pulse=LEASE, script=str(script), patience=0.8,
    )  # fmt: skip
    assert ending.lit
    assert ending.seconds == float("inf")
