"""Dear things that several tests only look at, made once in a run, whichever process needs them."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest


def once(
    factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object], wait: float = 600.0
) -> Path:
    """The folder ``name`` as ``make`` filled it; the first who asks makes it, the others wait.

    Processes of one run (pytest-xdist) share it; nobody may write there afterwards. Where the
    making fails, each who asks tries for itself and sees why.
    """
    top = factory.getbasetemp()
    shared = top.parent if "PYTEST_XDIST_WORKER" in os.environ else top
    folder, done, failed = (shared / f"{name}{tail}" for tail in ("", ".done", ".failed"))
    try:
        folder.mkdir()
    except FileExistsError:
        end = time.monotonic() + wait
        while not done.exists() and not failed.exists():
            assert time.monotonic() < end, f"{name}: not made within {wait:.0f} s"
            time.sleep(0.05)
        if failed.exists():
            own = factory.mktemp(name)
            make(own)
            return own
        return folder
    try:
        make(folder)
    except BaseException:
        failed.touch()
        raise
    done.touch()
    return folder
