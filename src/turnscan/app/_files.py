"""Files that verbs read and write: those of the folder, and those that a browser sends."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import shutil
import threading
from collections.abc import AsyncIterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from turnscan.app._library import SUFFIX, Library, safe_name
from turnscan.app._protocol import FileEntry
from turnscan.errors import InputError, LimitExceeded, UnsafePath
from turnscan.workflows import VERBS, FileKind, Incoming, file_kinds, files_within, unpack

_MOST_SETS = 200
_MOST_IN_A_SET = 20_000
_MOST_LISTED = 1000
_RESULTS = (".svg", ".pdf", ".png", ".html", ".xyz", ".step", ".stp")
"""Files of the folder that no verb reads, but a person wants."""


@dataclass(frozen=True)
class Item:
    """A file, or a folder of pictures, that may be given to a verb."""

    path: Path
    name: str
    """Without the folders that lead to it from where it belongs."""
    kinds: tuple[FileKind, ...]
    sent: bool
    """Whether a browser sent it: then it goes with the server."""


class Files:
    """All files that verbs may take. All methods may be called from any thread.

    Like scans they are found by names that the server gave, never by paths; links are not
    followed.
    """

    def __init__(self, library: Library) -> None:
        self._library = library
        self._incoming: Incoming | None = None
        self._sets: dict[str, Path] = {}
        self._kinds: dict[Path, tuple[tuple[int, int], tuple[FileKind, ...]]] = {}
        self._lock = threading.Lock()

    def items(self) -> dict[str, Item]:
        """Every file by its opaque name; scans are in the library's own list."""
        found = [Item(p, p.name, self._kinds_of(p), False) for p in self._library.others()]
        found = [i for i in found if i.kinds or i.path.suffix.lower() in _RESULTS]
        with self._lock:
            sets = list(self._sets.values())
        for folder in sets:
            found += self._sent(folder)
        return {self._library.listed_as(i.path): i for i in found}

    def find(self, name: str) -> Item:
        """A file or a scan by its opaque name. Raises InputError where there is none."""
        scan = self._library.paths().get(name)
        if scan is not None:
            return Item(scan, scan.name, ("scan",), False)
        try:
            return self.items()[name]
        except KeyError:
            raise InputError("no such file", hint="reload the list") from None

    def table(self, name: str) -> Path:
        """A table of values by the name that the list shows: of several the one sent last.

        Raises InputError for none.
        """
        for item in reversed(self.items().values()):
            if item.name == name and "table" in item.kinds:
                return item.path
        raise InputError("no such file in the list", hint="send the file first")

    def entries(self) -> list[FileEntry]:
        """The list, in the words of the protocol."""
        out = []
        listed = sorted(self.items().items(), key=lambda entry: not entry[1].sent)
        for name, item in listed[:_MOST_LISTED]:
            with contextlib.suppress(OSError):
                out.append(_entry(name, item))
        return out

    async def receive(
        self, given: str, into: str, body: AsyncIterator[bytes], length: int | None
    ) -> tuple[str, list[str]]:
        """Keep a file that is sent, in a set of files or (empty) in a new one.

        Returns the name of the set, and the opaque names of what is in it now. Raises InputError,
        LimitExceeded, StorageFull, and for an archive as `unpack`; then nothing is kept of it.
        """
        name = _plain_name(given)
        made, folder = self._set(into)
        target = folder / name
        try:
            if target.exists():
                raise InputError(f"{name}: sent already", hint="leave it out, or rename it")
            await self._library.receive(target, body, length)
            if not target.stat().st_size:
                target.unlink()
                raise InputError(f"{name}: an empty file", hint="look at it, then send it again")
            if target.suffix.lower() == ".zip":
                place = folder / (target.stem or "archive")
                await asyncio.to_thread(_unpacked, target, place)
            items = await asyncio.to_thread(self._sent, folder)
            if not items:
                raise InputError(
                    f"{name}: neither pictures nor a scan, a mesh, a rig or a table",
                    hint="send pictures (PNG, JPEG, TIFF, BMP), a video, a zip of these, or files "
                    "that turnscan reads",
                )
        except BaseException:
            self._forget(made, into)
            raise
        return made, [self._library.listed_as(i.path) for i in items]

    def close(self) -> None:
        """Take away what was sent."""
        if self._incoming is not None:
            self._incoming.close()

    def incoming(self) -> Path:
        """The hidden folder of what is sent. Raises OSError where it cannot be made."""
        with self._lock:
            return self._incoming_folder()

    def _incoming_folder(self) -> Path:
        if self._incoming is None:
            self._incoming = Incoming(self._library.folder)
        return self._incoming.folder

    def _set(self, into: str) -> tuple[str, Path]:
        with self._lock:
            if into:
                if into not in self._sets:
                    raise InputError("no such set of files", hint="send all files again")
                folder = self._sets[into]
                if sum(1 for _ in folder.iterdir()) >= _MOST_IN_A_SET:
                    raise LimitExceeded(f"more than {_MOST_IN_A_SET} files")
                return into, folder
            if len(self._sets) >= _MOST_SETS:
                raise LimitExceeded("too many files were sent", hint="start turnscan again")
            name = secrets.token_urlsafe(9)
            folder = self._incoming_folder() / name
            folder.mkdir()
            self._sets[name] = folder
            return name, folder

    def _forget(self, made: str, into: str) -> None:
        """Drop a set that was to be begun."""
        if into:
            return
        with self._lock:
            folder = self._sets.pop(made)
        shutil.rmtree(folder, ignore_errors=True)

    def _sent(self, folder: Path) -> list[Item]:
        out = []
        for path in files_within(folder):
            within = path.relative_to(folder).as_posix()
            if path == folder:
                within = next(iter(sorted(p.name for p in folder.iterdir())), "pictures")
            out.append(Item(path, within, self._kinds_of(path), True))
        return out

    def _kinds_of(self, path: Path) -> tuple[FileKind, ...]:
        try:
            status = path.stat()
            state = status.st_mtime_ns, status.st_size
            known = self._kinds.get(path)
            if known is None or known[0] != state:
                known = self._kinds[path] = state, file_kinds(path)
        except OSError:
            return ()
        return known[1]


