"""Memory that is no longer used: when it is looked for, and that it goes back to the system."""

from __future__ import annotations

import ctypes
import gc
from collections.abc import Callable
from functools import cache

_ARENA_MAX = -8
"""The number of that option in glibc's malloc.h; others refuse it or know it not."""


def give_back() -> None:
    """Have the allocator return what was freed, where it can (glibc); elsewhere nothing happens.

    It keeps freed arrays of up to 32 MB for each thread that made some: after a stage of a large
    scan that is as much as all that is still used.
    """
    trim = _of_libc("malloc_trim")
    if trim is not None:
        trim(0)


def seldom_look_for_garbage() -> None:
    """Have Python search for cycles of unused objects after 10 000 new ones, not after 700.

    While modules are loaded and kernels compiled all of them are in use: the searches find nothing,
    and take a tenth of the time.
    """
    gc.set_threshold(10_000, 20, 20)


def share_pools(pools: int = 2) -> bool:
    """Have all threads take memory from so few pools, before there are more; whether that is done.

    The allocator (glibc) has up to eight for each core otherwise, each with its own freed and held
    pieces: with many threads they are hundreds of MB.
    """
    option = _of_libc("mallopt")
    return option is not None and option(_ARENA_MAX, pools) == 1


@cache
def _of_libc(name: str) -> Callable[..., int] | None:
    """A function of the C library; None where there is none, or no library that could be asked."""
    try:
        function: Callable[..., int] | None = getattr(ctypes.CDLL(None), name, None)
    except (OSError, TypeError):
        return None
    return function
