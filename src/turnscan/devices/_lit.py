"""Lasers that burn while somebody needs them, and for two seconds at most when nobody does."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator

from turnscan.devices._guard import LONGEST_LEASE as LEASE
from turnscan.devices._guard import LONGEST_LIT
from turnscan.devices._protocols import Lasers
from turnscan.errors import TurnscanError

_RENEWED = LEASE / 4
"""s from one renewal to the next, so that a busy machine may miss two."""


@contextlib.contextmanager
def burning(lasers: Lasers, lit: frozenset[str], longest: float = LONGEST_LIT) -> Iterator[None]:
    """Exactly ``lit`` burns inside the block, and nothing after it; for ``longest`` s at most.

    A lease of 2 s is renewed as long as the block runs. A program that dies, hangs or is stopped
    renews nothing. Raises DeviceError and SafetyError as ``lasers`` do.
    """
    if not lit:
        yield
        return
    over = threading.Event()
    end = time.monotonic() + longest
    lasers.light(lit, min(LEASE, longest))
    keeper = threading.Thread(target=_renew, args=(lasers, over, end), daemon=True, name="lease")
    keeper.start()
    try:
        yield
    finally:
        over.set()
        lasers.light(frozenset(), LEASE)


def _renew(lasers: Lasers, over: threading.Event, end: float) -> None:
    """Never lights anything, so nothing has to wait for its end."""
    with contextlib.suppress(TurnscanError):  # the thread that lit them meets it, too
        while not over.wait(_RENEWED) and (left := end - time.monotonic()) > 0:
            lasers.renew(min(LEASE, left))
