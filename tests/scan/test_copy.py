"""A scan file is copied whole while it is open, and renamed only while nobody writes it."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.web.running import small_scan
from turnscan.errors import FormatError, InputError, ScanBusy
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


def test_a_scan_is_moved_with_its_last_edit_over_no_other_and_never_while_it_is_written(
    tmp_path: Path,
) -> None:
    source, target = small_scan(tmp_path / "a.turnscan", steps=2), tmp_path / "b.turnscan"
    left, junk = tmp_path / "left.turnscan", tmp_path / "junk.turnscan"
    with Scan.resume(source) as scan:
        scan.append_edit('{"kind": "none"}', 5.0)
        for tail in ("", "-wal"):  # as a process leaves them that is killed
            held = source.with_name(source.name + tail)
            left.with_name(left.name + tail).write_bytes(held.read_bytes())
        with pytest.raises(ScanBusy):
            copy_scan(source, target, keep=False)
        assert not target.exists()
    junk.write_bytes(b"not a scan")
    for taken in (left, junk):
        with pytest.raises(InputError, match="exists"):
            copy_scan(source, taken, keep=False)
    copy_scan(left, target, keep=False)
    with Scan.open(target) as moved, Scan.open(source) as kept:
        assert [e.text for e in moved.edits()] == ['{"kind": "none"}']
        assert moved.digest == kept.digest
        assert all(trouble is None for _, trouble in moved.verify())
    copy_scan(junk, tmp_path / "bin.turnscan", keep=False)
    assert (tmp_path / "bin.turnscan").read_bytes() == b"not a scan"
    names = ["a.turnscan", "b.turnscan", "bin.turnscan"]
    assert sorted(p.name for p in tmp_path.iterdir()) == names


@pytest.mark.parametrize("keep", [True, False])
def test_a_file_that_has_gone_is_called_so_and_nothing_is_left(tmp_path: Path, keep: bool) -> None:
    with pytest.raises(InputError, match="no such scan file"):
        copy_scan(tmp_path / "gone.turnscan", tmp_path / "new.turnscan", keep=keep)
    assert list(tmp_path.iterdir()) == []
