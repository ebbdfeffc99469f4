"""One server and one scan for all tests that leave them as they were."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.metronome import metronome
from tests.once import once
from tests.web.running import Running, serving, small_scan

__all__ = ["metronome"]


@pytest.fixture(scope="session")
def scan_bytes(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A small scan file, taken once."""
    made = once(tmp_path_factory, "web-ball", lambda folder: small_scan(folder / "ball.turnscan"))
    return (made / "ball.turnscan").read_bytes()


@pytest.fixture
def folder(tmp_path: Path, scan_bytes: bytes) -> Path:
    """A folder with one scan in it."""
    (tmp_path / "ball.turnscan").write_bytes(scan_bytes)
    return tmp_path


@pytest.fixture
def server(folder: Path) -> Iterator[Running]:
    """A server of one's own."""
    with serving(folder) as running:
        yield running
