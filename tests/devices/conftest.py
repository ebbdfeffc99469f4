"""What the tests of real drivers need, and when they may do without it."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.metronome import metronome
from tests.needs import needs

__all__ = ["metronome"]


@pytest.fixture
def aravis() -> Iterator[None]:
    """Needs Aravis; one test at a time has the network.

    The tests run in several processes, and all served cameras have the one loopback address.
    """
    import fcntl

    needs("Aravis")
    with (Path(tempfile.gettempdir()) / "turnscan-test-gige.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
