"""Time in which this machine served a process: a deadline can be strict on a busy machine."""

from __future__ import annotations

import os
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
_LOAD = Path("/proc/loadavg")


class Metronome(threading.Thread):
    """Asks for a processor every 2 ms, and notes how much later it gets one and who else wants it.

    So a deadline can be strict on a busy machine: what is judged is the time in which it served.
    Of four that want two processors, each is served half of the time.
    """

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.lost: deque[tuple[float, float, float]] = deque(maxlen=20_000)
        """From, to, and the share of it in which a process was not served."""
        self.over = False

    def run(self) -> None:
        load = os.open(_LOAD, os.O_RDONLY) if _LOAD.exists() else -1
        try:
            self._beat(load)
        finally:
            if load >= 0:
                os.close(load)

    def _beat(self, load: int) -> None:
        before = time.monotonic()
        while not self.over:
            time.sleep(0.002)
            woken = max(before, min(before + 0.002, time.monotonic()))
            now = time.monotonic()
            self.lost.append((before, woken, 1.0 - min(1.0, CORES / max(1, _wanting(load)))))
            self.lost.append((woken, now, 1.0 if now > woken + 0.001 else 0.0))
            before = now

    def served(self, begin: float, end: float) -> float:
        """s between two times, without those in which nothing could run."""
        return self._without(begin, end, 0.0)

    def awake(self, begin: float, end: float) -> float:
        """s between two times, without those in which this process itself stood still."""
        return self._without(begin, end, 1.0)

    def _without(self, begin: float, end: float, least: float) -> float:
        if end == float("inf"):
            return end
        lost = sum(
            w * max(0.0, min(b, end) - max(a, begin)) for a, b, w in list(self.lost) if w >= least
        )
        return max(0.0, end - begin - lost)


def _wanting(load: int) -> int:
    """How many threads of this machine run or could, but for the one that asks."""
    with suppress(OSError):
        return int(os.pread(load, 80, 0).split()[3].partition(b"/")[0]) - 1
    return 0


@pytest.fixture(scope="module")
def metronome() -> Iterator[Metronome]:
    """For one module: five hundred times a second is not for nothing."""
    it = Metronome()
    it.start()
    yield it
    it.over = True
    it.join()
