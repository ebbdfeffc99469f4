"""The log of edits in a scan file: appended to, chained, and of no concern to the frames."""

from __future__ import annotations

import math
import shutil
import sqlite3
from pathlib import Path

import pytest

from tests.scan.small import write
from turnscan.errors import InputError, ScanBusy, ScanCorrupt
from turnscan.scan import Scan


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write(tmp_path / "a.turnscan")
    with Scan.resume(tmp_path / "a.turnscan") as scan:
        scan.append_edit('{"n":1}', 5.0)
        scan.append_edit('{"n":2}')
    return tmp_path / "a.turnscan"


def test_what_was_appended_is_there_and_the_frames_are_as_they_were(path: Path) -> None:
    with Scan.open(path) as scan:
        log = scan.edits()
        assert [(e.number, e.text) for e in log] == [(1, '{"n":1}'), (2, '{"n":2}')]
        assert log[0].time == 5.0
        assert math.isnan(log[1].time)
        assert scan.sealed
        assert scan.complete
        assert [t for _, t in scan.verify() if t] == []
    with Scan.resume(path) as scan:
        assert scan.append_edit("{}").number == 3
        assert scan.sealed, "an edit does not break the seal of the frames"
        assert len(scan.edits()) == 3
    assert [p.name for p in path.parent.iterdir()] == ["a.turnscan"]


def test_it_takes_the_writers_lock(path: Path) -> None:
    with Scan.open(path) as scan, pytest.raises(InputError, match="reading only"):
        scan.append_edit("{}")
    with Scan.resume(path) as scan, pytest.raises(ScanBusy):
        Scan.resume(path)
    with Scan.open(path) as scan:
        assert len(scan.edits()) == 2


@pytest.mark.parametrize(
    ("sql", "words"),
    [
        ("UPDATE edits SET edit = '{\"n\":3}' WHERE id = 1", "entry 1 .* checksum"),
        ("UPDATE edits SET time = 6.0 WHERE id = 1", "entry 1 .* checksum"),
        ("UPDATE edits SET sha256 = x'00' WHERE id = 2", "entry 2 .* checksum"),
        ("DELETE FROM edits WHERE id = 1", "entry 1 .* is missing"),
        ("DELETE FROM edits WHERE id = 1; UPDATE edits SET id = 1", "entry 1 .* checksum"),
    ],
)
def test_every_damage_of_the_log_is_named_and_the_frames_stay(
    path: Path, sql: str, words: str
) -> None:
    db = sqlite3.connect(path)
    db.executescript(sql)
    db.close()
    with Scan.open(path) as scan:
        assert len(list(scan.frames())) == 6
        with pytest.raises(ScanCorrupt, match=words):
            scan.edits()
        assert [name for name, trouble in scan.verify() if trouble] == ["the log of edits"]
    with Scan.resume(path) as scan, pytest.raises(ScanCorrupt, match=words):
        scan.append_edit("{}")


def test_a_text_beyond_all_measure_is_refused(path: Path) -> None:
    with Scan.resume(path) as scan:
        with pytest.raises(InputError, match="16777216 characters"):
            scan.append_edit("x" * ((16 << 20) + 1))
        assert len(scan.edits()) == 2


def test_a_sound_row_of_another_scan_does_not_pass_for_one_of_this(
    path: Path, tmp_path: Path
) -> None:
    write(tmp_path / "other.turnscan")
    with Scan.resume(tmp_path / "other.turnscan") as scan:
        scan.append_edit('{"n":7}', 5.0)
    db = sqlite3.connect(path)
    db.execute("ATTACH ? AS other", (str(tmp_path / "other.turnscan"),))
    db.execute("DELETE FROM edits WHERE id = 1")
    db.execute("INSERT INTO edits SELECT * FROM other.edits")
    db.commit()
    db.close()
    with Scan.open(path) as scan, pytest.raises(ScanCorrupt, match=r"entry 2 .* checksum"):
        scan.edits()


def test_a_copy_of_a_file_in_use_has_its_edits(path: Path, tmp_path: Path) -> None:
    copy = tmp_path / "elsewhere" / "copy.turnscan"
    copy.parent.mkdir()
    with Scan.resume(path) as scan:
        scan.append_edit('{"version":1}', 12.0)
        scan.append_edit('{"version":2}', 13.0)
        scan.keep_settings('{"sets": {}}')
        shutil.copy(path, copy)  # as a person does: the one file, not what lies beside it
    with Scan.open(copy) as opened:
        assert [e.text for e in opened.edits()][-2:] == ['{"version":1}', '{"version":2}']
        assert opened.settings == '{"sets": {}}'
