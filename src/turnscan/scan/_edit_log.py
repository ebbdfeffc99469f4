"""The log of edits in a scan file: texts that are only ever appended, each chained to the last."""

from __future__ import annotations

import hashlib
import json
import math
import sqlite3
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from turnscan.errors import InputError, ScanCorrupt
from turnscan.json_text import JSON_BYTES
from turnscan.remedy import Option, Remedy
from turnscan.scan._storage import storage

MOST_ENTRIES = 1_000_000


@dataclass(frozen=True)
class LogEntry:
    """One entry of the log of edits."""

    number: int
    """1, 2, 3 …"""
    time: float
    """s since 1970-01-01 UTC; NaN where unknown."""
    text: str
    """What was done, as `turnscan.edit` writes it."""
    digest: bytes
    """SHA-256 over the entry and the digest of the one before it."""


def read(db: sqlite3.Connection, path: Path) -> Iterator[LogEntry]:
    """All entries in order, each compared with its digest, and so with all before it.

    Raises ScanCorrupt naming the first one that does not agree.
    """
    before = b""
    with storage(path):
        sizes = db.execute("SELECT id, length(edit) FROM edits ORDER BY id LIMIT ?",
                           (MOST_ENTRIES + 1,)).fetchall()  # fmt: skip
    if len(sizes) > MOST_ENTRIES:
        raise _damaged(path, f"its log of edits has more than {MOST_ENTRIES} entries")
    for number, (id, size) in enumerate(sizes, start=1):
        name = f"entry {number} of its log of edits"
        if id != number:
            raise _damaged(path, f"{name} is missing")
        if size > JSON_BYTES:
            raise _damaged(path, f"{name} holds {size} characters, at most {JSON_BYTES} fit")
        with storage(path):
            found = db.execute("SELECT time, edit, sha256 FROM edits WHERE id = ?", (id,))
            time, text, digest = found.fetchone()
        entry = _entry(number, math.nan if time is None else time, text, before)
        if entry.digest != digest:
            raise _damaged(path, f"{name} does not match its checksum")
        before = entry.digest
        yield entry


def append(
    db: sqlite3.Connection, path: Path, last: LogEntry | None, text: str, time: float
) -> LogEntry:
    """Write one more entry, within the caller's transaction. Raises InputError for one too many."""
    number = 1 if last is None else last.number + 1
    if number > MOST_ENTRIES or len(text) > JSON_BYTES:
        raise InputError(
            f"{path}: the log of edits takes {MOST_ENTRIES} entries of {JSON_BYTES} characters",
            hint="make a smaller selection, or go on in a copy of the scan",
        )
    entry = _entry(number, time, text, b"" if last is None else last.digest)
    values = (number, None if math.isnan(time) else time, text, entry.digest)
    db.execute("INSERT INTO edits VALUES (?, ?, ?, ?)", values)
    return entry


def _entry(number: int, time: float, text: str, before: bytes) -> LogEntry:
    at = None if math.isnan(time) else struct.pack("<d", time + 0.0).hex()
    values = [before.hex(), number, at, text]
    return LogEntry(number, time, text, hashlib.sha256(json.dumps(values).encode()).digest())


def _damaged(path: Path, what: str) -> ScanCorrupt:
    return ScanCorrupt(
        f"{path}: damaged: {what}",
        hint=Remedy("reconstruct with ", Option("edits", "none"), ", or take a copy from a backup"),
    )
