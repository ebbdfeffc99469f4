"""Library: the scan files that the workshop offers, by names that lead nowhere else."""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import shutil
import threading
import unicodedata
from collections.abc import AsyncIterator, Callable
from datetime import UTC, datetime
from pathlib import Path

from turnscan import workflows
from turnscan.app._protocol import FindingCounts, ScanEntry
from turnscan.errors import (
    ExportError,
    InputError,
    LimitExceeded,
    ScanError,
    StorageFull,
)
from turnscan.workflows import ScanGlance, duplicate_scan, glance_at, open_scan

SUFFIX = ".turnscan"
UPLOAD_BYTES = 2**30
_RESERVE = 200_000_000
"""Bytes that stay free on the disk."""
_LONGEST_NAME = 80
_MOST_RIGS = 200
_SENT = re.compile(r"\.turnscan-incoming-[0-9a-f]+/[\w-]+/?")
"""Where files are that a browser sent."""
_BESIDE = ("-lock", "-wal", "-shm", "-journal")
"""Ends of names of files that stand beside a scan file while it is written."""
_RESERVED = re.compile(r"(?i)^(con|prn|aux|nul|com\d|lpt\d)(\.|$)")


class Library:
    """Scan files of one folder, or one of them alone. All methods may be called from any thread.

    Files are found by names that the library gave, never by paths, so that no request can lead out
    of the folder; links are not followed.
    """

    def __init__(self, folder: Path, only: Path | None = None) -> None:
        self.folder = folder.resolve()
        self._only = None if only is None else {only.resolve()}
        self._names: dict[Path, str] = {}
        self._seen: dict[Path, tuple[list[tuple[int, int]], ScanGlance]] = {}
        """What is known of files that were last changed then and are so large."""
        self.counts: Callable[[Path, str], FindingCounts | None] = lambda path, content: None
        """What was found in a scan of this content when it was last open; None where not known."""
        self._lock = threading.Lock()

    def paths(self) -> dict[str, Path]:
        """Every file by its opaque name."""
        found = sorted(self.folder.glob(f"*{SUFFIX}"), key=lambda p: p.name.lower())
        files = [p for p in found if p.name[0] != "." and p.is_file() and not p.is_symlink()]
        if self._only is not None:
            files = [p for p in files if p in self._only]
        with self._lock:
            return {self._names.setdefault(p, secrets.token_urlsafe(9)): p for p in files}

    def path(self, name: str) -> Path:
        """The file of an opaque name. Raises InputError where there is none."""
        try:
            return self.paths()[name]
        except KeyError:
            raise InputError("no such scan", hint="reload the list") from None

    def gone(self, name: str) -> bool:
        """Whether an opaque name is that of a file which was here, and is here no longer."""
        with self._lock:
            known = name in self._names.values()
        return known and name not in self.paths()

    def others(self) -> list[Path]:
        """Files of the folder that are no scans, and folders in it; of one scan alone, its own."""
        try:
            found = sorted(self.folder.iterdir(), key=lambda p: p.name.lower())
        except OSError:  # the disk it is on has gone
            return []
        return [
            p
            for p in found
            if not p.name.startswith(".")
            and p.suffix != SUFFIX
            and not p.is_symlink()
            and (p.is_file() or p.is_dir())
            and (self._only is None or p in self._only)
        ]

    def listed_as(self, path: Path) -> str:
        """The opaque name of a file that is listed elsewhere."""
        with self._lock:
            return self._names.setdefault(path, secrets.token_urlsafe(9))

    def entries(self, is_open: frozenset[str]) -> list[ScanEntry]:
        """The list, in the words of the protocol."""
        out = []
        for name, path in self.paths().items():
            with contextlib.suppress(OSError):
                status = path.stat()
                at = datetime.fromtimestamp(status.st_mtime, UTC)
                seen = self.glance(path)
                out.append(
                    ScanEntry(
                        scan=name,
                        name=path.stem[:200] or "scan",
                        megabytes=status.st_size / 1e6,
                        modified=at.isoformat(timespec="seconds"),
                        open=name in is_open,
                        missing=seen.missing,
                        content=seen.content,
                        simulated=seen.simulated,
                        findings=self.counts(path, seen.content),
                    )
                )
        return out

    def glance(self, path: Path) -> ScanGlance:
        """What is known of a file, whatever it is, without making its surface."""
        files = [f for f in (path, path.with_name(path.name + "-wal")) if f.exists()]
        state = [(f.stat().st_mtime_ns, f.stat().st_size) for f in files]
        known = self._seen.get(path)
        if known is not None and known[0] == state:
            return known[1]
        seen = glance_at(path)
        self._seen[path] = state, seen
        return seen

    def moved(self, path: Path, target: Path) -> None:
        """A scan file has another name now; its opaque name stays."""
        with self._lock:
            if path in self._names:
                self._names[target] = self._names.pop(path)
            if self._only is not None and path in self._only:
                self._only = self._only - {path} | {target}

    def new_path(self, name: str) -> Path:
        """Where a new scan of this name goes. Raises as `new_file`."""
        return self.new_file(name, SUFFIX)

    def new_file(self, name: str, suffix: str) -> Path:
        """Where a new file of this name goes: a plain name in the folder, never one that is taken.

        Raises InputError where nothing of the name is left, or the name is taken.
        """
        path = self.folder / (safe_name(name.removesuffix(suffix)) + suffix)
        if path.exists():
            raise InputError(f"{path.name}: already exists", hint="choose another name")
        return path

    def free_path(self, name: str) -> Path:
        """Where a new scan of this name goes, numbered where the name is taken."""
        name, number = safe_name(name), 2
        path = self.folder / (name + SUFFIX)
        while path.exists():
            path = self.folder / f"{name} {number}{SUFFIX}"
            number += 1
        return path

    def state(self) -> frozenset[tuple[str, int]]:
        """Other where somebody has put a file into the folder, or has taken or changed one."""
        found = set()
        with contextlib.suppress(OSError):
            for entry in os.scandir(self.folder):
                with contextlib.suppress(OSError):
                    # What is written just now is told by those who write it.
                    if not entry.name.startswith(".") and not entry.name.endswith(_BESIDE):
                        growing = os.path.exists(entry.path + _BESIDE[0])
                        at = 0 if growing else entry.stat(follow_symlinks=False).st_mtime_ns
                        found.add((entry.name, at))
        return frozenset(found)

    def name_of(self, path: Path) -> str:
        """The opaque name of a file that was put into the folder; it is listed from now on."""
        if self._only is not None:
            self._only.add(path)
        with self._lock:
            return self._names.setdefault(path, secrets.token_urlsafe(9))

    async def add(self, name: str, body: AsyncIterator[bytes], length: int | None) -> str:
        """A scan file from its bytes; it appears only when it is whole and is one.

        Raises InputError for a name that is none or taken, LimitExceeded, StorageFull, and what
        `Scan.open` raises.
        """
        path = self.new_path(name)
        await self.receive(path, body, length, lambda part: _check_scan(part, path.name))
        return self.name_of(path)

    async def receive(
        self,
        path: Path,
        body: AsyncIterator[bytes],
        length: int | None,
        check: Callable[[Path], None] = lambda part: None,
    ) -> None:
        """Write a file that is sent; its name appears when it is whole, and ``check`` lets it pass.

        Raises InputError for a name that is taken, LimitExceeded, StorageFull, and as ``check``.
        """
        self.check_upload(length or 0)
        part = path.with_name(f".{secrets.token_hex(8)}{SUFFIX}")
        taken = 0
        try:
            with part.open("xb") as file:
                async for piece in body:
                    taken += len(piece)
                    if taken > UPLOAD_BYTES:
                        raise LimitExceeded("more than 1 GB", hint="at most 1 GB can be sent")
                    if taken >> 24 != (taken - len(piece)) >> 24:
                        self._check_room(0)
                    file.write(piece)
            if length is not None and taken != length:
                raise InputError(f"{taken} of {length} bytes received", hint="send the file again")
            check(part)
            try:
                duplicate_scan(part, path, keep=False)  # never over what got the name meanwhile
            except InputError:
                raise InputError(
                    f"{path.name}: already exists", hint="choose another name"
                ) from None
        except OSError as e:
            if isinstance(e, ScanError):
                raise
            raise StorageFull("the file cannot be written", hint="check the disk") from None
        finally:
            for left in (
                part,
                part.with_name(part.name + "-wal"),
                part.with_name(part.name + "-shm"),
            ):
                left.unlink(missing_ok=True)

    def write(self, path: Path, data: bytes) -> None:
        """Write a file that `new_file` named; its name appears when it is whole.

        Raises InputError where the name has been taken meanwhile, StorageFull.
        """
        if path.exists():
            raise InputError(f"{path.name}: already exists", hint="choose another name")
        try:
            workflows.write_atomically(path, data)
        except ExportError:
            raise StorageFull("the file cannot be written", hint="check the disk") from None

    @property
    def history_file(self) -> Path:
        """Where the verifications of the folder's scanner are kept."""
        return self.folder / "verification.sqlite"

    def rigs(self) -> dict[str, Path]:
        """Files of the folder that may be rigs, by their plain names."""
        found = sorted(self.folder.glob("*.json"), key=lambda p: p.name.lower())[:_MOST_RIGS]
        return {p.name: p for p in found if p.is_file() and not p.is_symlink()}

    def hide(self, text: str) -> str:
        """Words without the paths of the folder: what is in it goes by its plain name."""
        plain = text.replace(f"{self.folder}{os.sep}", "").replace(str(self.folder), "the folder")
        return _SENT.sub("", plain)

    def check_upload(self, length: int) -> None:
        """Refuse a file of so many bytes: LimitExceeded, StorageFull."""
        if length > UPLOAD_BYTES:
            raise LimitExceeded(f"{length / 1e6:.0f} MB", hint="at most 1 GB can be sent")
        self._check_room(length)

    def _check_room(self, wanted: int) -> None:
        free = shutil.disk_usage(self.folder).free
        if free < wanted + _RESERVE:
            raise StorageFull(
                f"{(wanted + _RESERVE) / 1e6:.0f} MB with reserve are needed, {free / 1e6:.0f} MB "
                "are free",
                hint="free some space",
            )


def safe_name(name: str) -> str:
    """A file name out of what a person typed: letters, digits, space, dot, dash, underscore.

    Raises InputError where nothing is left.
    """
    text = unicodedata.normalize("NFC", name[:1000]).removesuffix(SUFFIX)
    kept = "".join(c if c.isalnum() or c in " ._-" else "_" for c in text)
    kept = kept.strip(" .")[:_LONGEST_NAME].strip(" .")
    while len(kept.encode()) > 200:
        kept = kept[:-1]
    if not kept.strip("_ "):
        raise InputError("the name has no letters or digits", hint="choose another name")
    return f"_{kept}" if _RESERVED.match(kept) else kept


def _check_scan(part: Path, name: str) -> None:
    """Raise as `Scan.open`, with the file's own name in the words."""
    try:
        with open_scan(part):
            return
    except (InputError, ScanError) as e:
        raise type(e)(e.message.replace(str(part), name), hint=e.hint) from None
