"""Kills, bit flips, cuts and strangers: never a wrong frame, never an unnamed error."""

from __future__ import annotations

import random
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.scan.small import PLAN, stripe_pair, write
from turnscan.errors import InputError, ScanCorrupt, ScanError, TurnscanError
from turnscan.scan import Frame, Scan

MUSEUM = Path(__file__).parents[1] / "museum" / "scan"

WRITER = """
import sys
from tests.scan.small import PLAN, stripe_pair
from dataclasses import replace
from turnscan.scan import Frame, Scan
pairs = [stripe_pair(k) for k in range(8)]
with Scan.create(sys.argv[1], replace(PLAN, steps=2000)) as scan:
    for k in range(2000):
        scan.add(Frame(k, "left", *pairs[k % 8], commanded=0.1 * k))
        print(k, flush=True)
"""


def test_a_killed_writer_loses_no_acknowledged_frame(tmp_path: Path) -> None:
    """kill -9 at six random moments; every step that was acknowledged is there and right."""
    rng = random.Random(11)
    inside = 0
    pairs = [stripe_pair(k) for k in range(8)]
    for trial in range(6):
        path = tmp_path / f"{trial}.turnscan"
        child = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(path)],
            stdout=subprocess.PIPE,
            text=True,
            cwd=Path(__file__).parents[2],
        )
        assert child.stdout is not None
        acknowledged = [int(child.stdout.readline()) for _ in range(rng.randrange(1, 60))]
        time.sleep(rng.random() * 0.01)
        child.kill()
        acknowledged += [int(line) for line in child.stdout if line.endswith("\n")]
        child.wait()
        child.stdout.close()
        last = acknowledged[-1]
        with Scan.open(path) as scan:
            assert not scan.sealed
            frames = list(scan.frames())
        inside += 0 < len(frames) < 2000
        assert len(frames) in (last + 1, last + 2)
        with Scan.resume(path) as scan:
            number = len(frames)
            scan.add(Frame(number, "left", *pairs[number % 8], commanded=0.1 * number))
        with Scan.open(path) as scan:
            assert scan.sealed
            assert scan.steps("left") == list(range(number + 1))
            for got in scan.frames():
                lit, dark = pairs[got.step % 8]
                bright = lit.astype(int) - dark > PLAN.threshold + 3
                np.testing.assert_array_equal(got.lit[bright], lit[bright])
                assert got.commanded == 0.1 * got.step
    assert inside >= 5, "the kills must land inside the scan"


def _everything(path: Path) -> list[object]:
    with Scan.open(path) as scan:
        if any(trouble for _, trouble in scan.verify()):
            raise ScanCorrupt("verify found it")
        out: list[object] = [scan.plan, scan.missing("left"), scan.complete]
        for f in scan.frames():
            out.append(
                (
                    f.step,
                    f.laser,
                    f.angle,
                    f.noise,
                    f.level,
                    dict(f.settings),
                    f.lit.tobytes(),
                    f.dark.tobytes() if f.dark is not None else b"",
                )
            )
        return out


def test_mutations_never_give_a_wrong_frame(tmp_path: Path) -> None:
    """Bit flips, cuts, appended and overwritten bytes: the same scan, or a named error."""
    whole = tmp_path / "whole.turnscan"
    write(whole)
    truth, data = _everything(whole), whole.read_bytes()
    assert len(truth) == 9
    rng = random.Random(7)
    refused = 0
    path = tmp_path / "mutant.turnscan"
    for trial in range(1000):
        mutant = bytearray(data)
        if trial % 4 == 0:
            del mutant[rng.randrange(len(mutant)) :]
        elif trial % 4 == 1:
            start = rng.randrange(len(mutant))
            junk = rng.randbytes(rng.randrange(1, 300))
            mutant[start : start + len(junk)] = junk
        else:
            for _ in range(rng.choice((1, 1, 1, 8))):
                place = rng.randrange(200) if trial % 8 == 2 else rng.randrange(len(mutant))
                mutant[place] ^= 1 << rng.randrange(8)
        path.write_bytes(mutant)
        try:
            assert _everything(path) == truth, f"mutation {trial}"
        except TurnscanError:
            refused += 1
        for tail in ("-wal", "-shm", "-journal"):
            path.with_name(path.name + tail).unlink(missing_ok=True)
    assert refused > 500, "most mutations must have hit something"