def _unpacked(archive: Path, place: Path) -> None:
    """Take an archive apart into a new folder; it goes, and what there is of it where it fails."""
    try:
        place.mkdir()
    except FileExistsError:
        archive.unlink()
        raise InputError(f"{archive.name}: sent already", hint="rename the archive") from None
    try:
        unpack(archive, place)
    except BaseException:
        shutil.rmtree(place, ignore_errors=True)
        raise
    finally:
        archive.unlink()


def _entry(name: str, item: Item) -> FileEntry:
    status = item.path.stat()
    size, pictures = status.st_size, 0
    if item.path.is_dir():
        inside = [p.stat().st_size for p in item.path.iterdir() if p.is_file()]
        size, pictures = sum(inside), len(inside)
    at = datetime.fromtimestamp(status.st_mtime, UTC)
    return FileEntry(
        file=name,
        name=item.name[:200],
        kinds=list(item.kinds),
        pictures=pictures,
        megabytes=size / 1e6,
        modified=at.isoformat(timespec="seconds"),
        sent=item.sent,
        takers=[
            v.name for v in VERBS.values()
            if any(set(f.accepts) & set(item.kinds) for f in v.inputs)
        ],
    )  # fmt: skip


def _plain_name(given: str) -> str:
    """A file name without folders, its suffix kept. Raises UnsafePath, InputError."""
    if "/" in given or "\\" in given or given in ("", ".", ".."):
        raise UnsafePath("not a plain file name", hint="send files by their own names")
    stem, dot, suffix = given.rpartition(".")
    if not dot or not stem or not suffix.isalnum() or len(suffix) > 10:
        raise InputError(
            f"{given[:80]}: no suffix says what kind of file it is", hint="rename it, as part.stl"
        )
    if f".{suffix}".lower() == SUFFIX:
        raise InputError("a scan file belongs into the list of scans", hint="send it there")
    return f"{safe_name(stem)}.{suffix}"
