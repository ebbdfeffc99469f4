"""The SQLite side of a scan file: its tables, and its checks before anything is believed.

The header is judged before SQLite sees the file (`_header`), the schema must be ours to the letter,
and every SQLite error becomes a named one (`_storage`).
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import math
import os
import sqlite3
import struct
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from turnscan.errors import InputError, ScanError, TurnscanError
from turnscan.scan._header import APPLICATION_ID, VERSION, judge_header
from turnscan.scan._lock import WriterLock
from turnscan.scan._storage import damaged, full, storage

_LARGEST_VALUE = 1 << 30
_PATIENCE_MS = 500
"""For readers, when a file is closed."""

SCHEMA = (
    "CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL, sha256 BLOB NOT NULL)"
    " STRICT, WITHOUT ROWID",
    "CREATE TABLE frames (id INTEGER PRIMARY KEY, kind TEXT NOT NULL, step INTEGER NOT NULL,"
    " laser TEXT NOT NULL, exposure INTEGER NOT NULL, commanded REAL, measured REAL, sigma REAL,"
    " noise REAL, level REAL, time REAL, settings TEXT NOT NULL, width INTEGER NOT NULL,"
    " height INTEGER NOT NULL, codec TEXT NOT NULL, payload_sha256 BLOB NOT NULL,"
    " sha256 BLOB NOT NULL, payload BLOB NOT NULL, UNIQUE (kind, laser, step, exposure)) STRICT",
    "CREATE TABLE edits (id INTEGER PRIMARY KEY, time REAL, edit TEXT NOT NULL,"
    " sha256 BLOB NOT NULL) STRICT",
)
_COLUMNS = (
    "id, kind, step, laser, exposure, commanded, measured, sigma, noise, level, time, settings,"
    " width, height, codec, payload_sha256, sha256, length(payload)"
)
_REAL = (float, type(None))
_KINDS: tuple[type | tuple[type, ...], ...] = (
    *(int, str, int, str, int),
    *(_REAL, _REAL, _REAL, _REAL, _REAL, _REAL),
    *(str, int, int, str, bytes, bytes, int),
)


@dataclass(frozen=True)
class Row:
    """One row of the table of frames, without its payload."""

    id: int
    kind: str
    """lit, background, texture or missing."""
    step: int
    laser: str
    exposure: int
    commanded: float
    measured: float
    sigma: float
    noise: float
    level: float
    time: float
    settings: str
    width: int
    height: int
    codec: str
    payload_sha256: bytes

    def digest(self) -> bytes:
        """SHA-256 of everything in the row: its values and, through its digest, its payload."""
        floats = (self.commanded, self.measured, self.sigma, self.noise, self.level, self.time)
        values = [
            self.kind,
            self.step,
            self.laser,
            self.exposure,
            # SQLite knows no negative zero: + 0.0 makes it a positive one.
            *(None if math.isnan(f) else struct.pack("<d", f + 0.0).hex() for f in floats),
            self.settings,
            self.width,
            self.height,
            self.codec,
            self.payload_sha256.hex(),
        ]
        return hashlib.sha256(json.dumps(values).encode()).digest()

    def __str__(self) -> str:
        if self.kind == "background":
            return f"background of laser {self.laser}"
        if self.kind == "texture":
            return f"texture of step {self.step}"
        extra = f", exposure {self.exposure}" if self.exposure else ""
        return f"step {self.step} of laser {self.laser}{extra}"


@contextmanager
def transaction(db: sqlite3.Connection) -> Iterator[None]:
    """All of what is done within, or nothing."""
    db.execute("BEGIN IMMEDIATE")
    try:
        yield
        db.execute("COMMIT")
    except BaseException:
        if db.in_transaction:
            db.execute("ROLLBACK")
        raise


def create(path: Path, meta: dict[str, str]) -> tuple[sqlite3.Connection, WriterLock]:
    """Make a scan file with these values in ``meta`` and no frames, and open it for writing.

    Its name appears when the file is whole. Raises InputError where one exists, ScanError.
    """
    if path.exists():
        raise _exists(path)
    lock = WriterLock(path)
    new = _being_made(path)
    try:
        try:
            new.unlink(missing_ok=True)  # of one who was killed just here
            os.close(os.open(new, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o666))
            with storage(path), closing(_connect(new, "rw")) as db:
                db.execute("PRAGMA synchronous = FULL")
                db.execute(f"PRAGMA application_id = {APPLICATION_ID}")
                db.execute(f"PRAGMA user_version = {VERSION}")
                db.execute("BEGIN EXCLUSIVE")
                for table in SCHEMA:
                    db.execute(table)
                for key, value in meta.items():
                    write_meta(db, key, value)
                db.execute("COMMIT")
            put_in_place(new, path)
        except OSError as e:
            raise _refused(path, e) from None
        finally:
            with suppress(OSError):
                remove(new)
        return _open_for_writing(path), lock
    except BaseException:
        lock.release()
        raise


def _being_made(path: Path) -> Path:
    return path.with_name(f".{path.name}.new")


def put_in_place(new: Path, path: Path) -> None:
    """Give a file its name, which may not be taken by now; where it was it may stand as well."""
    try:
        os.link(new, path)
    except FileExistsError:
        raise _exists(path) from None
    except OSError:  # a file system without links
        if path.exists():
            raise _exists(path) from None
        os.replace(new, path)
    sync_folder(path)


def _exists(path: Path) -> InputError:
    return InputError(f"{path}: already exists", hint="choose another name")


def _refused(path: Path, e: OSError) -> TurnscanError:
    if isinstance(e, TurnscanError):
        return e
    if e.errno in (errno.ENOSPC, errno.EDQUOT):
        return full(path)
    return ScanError(
        f"{path}: cannot be created ({e.strerror})", hint="check the folder and its permissions"
    )


def open_writing(path: Path) -> tuple[sqlite3.Connection, WriterLock]:
    """Open a scan file to add frames. Raises ScanBusy where another process is writing it."""
    judge_header(path)
    lock = WriterLock(path)
    try:
        return _open_for_writing(path), lock
    except BaseException:
        lock.release()
        raise


def _open_for_writing(path: Path) -> sqlite3.Connection:
    with suppress(OSError):
        _being_made(path).unlink(missing_ok=True)  # of one who was killed when it had its name
    with storage(path, was_there=True):
        db = _connect(path, "rw")
        with _closed_if_refused(db):
            _judge_schema(db, path)
            # Readers may look on, and every commit is on the disk when it returns. Other writers
            # are kept out by the lock; who is in the way here only reads, and is soon done.
            db.execute(f"PRAGMA busy_timeout = {_PATIENCE_MS}")
            db.execute("PRAGMA journal_mode = WAL")
            db.execute("PRAGMA synchronous = FULL")
            db.execute("BEGIN EXCLUSIVE")
            db.execute("COMMIT")
            db.execute("PRAGMA busy_timeout = 0")
    return db


def open_reading(path: Path) -> sqlite3.Connection:
    """Open a scan file read-only, after its header and its schema are found to be in order."""
    judge_header(path)
    with storage(path, was_there=True):
        db = _connect(path, "ro")
        with _closed_if_refused(db):
            db.execute("PRAGMA query_only = ON")
            _judge_schema(db, path)
    return db


def checkpoint(db: sqlite3.Connection) -> None:
    """Bring what was committed into the one file that people copy, as far as that can be done now.

    What was committed is safe in the side file all the same, so that a failure here is none.
    """
    with contextlib.suppress(sqlite3.OperationalError):
        db.execute("PRAGMA wal_checkpoint(PASSIVE)")


def seal(db: sqlite3.Connection) -> None:
    """Bring a written file back to one single file, whole and synced.

    While somebody reads it, it stays in write-ahead mode with its side files, no less whole; the
    next writer tidies up.
    """
    db.execute(f"PRAGMA busy_timeout = {_PATIENCE_MS}")
    try:
        db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        db.execute("PRAGMA journal_mode = DELETE")
    except sqlite3.OperationalError as e:
        if not (e.sqlite_errorname or "").startswith(("SQLITE_BUSY", "SQLITE_LOCKED")):
            raise


def delete(db: sqlite3.Connection, row: Row) -> None:
    """Take one row of frames away, within the caller's transaction."""
    db.execute("DELETE FROM frames WHERE id = ?", (row.id,))


