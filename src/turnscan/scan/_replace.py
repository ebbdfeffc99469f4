"""A whole scan file at once: the old one stays until the new one is good."""

from __future__ import annotations

import glob
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from turnscan.errors import FormatError, InputError, ScanBusy, ScanError
from turnscan.rig import Rig
from turnscan.scan import _database as database
from turnscan.scan._file import Scan
from turnscan.scan._header import is_scan
from turnscan.scan._plan import ScanPlan


@contextmanager
def replacing_scan(path: str | Path, plan: ScanPlan, rig: Rig | None = None) -> Iterator[Scan]:
    """Write a whole scan file; ``path`` appears, or is replaced, only when all of it is good.

    It is written under a temporary name in the same folder, sealed, read again and compared with
    its checksums, and only then renamed. On any error the old file is as it was.
    A file that is no scan stays: what a mistyped name points to is not ours to replace.
    Raises FormatError for such a file, ScanBusy where the old file is being written
    or waits to be resumed, ScanError.
    """
    path = Path(path)
    if path.is_dir():
        raise ScanError(f"{path}: a folder, so no scan file can be written here")
    if path.exists() and not is_scan(path):
        raise FormatError(
            f"{path}: exists and is not a scan file, so it is not replaced",
            hint="choose another name",
        )
    if path.with_name(path.name + "-wal").exists():
        raise ScanBusy(
            f"{path}: another process is writing it, or it holds an interrupted scan",
            hint="choose another name, or finish that scan first",
        )
    _sweep(path)
    part = path.with_name(f".{path.name}.{secrets.token_hex(4)}.part")
    try:
        with Scan.create(part, plan, rig) as scan:
            yield scan
        with Scan.open(part) as scan:
            for _, trouble in scan.verify():
                if trouble is not None:
                    raise trouble
        os.replace(part, path)
        database.sync_folder(path)
    except BaseException:
        database.remove(part)
        raise


def _sweep(path: Path) -> None:
    """Remove what killed imports to the same name left; a file that is being written stays."""
    for part in path.parent.glob(f".{glob.escape(path.name)}.{'[0-9a-f]' * 8}.part"):
        try:
            db, lock = database.open_writing(part)
            db.close()
            lock.release()
        except ScanBusy:
            continue
        except (ScanError, InputError):
            pass  # killed before its first frame
        database.remove(part)
