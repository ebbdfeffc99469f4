"""What the tests of real drivers need, and when they may do without it."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from turnscan.devices import aravis_library

Need = Callable[[Callable[[], object]], None]


@pytest.fixture(scope="session")
def need() -> Need:
    """``need(load)``: skip the test where ``load()`` says that something is missing; fail in CI."""

    def check(load: Callable[[], object]) -> None:
        try:
            load()
        except (ImportError, OSError, ValueError) as e:
            if os.environ.get("CI", "").lower() in ("1", "true"):
                pytest.fail(f"CI runs every driver's tests, but: {e}")
            pytest.skip(str(e))

    return check


@pytest.fixture
def aravis(need: Need) -> Iterator[None]:
    """Skip where Aravis is missing (`make system` installs it); one test at a time has the network.

    The tests run in several processes, and all served cameras have the one loopback address.
    """
    import fcntl

    need(aravis_library)
    with (Path(tempfile.gettempdir()) / "turnscan-test-gige.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
