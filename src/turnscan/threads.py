"""How many threads share the work of one process."""

from __future__ import annotations

import os

VARIABLE = "TURNSCAN_THREADS"
"""Environment variable that says it; results do not depend on it."""


_ALGEBRA = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def single_threaded_algebra() -> None:
    """Linear algebra in one thread, unless the environment says otherwise; before NumPy is loaded.

    Matrices here are small: several threads wait for each other for longer than they work, all the
    more where other programs run, and their sums would depend on how many processors there are.
    """
    for name in _ALGEBRA:
        os.environ.setdefault(name, "1")


def thread_count() -> int:
    """Threads to share work among: what the environment says, else one for each processor."""
    told = os.environ.get(VARIABLE, "")
    if told.isdecimal() and int(told) > 0:
        return int(told)
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
