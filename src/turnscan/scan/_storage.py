"""What SQLite and the disk say about a scan file, as the errors of turnscan."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from turnscan.errors import (
    InputError,
    ScanBusy,
    ScanCorrupt,
    ScanError,
    StorageFull,
    TurnscanError,
)


@contextmanager
def storage(path: Path, *, was_there: bool = False) -> Iterator[None]:
    """Turn what SQLite and the disk say into the errors of turnscan.

    A file that ``was_there`` a moment ago, and is not any more, was moved or deleted.
    """
    try:
        yield
    except sqlite3.Error as e:
        lost = was_there and _code(e).startswith("SQLITE_CANTOPEN")
        raise (gone(path) if lost and not path.exists() else _named(e, path)) from None
    except (OverflowError, UnicodeError) as e:
        raise damaged(path, str(e)) from None


def damaged(path: Path, what: str) -> ScanCorrupt:
    return ScanCorrupt(
        f"{path}: damaged: {what}", hint="take a copy from a backup, or scan or import again"
    )


def gone(path: Path) -> InputError:
    return InputError(f"{path}: no such scan file", hint="check the path")


def full(path: Path) -> StorageFull:
    return StorageFull(
        f"{path}: the disk is full", hint="free some space, then try again, or resume the scan"
    )


def _code(e: sqlite3.Error) -> str:
    """Its name, of an error that is SQLite's own and not that of Python's module."""
    return getattr(e, "sqlite_errorname", "") or ""


def _named(e: sqlite3.Error, path: Path) -> TurnscanError:
    name = _code(e)
    if name.startswith(("SQLITE_BUSY", "SQLITE_LOCKED")):
        return ScanBusy(
            f"{path}: another process is writing it", hint="wait until that one has finished"
        )
    if name == "SQLITE_FULL":
        return full(path)
    if name == "SQLITE_IOERR_SHORT_READ":
        return damaged(path, "it ends too early")
    if name.startswith("SQLITE_READONLY"):
        return ScanError(
            f"{path}: read-only, nothing was written ({name})",
            hint="allow writing to the file and its folder, or take a copy elsewhere",
        )
    if name.startswith(("SQLITE_IOERR", "SQLITE_CANTOPEN", "SQLITE_PERM")):
        return ScanError(
            f"{path}: {e} ({name})", hint="check the disk, the folder and its permissions"
        )
    return damaged(path, str(e))