def write_meta(db: sqlite3.Connection, key: str, value: str) -> None:
    """Write one value with its digest, within the caller's transaction."""
    db.execute("REPLACE INTO meta VALUES (?, ?, ?)", (key, value, _meta_digest(key, value)))


def read_meta(db: sqlite3.Connection, path: Path) -> dict[str, str]:
    """All values, each compared with its digest. Raises ScanCorrupt naming the key."""
    out: dict[str, str] = {}
    with storage(path):
        for key, value, digest in db.execute("SELECT key, value, sha256 FROM meta"):
            if not isinstance(key, str) or not isinstance(value, str):
                raise damaged(path, "its table of settings")
            if digest != _meta_digest(key, value):
                raise damaged(path, f"its {key!r} does not match its checksum")
            out[key] = value
    return out


def insert(db: sqlite3.Connection, row: Row, payload: bytes) -> int:
    """Write one row of frames, within the caller's transaction; returns its number."""
    floats = (row.commanded, row.measured, row.sigma, row.noise, row.level, row.time)
    db.execute(
        "INSERT INTO frames VALUES (NULL, ?,?,?,?, ?,?,?,?,?,?, ?,?,?,?, ?,?,?)",
        (
            row.kind,
            row.step,
            row.laser,
            row.exposure,
            *(None if math.isnan(f) else f for f in floats),
            row.settings,
            row.width,
            row.height,
            row.codec,
            row.payload_sha256,
            row.digest(),
            payload,
        ),
    )
    return int(db.execute("SELECT last_insert_rowid()").fetchone()[0])


