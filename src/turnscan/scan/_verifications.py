"""The history of verifications: an SQLite file that gains one run each time."""

from __future__ import annotations

import math
import os
import sqlite3
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from turnscan.errors import FormatError, InputError, ScanError, ScanNewer
from turnscan.scan._database import transaction
from turnscan.scan._storage import damaged, storage

APPLICATION_ID = 0x54524E56  # "TRNV"
VERSION = 1
_MAGIC = b"SQLite format 3\0"
_HINT = "name a history made by turnscan verify, or a new file"
_PATIENCE_MS = 2000
_SCHEMA = (
    "CREATE TABLE runs (id INTEGER PRIMARY KEY, time REAL NOT NULL, artefact TEXT NOT NULL,"
    " artefact_key TEXT NOT NULL, rig_key TEXT NOT NULL, program TEXT NOT NULL) STRICT",
    "CREATE TABLE figures (run INTEGER NOT NULL REFERENCES runs (id), scan INTEGER NOT NULL,"
    " source TEXT NOT NULL, name TEXT NOT NULL, value REAL NOT NULL, noise REAL NOT NULL,"
    " calibration REAL, artefact REAL NOT NULL, limit_mm REAL, UNIQUE (run, scan, name)) STRICT",
)


@dataclass(frozen=True)
class VerifiedFigure:
    """One test value of one scan, mm, as a history keeps it."""

    scan: int
    """Of the run, from 0."""
    source: str
    """Name of the file."""
    name: str
    """Test and place."""
    value: float
    noise: float
    calibration: float
    """NaN where not known."""
    artefact: float
    limit: float | None


@dataclass(frozen=True)
class VerifiedRun:
    """One verification."""

    time: float
    """Seconds since 1970, UTC."""
    artefact: str
    """Its name."""
    artefact_key: str
    """Digest of its dimensions: runs with another key are not compared."""
    rig_key: str
    """Digest of the rig; empty where it is not known."""
    program: str
    """Version of turnscan."""
    figures: tuple[VerifiedFigure, ...]


def read_verifications(path: Path) -> list[VerifiedRun]:
    """All runs of a history, in the order of their time; none where there is no file yet.

    Raises FormatError for a file that is no history, ScanNewer for one of a newer turnscan,
    ScanCorrupt, ScanBusy and InputError for a folder.
    """
    if not path.exists():
        return []
    _judge(path)
    with storage(path), closing(_connect(path, "ro")) as db:
        db.execute("PRAGMA query_only = ON")
        _judge_schema(db, path)
        figures = dict[int, list[VerifiedFigure]]()
        for run, *f in db.execute("SELECT * FROM figures ORDER BY run, scan, rowid"):
            known = math.nan if f[5] is None else f[5]
            one = VerifiedFigure(f[0], f[1], f[2], f[3], f[4], known, f[6], f[7])
            figures.setdefault(run, []).append(one)
        rows = db.execute("SELECT * FROM runs ORDER BY time, id").fetchall()
    return [
        VerifiedRun(time, artefact, key, rig, program, tuple(figures.get(number, ())))
        for number, time, artefact, key, rig, program in rows
    ]


def add_verification(path: Path, run: VerifiedRun) -> None:
    """Add one run, wholly or not at all; makes the file where there is none.

    Raises as `read_verifications`, and ScanError where it cannot be written, StorageFull.
    """
    if path.exists():
        _judge(path)
    else:
        _create(path)
    with storage(path), closing(_connect(path, "rw")) as db:
        _judge_schema(db, path)
        with transaction(db):
            made = db.execute(
                "INSERT INTO runs VALUES (NULL, ?, ?, ?, ?, ?)",
                (run.time, run.artefact, run.artefact_key, run.rig_key, run.program),
            )
            db.executemany(
                "INSERT INTO figures VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
                [(made.lastrowid, *_row(f)) for f in run.figures],
            )


def _row(f: VerifiedFigure) -> tuple[object, ...]:
    known = None if math.isnan(f.calibration) else f.calibration
    return f.scan, f.source, f.name, f.value, f.noise, known, f.artefact, f.limit


def _judge(path: Path) -> None:
    """Raise what is wrong with a file, before SQLite sees any of it."""
    if path.is_dir():
        raise InputError(f"{path}: a folder, not a history", hint=_HINT)
    try:
        with path.open("rb") as file:
            head = file.read(100)
    except OSError as e:
        raise ScanError(f"{path}: cannot be read ({e.strerror})") from None
    ours = head.startswith(_MAGIC) and int.from_bytes(head[68:72], "big") == APPLICATION_ID
    if not ours:
        raise FormatError(f"{path}: not a history of verifications", hint=_HINT)
    version = int.from_bytes(head[60:64], "big")
    if version > VERSION:
        raise ScanNewer(
            f"{path}: version {version} of the history; this turnscan knows up to {VERSION}",
            hint="install a newer turnscan",
        )
    if version < 1:
        raise damaged(path, f"version {version} does not exist")


def _judge_schema(db: sqlite3.Connection, path: Path) -> None:
    """Raise ScanCorrupt unless the tables are ours to the letter."""
    rows = db.execute("SELECT sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY rowid")
    if [row[0] for row in rows] != list(_SCHEMA):
        raise damaged(path, "its tables are not those of a history")


def _create(path: Path) -> None:
    """An empty history; its name appears when it is whole."""
    new = path.with_name(f".{path.name}.{os.getpid()}.new")
    try:
        os.close(os.open(new, os.O_CREAT | os.O_EXCL | os.O_RDWR, 0o666))
        with storage(path), closing(_connect(new, "rw")) as db:
            db.execute(f"PRAGMA application_id = {APPLICATION_ID}")
            db.execute(f"PRAGMA user_version = {VERSION}")
            with transaction(db):
                for table in _SCHEMA:
                    db.execute(table)
        new.replace(path)
    except OSError as e:
        if isinstance(e, ScanError):
            raise
        raise ScanError(
            f"{path}: cannot be created ({e.strerror})", hint="check the folder and its permissions"
        ) from None
    finally:
        new.unlink(missing_ok=True)


def _connect(path: Path, mode: str) -> sqlite3.Connection:
    db = sqlite3.connect(f"{path.absolute().as_uri()}?mode={mode}", uri=True, isolation_level=None)
    db.execute("PRAGMA trusted_schema = OFF")
    db.execute("PRAGMA synchronous = FULL")
    db.execute(f"PRAGMA busy_timeout = {_PATIENCE_MS}")
    return db
