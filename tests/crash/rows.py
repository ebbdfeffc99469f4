"""What a scan file holds, as bytes."""

from __future__ import annotations

from pathlib import Path

from turnscan.scan import Scan


def rows_of(path: Path) -> list[tuple[bytes, bytes]]:
    """Everything stored, to the byte, each with its digest."""
    with Scan.open(path) as scan:
        assert [trouble for _, trouble in scan.verify() if trouble] == []
        return [(s.row.digest(), s.payload) for s in scan.stored()]
