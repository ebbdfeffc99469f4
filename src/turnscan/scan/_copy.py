"""A copy of a scan file, whole also while the file is open and being edited."""

from __future__ import annotations

import secrets
import sqlite3
from contextlib import closing
from pathlib import Path

from turnscan.errors import InputError, StorageFull
from turnscan.scan import _database as database
from turnscan.scan._storage import storage


def copy_scan(source: str | Path, target: str | Path) -> None:
    """Copy a scan file with everything that was committed to it, its edits too.

    A plain copy of a file that is open lacks what is still in the files beside it. The name appears
    when the copy is whole. Raises as `Scan.open`, InputError where ``target`` exists, StorageFull
    where it cannot be written.
    """
    source, target = Path(source), Path(target)
    if target.exists():
        raise InputError(f"{target}: already exists", hint="choose another name")
    part = target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")
    try:
        with (
            storage(source),
            closing(database.open_reading(source)) as held,
            closing(sqlite3.connect(part)) as copy,
        ):
            held.backup(copy)
            copy.execute("PRAGMA journal_mode = DELETE")
        if target.exists():
            raise InputError(f"{target}: already exists", hint="choose another name")
        part.rename(target)
        database.sync_folder(target)
    except OSError as e:
        if isinstance(e, InputError):
            raise
        raise StorageFull(f"{target}: cannot be written", hint="check the disk") from None
    finally:
        database.remove(part)