def test_each_of_1000_flipped_bits_in_payloads_is_named(tmp_path: Path) -> None:
    """C8: a bit of each frame at a time; all are found, and nothing else is."""
    path = tmp_path / "a.turnscan"
    write(path)
    rng = random.Random(8)
    with closing(sqlite3.connect(path)) as db:  # also where it fails, as the test after it wants
        db.execute("PRAGMA synchronous = OFF")  # this test is not about the disk
        whole = dict(db.execute("SELECT step, payload FROM frames"))
        assert len(whole) == PLAN.steps
        flips = found = 0
        while flips < 1000:
            for step, payload in whole.items():
                altered = bytearray(payload)
                altered[rng.randrange(len(altered))] ^= 1 << rng.randrange(8)
                db.execute("UPDATE frames SET payload = ? WHERE step = ?", (bytes(altered), step))
                flips += 1
            db.commit()
            with Scan.open(path) as scan:
                found += sum(trouble is not None for _, trouble in scan.verify())
        assert found == flips, f"{found} of {flips} found"
        db.executemany("UPDATE frames SET payload = ? WHERE step = ?",
                       [(payload, step) for step, payload in whole.items()])  # fmt: skip
        db.commit()
    with Scan.open(path) as scan:
        assert not any(trouble for _, trouble in scan.verify())


def test_a_reader_that_compares_no_checksum_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The mutant: a payload is taken as it is."""
    from turnscan.scan import _database

    def credulous(payload: bytes, row: _database.Row, path: Path) -> bytes:
        return payload

    monkeypatch.setattr(_database, "check_payload", credulous)
    with pytest.raises(AssertionError, match=r"of 1002 found"):
        test_each_of_1000_flipped_bits_in_payloads_is_named(tmp_path)


def test_each_altered_payload_in_a_healthy_database_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.turnscan"
    write(path)
    db = sqlite3.connect(path)
    for step in range(PLAN.steps):
        before = db.execute("SELECT payload FROM frames WHERE step = ?", (step,)).fetchone()[0]
        altered = bytearray(before)
        altered[7 * (step + 1)] ^= 1
        db.execute("UPDATE frames SET payload = ? WHERE step = ?", (bytes(altered), step))
        db.commit()
        with Scan.open(path) as scan:
            bad = [name for name, trouble in scan.verify() if trouble is not None]
            assert bad == [f"step {step} of laser left"]
            with pytest.raises(ScanCorrupt, match=f"step {step} of laser left"):
                scan.frame(step, "left")
        db.execute("UPDATE frames SET payload = ? WHERE step = ?", (before, step))
        db.commit()
    db.close()


@pytest.mark.parametrize(
    "sql",
    [
        "UPDATE frames SET commanded = 1.5 WHERE step = 2",
        "UPDATE frames SET settings = '{}' WHERE step = 2",
        "UPDATE frames SET noise = NULL WHERE step = 2",
        "UPDATE frames SET step = 77 WHERE step = 2",
        "DELETE FROM frames WHERE step = 2",
        "UPDATE meta SET value = replace(value, '64', '65') WHERE key = 'plan'",
        "DELETE FROM meta WHERE key = 'plan'",
    ],
)
def test_every_altered_value_is_noticed_when_opened(tmp_path: Path, sql: str) -> None:
    path = tmp_path / "a.turnscan"
    write(path)
    db = sqlite3.connect(path)
    db.execute(sql)
    db.commit()
    db.close()
    with pytest.raises(ScanCorrupt):
        Scan.open(path)


def test_cut_in_half(tmp_path: Path) -> None:
    path = tmp_path / "a.turnscan"
    write(path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(ScanCorrupt, match=r"truncated, \d+ bytes are left of \d+"):
        Scan.open(path)


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"", "an empty file"), (b"hello" * 50, "not a scan file"), (b"SQLite f", "not a scan file")],
)
def test_other_files(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "a.turnscan"
    path.write_bytes(content)
    with pytest.raises(InputError, match=words):
        Scan.open(path)
    assert path.read_bytes() == content


def test_another_database_a_folder_and_nothing(tmp_path: Path) -> None:
    db = sqlite3.connect(tmp_path / "other.db")
    db.execute("CREATE TABLE t (x)")
    db.close()
    with pytest.raises(InputError, match="an SQLite file, but not a scan"):
        Scan.open(tmp_path / "other.db")
    with pytest.raises(InputError, match="a folder"):
        Scan.open(tmp_path)
    with pytest.raises(InputError, match="no such scan file"):
        Scan.open(tmp_path / "none.turnscan")


@pytest.mark.parametrize("opening", [Scan.open, Scan.resume])
def test_a_refused_file_is_left_closed(
    opening: Callable[[Path], Scan], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever is wrong with it: no connection stays open, and no lock."""
    opened: list[sqlite3.Connection] = []
    real = sqlite3.connect

    def connect(*args: Any, **more: Any) -> sqlite3.Connection:
        opened.append(real(*args, **more))
        return opened[-1]

    good = tmp_path / "a.turnscan"
    write(good, steps=3)
    wrongs = [
        "DROP TABLE edits",
        "UPDATE meta SET value = 'x'",
        "UPDATE frames SET step = step + 9",
    ]
    wrongs += ["DELETE FROM meta", "UPDATE frames SET sha256 = x'00'"]
    monkeypatch.setattr(sqlite3, "connect", connect)
    for n, sql in enumerate([*wrongs, "no schema"]):
        bad = tmp_path / f"{n}.turnscan"
        bad.write_bytes(good.read_bytes())
        if sql == "no schema":
            data = bytearray(good.read_bytes())
            data[100:4096] = bytes(3996)
            bad.write_bytes(data)
        else:
            with closing(real(bad)) as db:
                db.execute(sql)
                db.commit()
        with pytest.raises(ScanError):
            opening(bad)
        assert len(opened) == n + 1, "each was refused by what SQLite read, not by its header"
        assert not bad.with_name(bad.name + "-lock").exists()
        bad.unlink()
    for db in opened:
        with pytest.raises(sqlite3.ProgrammingError, match="closed"):
            db.execute("SELECT 1")


