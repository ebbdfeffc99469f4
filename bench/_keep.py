"""The folder of a benchmark's simulated scans."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def folder(keep: Path | None) -> Iterator[Path]:
    """The folder ``keep``, made where it is not there; without one, one that goes again."""
    if keep is not None:
        keep.mkdir(parents=True, exist_ok=True)
        yield keep
        return
    with tempfile.TemporaryDirectory() as scratch:
        yield Path(scratch)
