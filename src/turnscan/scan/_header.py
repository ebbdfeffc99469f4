"""The first hundred bytes of a scan file, judged before SQLite sees any of it."""

from __future__ import annotations

import os
from pathlib import Path

from turnscan.errors import FormatError, InputError, ScanCorrupt, ScanError, ScanNewer
from turnscan.scan._storage import damaged, gone, storage

APPLICATION_ID = 0x54524E53  # "TRNS"
VERSION = 1
_MAGIC = b"SQLite format 3\0"


def is_scan(path: Path) -> bool:
    """Whether the file begins as a scan file does, whatever became of the rest of it."""
    if not path.is_file():
        return False
    with storage(path), path.open("rb") as file:
        return _is_ours(file.read(100))


def _is_ours(head: bytes) -> bool:
    return head.startswith(_MAGIC) and int.from_bytes(head[68:72], "big") == APPLICATION_ID


def judge_header(path: Path) -> None:
    """Raises what is wrong with a file that is to be opened: missing, foreign, newer, truncated."""
    if path.is_dir():
        raise InputError(f"{path}: a folder, not a scan file", hint="name a .turnscan file")
    if not path.exists():
        raise gone(path)
    try:
        with path.open("rb") as file:
            head = file.read(100)
            size = os.fstat(file.fileno()).st_size
    except OSError as e:
        raise ScanError(f"{path}: cannot be read ({e.strerror})") from None
    if not head.startswith(_MAGIC) or len(head) < 100:
        what = "an empty file" if not head else "not a scan file"
        raise FormatError(f"{path}: {what}", hint="name a file made by turnscan import or scan")
    if not _is_ours(head):
        raise FormatError(
            f"{path}: an SQLite file, but not a scan", hint="name a file made by turnscan"
        )
    version = int.from_bytes(head[60:64], "big")
    if version > VERSION:
        raise ScanNewer(
            f"{path}: version {version} of the scan file; this turnscan knows up to {VERSION}",
            hint="install a newer turnscan",
        )
    if version < 1:
        raise damaged(path, f"version {version} does not exist")
    page = int.from_bytes(head[16:18], "big")
    page = 65536 if page == 1 else page
    said = page * int.from_bytes(head[28:32], "big")
    if size < said and not path.with_name(path.name + "-wal").exists():
        raise ScanCorrupt(
            f"{path}: truncated, {size} bytes are left of {said}", hint="copy the file again"
        )
