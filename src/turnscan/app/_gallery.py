"""Gallery: names, copies, small pictures and the bin of the scans of a folder."""

from __future__ import annotations

import contextlib
import json
import secrets
import shutil
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from turnscan.app._library import SUFFIX, Library
from turnscan.app._protocol import BinEntry, FindingCounts
from turnscan.errors import ExportError, InputError, ScanBusy, StorageFull
from turnscan.findings import Finding
from turnscan.workflows import duplicate_scan, frame_thumbnail, write_atomically

OWN = ".turnscan-app"
"""Folder beside the scans in which the bin and what is shown of scans are."""


class Gallery:
    """What may be done with scan files as such; documents of them are closed before."""

    def __init__(self, library: Library) -> None:
        self._library = library
        self._own = library.folder / OWN
        self._counts: dict[Path, tuple[str, FindingCounts]] = {}
        library.counts = self.counts

    # What is shown of a scan

    def keep(self, path: Path, picture: bytes, findings: Sequence[Finding]) -> None:
        """Keep what an open scan looks like; a folder that cannot be written keeps nothing."""
        content = self._library.glance(path).content
        kinds = [f.severity for f in findings]
        counts = FindingCounts(
            errors=kinds.count("error"), warnings=kinds.count("warning"), notes=kinds.count("note")
        )
        self._counts[path] = content, counts
        with contextlib.suppress(OSError, ExportError):
            png, figures = self._kept(path)
            png.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(png, picture)
            held = {"content": content, "findings": counts.model_dump()}
            write_atomically(figures, json.dumps(held).encode())

    def counts(self, path: Path, content: str) -> FindingCounts | None:
        """How many findings a scan had when it was last open; None where it has changed since."""
        known = self._counts.get(path)
        if known is None or known[0] != content:
            with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
                held = json.loads(self._kept(path)[1].read_bytes())
                counts = FindingCounts.model_validate(held["findings"])
                self._counts[path] = str(held["content"]), counts
        known = self._counts.get(path)
        return known[1] if known is not None and known[0] == content else None

    def thumbnail(self, path: Path) -> bytes:
        """The surface as it was last seen, else a picture of the middle of the scan, as PNG.

        What was seen of a scan that has changed since, or of another one that had this name, is not
        shown. Raises InputError and ScanError for a scan without pictures.
        """
        if self.counts(path, self._library.glance(path).content) is not None:
            with contextlib.suppress(OSError):
                return self._kept(path)[0].read_bytes()
        return frame_thumbnail(path)

    def _kept(self, path: Path) -> tuple[Path, Path]:
        return _beside(self._own / "gallery" / path.name)

    # What is done with scans

    def rename(self, path: Path, name: str) -> Path:
        """Give a scan another name. Raises InputError where it is none, is taken or in use."""
        target = self._library.new_path(name)
        self._move(path, target)
        for old, new in zip(self._kept(path), self._kept(target), strict=True):
            with contextlib.suppress(OSError):
                old.replace(new)
        self._counts.pop(path, None)
        self._library.moved(path, target)
        return target

    def duplicate(self, path: Path, name: str) -> Path:
        """Copy a scan with its edits. Raises as `rename`, and as `duplicate_scan`."""
        target = self._library.new_path(name)
        duplicate_scan(path, target)
        for old, new in zip(self._kept(path), self._kept(target), strict=True):
            with contextlib.suppress(OSError):
                shutil.copyfile(old, new)
        self._library.name_of(target)
        return target

    def discard(self, path: Path) -> None:
        """Put a scan into the bin. Raises InputError where it is in use, StorageFull."""
        place = self._own / "bin" / secrets.token_urlsafe(9)
        try:
            place.mkdir(parents=True)
        except OSError:
            raise StorageFull("the bin cannot be made", hint="check the folder") from None
        try:
            self._move(path, place / path.name)
        except BaseException:
            with contextlib.suppress(OSError):
                place.rmdir()
            raise
        for kept in self._kept(path):  # what it looks like goes with it
            with contextlib.suppress(OSError):
                kept.replace(place / kept.name)
        self._counts.pop(path, None)

    def binned(self) -> list[BinEntry]:
        """What is in the bin, the last first."""
        found = []
        for place in (self._own / "bin").glob("*"):
            with contextlib.suppress(OSError):
                for path in place.glob(f"*{SUFFIX}"):
                    at = datetime.fromtimestamp(place.stat().st_mtime, UTC)
                    entry = BinEntry(
                        binned=place.name, name=path.stem[:200] or "scan",
                        megabytes=path.stat().st_size / 1e6, at=at.isoformat(timespec="seconds"),
                    )  # fmt: skip
                    found.append(entry)
        return sorted(found, key=lambda entry: entry.at, reverse=True)

    def restore(self, binned: str) -> Path:
        """Take a scan out of the bin. Raises InputError where it is not there."""
        place = self._own / "bin" / binned
        held = next(iter(place.glob(f"*{SUFFIX}")), None)
        if held is None:
            raise InputError("this scan is no longer in the bin", hint="reload the list")
        target = self._library.free_path(held.stem)
        self._move(held, target)
        for kept, shown in zip(_beside(held), self._kept(target), strict=True):
            with contextlib.suppress(OSError):
                kept.replace(shown)
        with contextlib.suppress(OSError):  # somebody else has emptied the bin meanwhile
            place.rmdir()
        self._library.name_of(target)
        return target

    def empty_bin(self) -> None:
        """Delete for good what is in the bin, and what is kept of scans that others took away."""
        shutil.rmtree(self._own / "bin", ignore_errors=True)
        there = {kept.name for path in self._library.folder.glob(f"*{SUFFIX}") for kept in
                 _beside(path)}  # fmt: skip
        for kept in (self._own / "gallery").glob("*"):
            if kept.name not in there:
                with contextlib.suppress(OSError):
                    kept.unlink()

    def _move(self, path: Path, target: Path) -> None:
        try:
            duplicate_scan(path, target, keep=False)
        except ScanBusy:
            raise InputError(
                f"{path.stem} is being written", hint="wait until the scan has finished, or stop it"
            ) from None


def _beside(path: Path) -> tuple[Path, Path]:
    """The picture and the figures that are kept of a scan."""
    return path.with_name(f"{path.name}.png"), path.with_name(f"{path.name}.json")
