"""S1, S2: however the scanner ends, the board's own log says dark: at once, or with the lease."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.safety.conftest import Ending, Scanner, no_guard_left
from tests.safety.faults import DIALECTS
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


def in_time(scanner: Scanner, socket: Socket, dialect: str, limit: float, **order: Any) -> Ending:
    """An ending within the limit, each time, by the time in which the machine served."""
    ending = scanner.end(socket, dialect, **order)
    assert ending.seconds < limit + 1.4, (dialect, order, ending)  # before a lease of 2 s ends
    assert ending.served < limit, (dialect, order, ending)
    return ending


def ended(scanner: Scanner, sockets: dict[str, Socket], limit: float, **order: Any) -> list[Ending]:
    """Twenty moments, each in time."""
    endings = []
    for k in range(MOMENTS):
        dialect, moment = _moments(k)
        endings.append(in_time(scanner, sockets[dialect], dialect, limit, moment=moment, **order))
    lit = sum(e.lit for e in endings)
    worst = max(e.seconds for e in endings)
    print(f"{len(endings)} ends, {lit} lit; dark after {worst * 1e3:.0f} ms at worst")
    assert lit >= MOMENTS / 3
    return endings


@pytest.mark.parametrize("how", SUDDEN)
def test_dark_at_once(how: str, scanner: Scanner, sockets: dict[str, Socket]) -> None:
    ended(scanner, sockets, 0.1, how=how)
    assert no_guard_left([socket.path for socket in sockets.values()])


@pytest.mark.parametrize("how", HANGING)
def test_dark_with_the_lease(how: str, scanner: Scanner, sockets: dict[str, Socket]) -> None:
    ended(scanner, sockets, LEASE + 0.1, how=how, lease=LEASE)


def test_by_default_a_stopped_scanner_is_dark_in_two_seconds(
    scanner: Scanner, sockets: dict[str, Socket]
) -> None:
    ending = in_time(
        scanner, sockets["grbl"], "grbl", 2.1, patience=6.0, how="SIGSTOP", moment="lit", lease=2.0
    )
    assert ending.lit
    assert ending.seconds > 0.5


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
        (
            "SIGKILL",
            "                self._act(*event)\n        return self.last_word()",
            "                self._act(*event)\n        return 0",
        ),
        # One that counts no lease.
        ("SIGSTOP", "if self._lit and now >= self._lease_end:", "if False:"),
    ],
    ids=["SIGKILL", "SIGSTOP"],
)
def test_without_the_protection_it_stays_lit(
    how: str, old: str, new: str,
    scanner: Scanner, sockets: dict[str, Socket], mutant: Callable[..., Path],
) -> None:  # fmt: skip
    script = mutant(old, new)
    ending = scanner.end(
        sockets["grbl"], "grbl", how=how, moment="lit", lease=LEASE,
        script=str(script), patience=0.8,
    )  # fmt: skip
    assert ending.lit
    assert ending.seconds == float("inf")
