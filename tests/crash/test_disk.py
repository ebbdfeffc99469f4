"""C3 and C5: power cuts and disks that fail, at every call to the disk."""

from __future__ import annotations

import errno
import random
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.crash.conftest import Zygote
from tests.crash.rows import rows_of
from turnscan.errors import InputError, TurnscanError
from turnscan.scan import Scan

STEPS = 10
SECTOR = 512


@dataclass(frozen=True)
class Change:
    kind: str
    inode: int
    offset: int
    data: bytes


@dataclass
class Disk:
    """What is certainly on it, and what was written since the last sync."""

    names: dict[str, int] = field(default_factory=dict)
    synced: dict[int, bytearray] = field(default_factory=dict)
    pending: dict[int, list[Change]] = field(default_factory=dict)

    def take(self, change: Change) -> None:
        if change.kind == "n":
            self.names[change.data.decode()] = change.inode
            self.synced.setdefault(change.inode, bytearray())
        elif change.kind == "u":
            self.names.pop(change.data.decode(), None)
        elif change.kind in "wt":
            self.pending.setdefault(change.inode, []).append(change)
        elif change.kind == "s":
            for old in self.pending.pop(change.inode, []):
                self._put(self.synced.setdefault(change.inode, bytearray()), old)

    def after_a_cut(self, rng: random.Random) -> dict[str, bytes]:
        """Every sector written since the last sync is there, not there, or nonsense."""
        out = {}
        for name, inode in self.names.items():
            content = bytearray(self.synced.get(inode, b""))
            for change in self.pending.get(inode, []):
                for piece in self._sectors(change):
                    fate = rng.random()
                    if fate < 0.4:
                        self._put(content, piece)
                    elif fate < 0.5 and piece.kind == "w":
                        junk = rng.randbytes(len(piece.data))
                        self._put(content, Change("w", inode, piece.offset, junk))
            out[name] = bytes(content)
        return out

    @staticmethod
    def _put(content: bytearray, change: Change) -> None:
        if change.kind == "t":
            del content[change.offset :]
            content.extend(bytes(change.offset - len(content)))
            return
        end = change.offset + len(change.data)
        content.extend(bytes(max(0, end - len(content))))
        content[change.offset : end] = change.data

    @staticmethod
    def _sectors(change: Change) -> Iterator[Change]:
        if change.kind == "t":
            yield change
            return
        at, data = change.offset, change.data
        while data:
            n = SECTOR - at % SECTOR
            yield Change("w", change.inode, at, data[:n])
            at, data = at + n, data[n:]


def changes_of(log: Path) -> list[Change]:
    data, out, at = log.read_bytes(), [], 0
    while at < len(data):
        kind, inode, offset, length = struct.unpack_from("<cQqI", data, at)
        at += 21
        out.append(Change(kind.decode(), inode, offset, data[at : at + length]))
        at += length
    return out


def cuts(zygote: Zygote, mutant: bool, tmp_path: Path) -> tuple[int, int, int]:
    """Cut the power after every change: cuts, frames that had to survive, those that did not."""
    folder = zygote.new_folder(f"cut{mutant}")
    log = tmp_path / "log"
    path = folder / "a.turnscan"
    done = zygote.ask("logged", path=str(path), log=str(log), steps=STEPS, mutant=mutant)
    assert done["error"] == ""
    truth = {}
    with Scan.open(path) as scan:
        assert scan.complete
        for stored in scan.stored():
            truth[stored.row.step] = stored.payload
    rng = random.Random(3)
    disk, marked, count, wanted, lost = Disk(), set[int](), 0, 0, 0
    for number, change in enumerate(changes_of(log)):
        disk.take(change)
        if change.kind == "m":
            marked.add(change.offset)
        for _ in range(2 if not mutant else number % 4 == 0):
            count += 1
            there = _survivors(disk.after_a_cut(rng), folder, tmp_path / "after", truth)
            wanted += len(marked)
            lost += len(marked - there)
    assert marked == set(range(STEPS)), "every frame was acknowledged"
    return count, wanted, lost


def _survivors(files: dict[str, bytes], was: Path, now: Path, truth: dict[int, bytes]) -> set[int]:
    """Steps of the frames that are there and right."""
    now.mkdir(exist_ok=True)
    for old in now.iterdir():
        old.unlink()
    for name, content in files.items():
        if not name.endswith("-shm"):  # shared memory is gone with the power
            (now / Path(name).relative_to(was)).write_bytes(content) if Path(name) != was else None
    try:
        with Scan.resume(now / "a.turnscan") as scan:
            out = set()
            for stored in scan.stored():
                assert stored.payload == truth[stored.row.step], "a frame that was never taken"
                out.add(stored.row.step)
            return out
    except TurnscanError:
        return set()


def test_acknowledged_frames_survive_a_power_cut_at_any_write(
    failing_disk: Zygote, tmp_path: Path
) -> None:
    count, wanted, lost = cuts(failing_disk, mutant=False, tmp_path=tmp_path)
    assert count > 100
    assert wanted > 500
    assert lost == 0


def test_without_syncing_they_would_not(failing_disk: Zygote, tmp_path: Path) -> None:
    _, wanted, lost = cuts(failing_disk, mutant=True, tmp_path=tmp_path)
    assert lost > 0.1 * wanted, "the test above would not notice"


@pytest.mark.parametrize(
    ("error", "lasting", "stride"),
    [(errno.ENOSPC, True, 1), (errno.EIO, False, 1), (errno.EROFS, True, 3),
     (errno.EMFILE, True, 3)],
    ids=["disk full", "EIO once", "read-only", "no descriptors"],
)  # fmt: skip
def test_every_failing_call_ends_dark_and_resumable(
    failing_disk: Zygote, error: int, lasting: bool, stride: int
) -> None:
    steps = 5
    whole = failing_disk.new_folder("whole") / "a.turnscan"
    calls = failing_disk.ask("starve", path=str(whole), n=-1, errno=0, lasting=False, steps=steps)
    assert calls["error"] == ""
    truth = rows_of(whole)
    failed = 0
    for n in range(1, calls["calls"] + 1, stride):
        folder = failing_disk.new_folder("starved")
        path = folder / "a.turnscan"
        said = failing_disk.ask(
            "starve", path=str(path), n=n, errno=error, lasting=lasting, steps=steps
        )
        where = (n, said)
        assert said["named"], where
        if said["error"]:
            failed += 1
            # SQLite calls a schema that it could not read damaged.
            named = ("ScanError", "StorageFull", "ScanBusy", "ScanCorrupt")
            assert said["error"] in named, where
            assert not said["lit"], where
            assert said["halted"], where
        assert said["after"]["error"] == "", where
        assert said["beside"] == ["a.turnscan"], where
        assert rows_of(path) == truth, where
    assert failed > 0.5 * (calls["calls"] / stride)


def test_errors_that_are_not_translated_would_be_noticed(failing_disk: Zygote) -> None:
    """The mutant of C5: what the test above asserts of every failing call does not hold."""
    unnamed = 0
    for n in range(10, 90, 10):
        path = failing_disk.new_folder("starved") / "a.turnscan"
        said = failing_disk.ask(
            "starve", path=str(path), n=n, errno=errno.ENOSPC, lasting=True, steps=3, mutant=True
        )
        unnamed += not said["named"]
    assert unnamed >= 4


def test_an_unreadable_folder_says_so(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such scan file"):
        Scan.resume(tmp_path / "no" / "a.turnscan")
