"""A copy of a scan file has what was committed, also while the file is open."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.web.running import small_scan
from turnscan.errors import FormatError, InputError
from turnscan.scan import Scan, copy_scan


def test_an_open_scan_is_copied_with_its_last_edit(tmp_path: Path) -> None:
    source, target = small_scan(tmp_path / "a.turnscan", steps=2), tmp_path / "b.turnscan"
    with Scan.resume(source) as scan:
        scan.append_edit('{"kind": "none"}', 5.0)
        frames = len(scan)
        copy_scan(source, target)
    with Scan.open(target) as copy:
        assert [e.text for e in copy.edits()] == ['{"kind": "none"}']
        assert len(copy) == frames
        assert all(trouble is None for _, trouble in copy.verify())
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.turnscan", "b.turnscan"]
    with pytest.raises(InputError, match="exists"):
        copy_scan(source, target)


def test_what_is_no_scan_is_not_copied(tmp_path: Path) -> None:
    source = tmp_path / "a.turnscan"
    source.write_bytes(b"not a scan")
    with pytest.raises(FormatError):
        copy_scan(source, tmp_path / "b.turnscan")
    assert list(tmp_path.iterdir()) == [source]
