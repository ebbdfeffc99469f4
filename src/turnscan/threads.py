"""How many threads share the work of one process."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Result = TypeVar("Result")

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


def in_parts(
    work: Callable[[int, int], Result], count: int, parts: int | None = None
) -> list[Result]:
    """What ``work(first, end)`` gives for each of some parts of ``count`` things, in their order.

    The threads share the parts: as many as there are threads where ``parts`` is None. Worth it for
    work that lets go of Python's lock. Where results depend on the parts, give their number.
    """
    threads = thread_count()
    parts = max(1, min(parts or threads, count))
    bounds = [count * k // parts for k in range(parts + 1)]
    if min(threads, parts) == 1:
        return [work(a, b) for a, b in itertools.pairwise(bounds)]
    with ThreadPoolExecutor(min(threads, parts)) as pool:
        return list(pool.map(work, bounds[:-1], bounds[1:]))
