"""Memory that is no longer used goes back to the system."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache


def give_back() -> None:
    """Have the allocator return what was freed, where it can (glibc); elsewhere nothing happens.

    It keeps freed arrays of up to 32 MB for each thread that made some: after a stage of a large
    scan that is as much as all that is still used.
    """
    trim = _trim()
    if trim is not None:
        trim(0)


@cache
def _trim() -> Callable[[int], int] | None:
    try:
        trim: Callable[[int], int] | None = getattr(ctypes.CDLL(None), "malloc_trim", None)
    except (OSError, TypeError):  # no library that could be asked
        return None
    return trim