def read_rows(db: sqlite3.Connection, path: Path, largest: int) -> list[Row]:
    """All rows without their payloads, in order of laser, step and exposure.

    Each is compared with its digest; a payload of more than ``largest`` bytes is refused.
    Raises ScanCorrupt naming the row.
    """
    rows: list[Row] = []
    with storage(path):
        for values in db.execute(f"SELECT {_COLUMNS} FROM frames"):  # noqa: S608 (our constant)
            row = _row(values, path)
            if row.digest() != values[-2]:
                raise damaged(path, f"{row} does not match its checksum")
            if values[-1] > largest:
                raise damaged(path, f"{row} holds {values[-1]} bytes, at most {largest} fit")
            rows.append(row)
    rows.sort(key=lambda r: (r.laser, r.step, r.exposure))
    return rows


def read_payload(db: sqlite3.Connection, row: Row, path: Path) -> bytes:
    """The payload of one row, for `check_payload`. Raises ScanCorrupt naming the row."""
    with storage(path):
        found = db.execute("SELECT payload FROM frames WHERE id = ?", (row.id,)).fetchone()
    if found is None or not isinstance(found[0], bytes):
        raise damaged(path, f"the pixels of {row} are missing")
    return found[0]


def check_payload(payload: bytes, row: Row, path: Path) -> bytes:
    """The payload, if it agrees with its row's digest. Raises ScanCorrupt naming the row."""
    if hashlib.sha256(payload).digest() != row.payload_sha256:
        raise damaged(path, f"the pixels of {row} do not match their checksum")
    return payload


def quick_check(db: sqlite3.Connection, path: Path) -> None:
    """Let SQLite walk through all pages of the file. Raises ScanCorrupt with its first remark."""
    with storage(path):
        said = db.execute("PRAGMA quick_check(1)").fetchone()
    if said is None or said[0] != "ok":
        raise damaged(path, str(said[0] if said else "no answer").splitlines()[-1])


def digest_of_rows(rows: list[Row]) -> str:
    """One digest for all rows, so that none can vanish unnoticed."""
    total = hashlib.sha256()
    for digest in sorted(r.digest() for r in rows):
        total.update(digest)
    return total.hexdigest()


def sync_folder(path: Path) -> None:
    """Make a new or renamed file's entry in its folder survive a power cut."""
    if os.name == "posix":
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def remove(path: Path) -> None:
    """Delete a scan file and what SQLite keeps beside it."""
    for tail in ("", "-wal", "-shm", "-journal", "-lock"):
        path.with_name(path.name + tail).unlink(missing_ok=True)


def _connect(path: Path, mode: str) -> sqlite3.Connection:
    db = sqlite3.connect(
        f"{path.absolute().as_uri()}?mode={mode}",
        uri=True,
        timeout=0.2 if mode == "ro" else 0.0,
        isolation_level=None,
        check_same_thread=False,
    )
    with _closed_if_refused(db):
        db.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _LARGEST_VALUE)
        for pragma in ("trusted_schema = OFF", "cell_size_check = ON", "mmap_size = 0"):
            db.execute(f"PRAGMA {pragma}")
    return db


@contextmanager
def _closed_if_refused(db: sqlite3.Connection) -> Iterator[None]:
    try:
        yield
    except BaseException:
        db.close()
        raise


def _judge_schema(db: sqlite3.Connection, path: Path) -> None:
    found = db.execute("SELECT type, sql FROM sqlite_schema WHERE sql IS NOT NULL").fetchall()
    if sorted(found) != sorted(("table", table) for table in SCHEMA):
        raise damaged(path, "its tables are not those of a scan file")


def _row(values: tuple[Any, ...], path: Path) -> Row:
    if not all(isinstance(v, kind) for v, kind in zip(values, _KINDS, strict=True)):
        raise damaged(path, f"row {values[0]!r} of its frames")
    floats = (math.nan if v is None else v for v in values[5:11])
    return Row(*values[:5], *floats, *values[11:16])


def _meta_digest(key: str, value: str) -> bytes:
    return hashlib.sha256(f"{key}\0{value}".encode("utf-8", "surrogatepass")).digest()
