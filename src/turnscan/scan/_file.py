"""Scan: the archive of what the camera saw, one crash-safe file."""

from __future__ import annotations

import hashlib
import math
import sqlite3
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from os import PathLike
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Self, TypeVar

import numpy as np

from turnscan import __version__
from turnscan.arrays import Floats, Image
from turnscan.errors import InputError, ScanCorrupt, ScanError
from turnscan.rig import Rig, rig_from_json, rig_to_json
from turnscan.scan import _database as database
from turnscan.scan import _edit_log as edit_log
from turnscan.scan._codec import Dark, Project, encode
from turnscan.scan._database import Row, checkpoint, transaction
from turnscan.scan._edit_log import LogEntry
from turnscan.scan._index import Index, form_of
from turnscan.scan._lock import WriterLock, being_written
from turnscan.scan._plan import (
    Frame,
    ScanPlan,
    Setting,
    plan_from_json,
    plan_to_json,
    settings_from_json,
    settings_to_json,
)
from turnscan.scan._signal import sampled_signal, statistics
from turnscan.scan._storage import storage
from turnscan.scan._stored import Stored
from turnscan.scan._unpack import Unpacker

T = TypeVar("T")


class Scan:
    """A scan file, open for reading or for writing; use it as a context manager.

    Frames are on the disk when `add` returns (SQLite, write-ahead log, ``synchronous=FULL``): a
    crash loses at most the one in flight. Closing brings everything back to one single file.
    """

    def __init__(
        self,
        path: Path,
        db: sqlite3.Connection,
        lock: WriterLock | None,
        meta: Mapping[str, str],
    ) -> None:
        """For `create`, `open` and `resume`, which judge what they open."""
        if "plan" not in meta:
            raise ScanCorrupt(f"{path}: damaged: it has no plan", hint="import or scan again")
        self.path = path
        self.plan = plan_from_json(meta["plan"], f"{path}: plan")
        self.rig = rig_from_json(meta["rig"], f"{path}: rig") if "rig" in meta else None
        self.acquisition = meta.get("acquisition", "")
        """How the frames are taken, as JSON of whoever takes them; empty for an import."""
        self.settings = meta.get("settings", "")
        """How its surface was last made, as JSON of whoever makes it; empty where not given."""
        self.writing = lock is not None
        self._lock = lock
        self.sealed = False
        """Whether the file was closed properly, with all the frames it had then."""
        self._db = db
        self._index = Index(path, self.plan)
        self._unpacker = Unpacker(path, self.plan, self._index, self._payload)
        self._last_edit: LogEntry | None = None
        self._closed = False
        self._thread = threading.RLock()

    @classmethod
    def create(
        cls, path: str | Path, plan: ScanPlan, rig: Rig | None = None, acquisition: str = ""
    ) -> Self:
        """Make a new scan file and lock it for writing; ``acquisition`` is kept for `resume`.

        Raises InputError where the file exists, ScanError where it cannot be created.
        """
        path = Path(path)
        meta = {"software": f"turnscan {__version__}", "plan": plan_to_json(plan)}
        if rig is not None:
            meta["rig"] = rig_to_json(rig)
        if acquisition:
            meta["acquisition"] = acquisition
        return cls(path, *database.create(path, meta), meta)

    @classmethod
    def open(cls, path: str | PathLike[str]) -> Self:
        """Open a scan file read-only, also while it is being written: then it shows the frames
        that are there now (`being_written`).

        Raises InputError where there is none, FormatError where it is something else, ScanNewer,
        and ScanCorrupt naming the damaged place.
        """
        return cls._load(Path(path), writing=False)

    @classmethod
    def resume(cls, path: str | PathLike[str]) -> Self:
        """Open a scan file to add the frames that are missing.

        Raises like `open`, and ScanBusy where another process is writing it.
        """
        return cls._load(Path(path), writing=True)

    @classmethod
    def _load(cls, path: Path, writing: bool) -> Self:
        lock = None
        if writing:
            db, lock = database.open_writing(path)
        else:
            db = database.open_reading(path)
        try:
            if not writing:
                db.execute("BEGIN")  # one view of values and rows, though somebody may be writing
            meta = database.read_meta(db, path)
            scan = cls(path, db, lock, meta)
            scan._read_rows(meta.get("seal"))
            if not writing:
                db.execute("COMMIT")
        except BaseException:
            db.close()
            if lock is not None:
                lock.release()
            raise
        return scan

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Seal what was written, back to one single file, and let go of it. Twice is fine."""
        with self._thread:
            if self._closed:
                return
            self._closed = True
            try:
                if self.writing:
                    with storage(self.path):
                        with transaction(self._db):
                            database.write_meta(self._db, "seal", self._index.seal())
                        database.seal(self._db)
            finally:
                self._db.close()
                if self._lock is not None:
                    self._lock.release()

    # Writing

    def add(self, frame: Frame) -> float:
        """Store one frame; it is on the disk when this returns the share of pixels it keeps.

        A frame without ``dark`` refers to the laser's background, where there is one. ``noise`` and
        ``level`` are measured where they are NaN. Raises InputError where the frame does not fit
        the plan or is there already, StorageFull, ScanError.
        """
        self._index.free(frame.laser, frame.step, frame.exposure)
        self._check_picture(frame.lit, f"lit picture of step {frame.step}")
        background = self.background(frame.laser)
        dark: Dark = "own" if frame.dark is not None else "background"
        off = background if frame.dark is None else frame.dark
        if off is None:
            dark = "none"
        else:
            self._check_picture(off, f"dark picture of step {frame.step}")
        seen = statistics(sampled_signal(frame.lit, off, self.plan.weights))
        bright = seen.level + self.plan.threshold
        payload, share = encode(frame.lit, off, dark == "own", bright, self.plan)
        row = self._new_row(
            "lit", frame, dark, payload, settings_to_json(frame.settings), seen.noise, seen.level
        )
        self._insert(row, payload)
        return share

    def add_missing(
        self, step: int, laser: str, cause: str, commanded: float = math.nan, exposure: int = 0
    ) -> None:
        """Record that there is no frame here, and why. Raises InputError like `add`."""
        self._index.free(laser, step, exposure)
        nothing = Frame(
            step, laser, np.zeros((1, 1), np.uint8), exposure=exposure, commanded=commanded
        )
        text = settings_to_json({"cause": cause})
        row = self._new_row("missing", nothing, "none", b"", text, math.nan, math.nan)
        self._insert(row, b"")

    def add_texture(
        self,
        step: int,
        picture: Image,
        commanded: float = math.nan,
        time: float = math.nan,
        settings: Mapping[str, Setting] = MappingProxyType({}),
    ) -> None:
        """Store a whole picture without laser light, for the colour of the surface.

        Raises InputError where it does not fit the plan, or where there is one already.
        """
        if not 0 <= step < self.plan.steps or step in self._index.textures:
            raise InputError(f"{self.path}: no (second) texture for step {step}")
        self._check_picture(picture, f"texture of step {step}")
        whole = _whole(self.plan)
        payload, _ = encode(picture, None, False, 0.0, whole)
        frame = Frame(step, "", picture, commanded=commanded, time=time)
        text = settings_to_json(settings)
        row = self._new_row("texture", frame, "none", payload, text, math.nan, math.nan)
        self._insert(row, payload)

    def forget(self, laser: str, step: int, exposure: int = 0) -> None:
        """Take a frame, or the record that there is none, away, to be taken again.

        Raises InputError where there is nothing of the kind.
        """
        row = self._index.row(laser, step, exposure)
        if row is None:
            raise InputError(f"{self.path}: there is no step {step} of laser {laser!r} to forget")
        self._write(lambda: database.delete(self._db, row))
        self._index.remove(row)

    def add_background(self, laser: str, picture: Image) -> None:
        """Store the picture without the laser that later frames of this laser refer to.

        Raises InputError where it does not fit the plan, or where there is one already.
        """
        if laser not in self.plan.lasers or laser in self._index.backgrounds:
            raise InputError(f"{self.path}: no (second) background for laser {laser!r}")
        self._check_picture(picture, f"background of laser {laser}")
        whole = _whole(self.plan)
        payload, _ = encode(picture, None, False, 0.0, whole)
        frame = Frame(0, laser, picture)
        row = self._new_row("background", frame, "none", payload, "{}", math.nan, math.nan)
        self._insert(row, payload)
        self._unpacker.keep(laser, picture.copy())

    def append_edit(self, text: str, time: float = math.nan) -> LogEntry:
        """Add an entry to the log of edits; it is on the disk when this returns.

        Frames and their seal stay as they are. Raises InputError where the scan is open for
        reading, StorageFull, ScanCorrupt where the log is damaged, ScanError.
        """
        self._must_write()
        with self._reached():
            if self._last_edit is None:
                self._last_edit = next(reversed(self.edits()), None)
            with storage(self.path), transaction(self._db):
                new = edit_log.append(self._db, self.path, self._last_edit, text, time)
            checkpoint(self._db)
            self._last_edit = new
        return new

    def keep_settings(self, text: str) -> None:
        """Replace `settings`; they are on the disk when this returns.

        Frames and their seal stay as they are. Raises InputError in a file open for reading,
        StorageFull, ScanError.
        """
        self._must_write()
        with self._reached():
            with storage(self.path), transaction(self._db):
                database.write_meta(self._db, "settings", text)
            checkpoint(self._db)
        self.settings = text

    # Reading

    def edits(self) -> tuple[LogEntry, ...]:
        """The log of edits, oldest first; `turnscan.edit.history_from_log` reads their texts.

        Raises ScanCorrupt naming the first entry that is damaged.
        """
        with self._reached():
            return tuple(edit_log.read(self._db, self.path))

    def frames(self, laser: str | None = None, project: Project | None = None) -> Iterator[Frame]:
        """Frames in step order, of one laser or of all, one laser after the other.

        ``project`` turns colour pixels (H, W, 3) into the signal (H, W); it is applied to the kept
        pixels alone, which is far cheaper than to whole pictures, and must be linear up to a shift,
        with the plan's weights; noise and level are then in its grey levels. Grey frames ignore it.
        Raises ScanCorrupt naming the frame.
        """
        return (stored.decode() for stored in self.stored(laser, project))

    def stored(self, laser: str | None = None, project: Project | None = None) -> Iterator[Stored]:
        """Like `frames`, not yet read: give these to a pool of threads, and close nothing."""
        for row in self._index.in_order(laser):
            yield self._unpacker.stored(row, project)

    def frame(
        self, step: int, laser: str = "", exposure: int = 0, project: Project | None = None
    ) -> Frame:
        """One frame, of the first laser where none is named.

        Raises InputError where there is none.
        """
        laser = laser or self.plan.lasers[0]
        row = self._index.row(laser, step, exposure)
        if row is None or row.kind != "lit":
            cause = self.missing(laser).get(step, "it was not taken")
            raise InputError(f"{self.path}: no frame at step {step} of laser {laser!r} ({cause})")
        return self._unpacker.stored(row, project).decode()

    def angles(self, laser: str | None = None) -> Floats:
        """(n,) rad, the table's angle of each frame in the order of `frames`; NaN where unknown."""
        rows = self._index.in_order(laser)
        return np.array(
            [r.commanded if math.isnan(r.measured) else r.measured for r in rows], np.float64
        )

    def steps(self, laser: str | None = None) -> list[int]:
        """Step number of each frame in the order of `frames`."""
        return [r.step for r in self._index.in_order(laser)]

    def missing(self, laser: str) -> dict[int, str]:
        """Steps of a laser that have no frame of any exposure, with the cause."""
        return self._index.missing(laser)

    def has(self, laser: str, step: int, exposure: int = 0) -> bool:
        """Whether there is a frame, or a record of why there is none."""
        return self._index.row(laser, step, exposure) is not None

    def has_texture(self, step: int) -> bool:
        """Whether there is a picture without laser light of this step."""
        return step in self._index.textures

    @property
    def texture_angles(self) -> dict[int, float]:
        """Steps that have a picture without laser light, in order, and the commanded angle, rad."""
        return {step: row.commanded for step, row in sorted(self._index.textures.items())}

    def texture(self, step: int) -> Frame:
        """The picture without laser light of a step. Raises InputError where there is none."""
        row = self._index.textures.get(step)
        if row is None:
            raise InputError(f"{self.path}: no texture at step {step}")
        settings = settings_from_json(row.settings, f"{self.path}: {row}")
        picture = self._unpacker.whole(row)
        return Frame(step, "", picture, commanded=row.commanded, time=row.time, settings=settings)

    def damaged(self) -> list[tuple[str, int, int]]:
        """Laser, step and exposure of every frame whose pixels are not what was stored."""
        rows = self._index.in_order(None)
        return [(r.laser, r.step, r.exposure) for r in rows if _trouble(partial(self._check, r))]

    @property
    def being_written(self) -> bool:
        """Whether a living process is writing the file; it may be this one."""
        return self.writing or being_written(self.path)

    @property
    def last_angle(self) -> float:
        """rad, where the table was at the last frame stored; NaN where that is unknown."""
        last = self._index.last
        if last is None:
            return math.nan
        return last.commanded if math.isnan(last.measured) else last.measured

    def background(self, laser: str) -> Image | None:
        """(H, W) or (H, W, 3): what the frames of a laser refer to as dark, or None."""
        return self._unpacker.background(laser)

    @property
    def complete(self) -> bool:
        """Whether every exposure of every step and laser is there, or a record of why it is not."""
        return self._index.complete

    @property
    def digest(self) -> str:
        """Names the pictures that are there now: other where one of them is another."""
        return hashlib.sha256(self._index.seal().encode()).hexdigest()

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._index)

    def verify(self) -> Iterator[tuple[str, ScanError | None]]:
        """Read and check everything there is: the name of each part, and what is wrong with it."""
        with self._reached():
            yield "the file's pages", _trouble(lambda: database.quick_check(self._db, self.path))
        for laser, row in self._index.backgrounds.items():
            yield str(row), _trouble(partial(self.background, laser))
        for row in self._index.in_order(None):
            yield str(row), _trouble(partial(self._check, row))
        for step, row in sorted(self._index.textures.items()):
            yield str(row), _trouble(partial(self.texture, step))
        yield "the log of edits", _trouble(self.edits)

    # Inside

    @contextmanager
    def _reached(self) -> Iterator[None]:
        """The file, for one thread alone. Raises InputError where it was closed meanwhile."""
        with self._thread:
            if self._closed:
                raise InputError(
                    f"{self.path}: the scan was closed meanwhile", hint="open it again"
                )
            yield

    def _check(self, row: Row) -> None:
        self._unpacker.stored(row, None).decode()

    def _payload(self, row: Row) -> bytes:
        with self._reached():
            payload = database.read_payload(self._db, row, self.path)
        return database.check_payload(payload, row, self.path)

    def _check_picture(self, picture: Image, what: str) -> None:
        if picture.shape != self.plan.shape or picture.dtype != self.plan.dtype:
            raise InputError(
                f"{what}: {_kind(picture.shape, str(picture.dtype))}; the scan has "
                f"{_kind(self.plan.shape, self.plan.dtype)}",
                hint="all pictures of one scan must have one size and type",
            )

    def _new_row(
        self,
        kind: str,
        frame: Frame,
        dark: Dark,
        payload: bytes,
        settings: str,
        noise: float,
        level: float,
    ) -> Row:
        return Row(
            id=0,
            kind=kind,
            step=frame.step,
            laser=frame.laser,
            exposure=frame.exposure,
            commanded=frame.commanded,
            measured=frame.measured,
            sigma=frame.angle_sigma,
            noise=noise if math.isnan(frame.noise) else frame.noise,
            level=level if math.isnan(frame.level) else frame.level,
            time=frame.time,
            settings=settings,
            width=self.plan.width,
            height=self.plan.height,
            codec=f"{form_of(kind, self.plan)}.{dark}",
            payload_sha256=hashlib.sha256(payload).digest(),
        )

    def _insert(self, row: Row, payload: bytes) -> None:
        number = self._write(lambda: database.insert(self._db, row, payload))
        object.__setattr__(row, "id", number)
        self._index.add(row)

    def keep_acquisition(self, text: str) -> None:
        """Replace `acquisition`. Raises InputError in a file open for reading, ScanError."""
        self._write(lambda: database.write_meta(self._db, "acquisition", text))
        self.acquisition = text

    def _write(self, change: Callable[[], T]) -> T:
        """One transaction; the file is no longer what it was closed with."""
        self._must_write()
        with self._reached(), storage(self.path), transaction(self._db):
            if self.sealed:
                self._db.execute("DELETE FROM meta WHERE key = 'seal'")
            done = change()
        self.sealed = False
        return done

    def _must_write(self) -> None:
        if not self.writing:
            raise InputError(f"{self.path}: open for reading only")

    def _read_rows(self, seal: str | None) -> None:
        itemsize = np.dtype(self.plan.dtype).itemsize
        most = 2 * self.plan.width * self.plan.height * (self.plan.channels * itemsize + 8) + 4096
        for row in database.read_rows(self._db, self.path, most):
            self._index.believe(row)
            self._index.add(row)
        if seal is not None:
            if seal != self._index.seal():
                raise ScanCorrupt(
                    f"{self.path}: damaged: its frames differ from those it was closed with",
                    hint="take a copy from a backup, or scan or import again",
                )
            self.sealed = True


def _trouble(check: Callable[[], object]) -> ScanError | None:
    try:
        check()
    except ScanError as e:
        return e
    except InputError as e:  # right checksums around something that is no frame
        return ScanCorrupt(e.message, hint=e.hint)
    return None


def _whole(plan: ScanPlan) -> ScanPlan:
    return replace(plan, keep="full")


def _kind(shape: tuple[int, ...], dtype: str) -> str:
    colour = "colour" if len(shape) == 3 else "grey"
    return f"{shape[1]}×{shape[0]} {colour} {dtype}"
