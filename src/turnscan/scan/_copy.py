"""A scan file copied, whole also while it is open and being edited, or under another name."""

from __future__ import annotations

import secrets
import sqlite3
from contextlib import closing
from pathlib import Path

from turnscan.errors import InputError, StorageFull, TurnscanError
from turnscan.scan import _database as database
from turnscan.scan._lock import WriterLock
from turnscan.scan._storage import gone, storage


def copy_scan(source: str | Path, target: str | Path, *, keep: bool = True) -> None:
    """Copy a scan file with everything that was committed to it, its edits too.

    A plain copy of a file that is open lacks what is still in the files beside it. The name appears
    when the copy is whole. Without ``keep`` the file itself gets the new name, and nobody can begin
    to write it meanwhile; a damaged one can be moved where nothing is beside it.

    Raises as `Scan.open`, InputError where ``target`` exists, StorageFull where it cannot be
    written, and ScanBusy where the file is open for writing and is not to be kept.
    """
    if keep:
        _copy(Path(source), Path(target))
    else:
        _move(Path(source), Path(target))


def _copy(source: Path, target: Path) -> None:
    if target.exists():
        raise InputError(f"{target}: already exists", hint="choose another name")
    part = target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")
    try:
        with (
            storage(source, was_there=True),
            closing(database.open_reading(source)) as held,
            closing(sqlite3.connect(part)) as copy,
        ):
            held.backup(copy)
            copy.execute("PRAGMA journal_mode = DELETE")
        database.put_in_place(part, target)
    except OSError as e:
        if isinstance(e, TurnscanError):
            raise
        raise StorageFull(f"{target}: cannot be written", hint="check the disk") from None
    finally:
        database.remove(part)


def _move(source: Path, target: Path) -> None:
    if not source.exists():
        raise gone(source)
    lock = WriterLock(source)
    try:
        if any(source.with_name(source.name + tail).exists() for tail in ("-wal", "-journal")):
            _copy(source, target)
        else:
            database.put_in_place(source, target)
        for tail in ("", "-wal", "-shm", "-journal"):
            source.with_name(source.name + tail).unlink(missing_ok=True)
    except OSError as e:
        if isinstance(e, TurnscanError):
            raise
        if not source.exists():
            raise gone(source) from None
        raise StorageFull(
            f"{source}: cannot be moved ({e.strerror})", hint="check the folder"
        ) from None
    finally:
        lock.release()
