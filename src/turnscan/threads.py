"""How many threads share the work of one process."""

from __future__ import annotations

import os

VARIABLE = "TURNSCAN_THREADS"
"""Environment variable that says it; results do not depend on it."""


def thread_count() -> int:
    """Threads to share work among: what the environment says, else one for each processor."""
    told = os.environ.get(VARIABLE, "")
    if told.isdecimal() and int(told) > 0:
        return int(told)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