def test_a_payload_bomb_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    """A stranger's frame with right checksums that would unpack to 1 GiB."""
    import zstandard

    from turnscan.errors import LimitExceeded
    from turnscan.scan import _database as database

    path = tmp_path / "a.turnscan"
    bomb = zstandard.ZstdCompressor().compress(bytes(1 << 28))
    with Scan.create(path, PLAN) as scan:
        row = scan._new_row(
            "lit", Frame(0, "left", stripe_pair(0)[0]), "none", bomb, "{}", 1.0, 0.0
        )
        database.insert(scan._db, row, bomb)
        scan._index.add(row)
    with Scan.open(path) as scan, pytest.raises(LimitExceeded, match="268435456 bytes"):
        scan.frame(0, "left")


@pytest.mark.parametrize("seed", range(3))
def test_strange_payloads_with_right_checksums(tmp_path: Path, seed: int) -> None:
    """Whatever a stranger wrote into the runs: pixels of the right shape, or a named error."""
    import zstandard

    from turnscan.scan._codec import decode, encode

    rng = random.Random(seed)
    lit, dark = stripe_pair(0)
    good, _ = encode(lit, dark, True, 8.0, PLAN)
    body = zstandard.ZstdDecompressor().decompress(good)
    refused = 0
    for _ in range(300):
        mutant = bytearray(body)
        for _ in range(rng.choice((1, 2, 20))):
            place = rng.randrange(600) if rng.random() < 0.8 else rng.randrange(len(mutant))
            mutant[place] = rng.randrange(256)
        payload = zstandard.ZstdCompressor().compress(bytes(mutant))
        try:
            got = decode(payload, PLAN, "own", None, None, "frame")
        except TurnscanError:
            refused += 1
        else:
            assert [p.shape for p in got if p is not None] == [PLAN.shape] * 2
    assert refused > 50


def test_museum() -> None:
    """Broken files from the field, and one scan file of every released version."""
    for path in sorted(MUSEUM.glob("broken-*.turnscan")):
        with pytest.raises((ScanError, InputError)):
            _everything(path)
    whole = sorted(MUSEUM.glob("version-*.turnscan"))
    assert whole, "the museum holds a file of each version"
    for path in whole:
        with Scan.open(path) as scan:
            assert scan.complete
            for frame in scan.frames():
                lit, dark = stripe_pair(frame.step)
                bright = lit.astype(int) - dark > PLAN.threshold + 3
                np.testing.assert_array_equal(frame.lit[bright], lit[bright])
