"""Files that somebody sends: what each can be to a verb, and archives taken apart with care."""

from __future__ import annotations

import contextlib
import lzma
import os
import secrets
import shutil
import stat
import zipfile
import zlib
from pathlib import Path, PurePosixPath

from turnscan.errors import FormatError, InputError, LimitExceeded, StorageFull, UnsafePath
from turnscan.locking import take
from turnscan.scan import is_video, list_pictures
from turnscan.workflows._options._schema import FileKind

_START = 4096
_MOST_ENTRIES = 20_000
_MOST_BYTES = 8 * 2**30
"""Of an archive, unpacked."""
_DENSEST = 1200
"""Times smaller that an archive's entry may be than what it holds; DEFLATE ends at 1032."""
_PIECE = 1 << 20
_FOLDER = ".turnscan-incoming-"

_OF_SUFFIX: dict[str, tuple[FileKind, ...]] = {
    ".turnscan": ("scan",),
    **dict.fromkeys((".stl", ".obj", ".3mf", ".glb", ".dxf", ".step", ".stp"), ("mesh",)),
    ".conf": ("placement",),
    ".csv": ("table",),
    ".toml": ("artefact", "rig"),
}


def file_kinds(path: Path) -> tuple[FileKind, ...]:
    """What a file, or a folder of pictures, can be to a verb; empty where nothing.

    A PLY and a JSON are told by their first bytes.
    """
    suffix = path.suffix.lower()
    if path.is_dir() or is_video(path):
        return ("pictures",) if is_video(path) or _has_pictures(path) else ()
    if suffix == ".ply":
        return ("range-scan",) if b"range_grid" in _start(path) else ("mesh",)
    if suffix == ".json":
        return ("rig",) if b"turnscan-rig" in _start(path) else ("table", "artefact")
    return _OF_SUFFIX.get(suffix, ())


def _start(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_START)


def _has_pictures(folder: Path) -> bool:
    try:
        return bool(list_pictures(folder))
    except InputError:
        return False


def files_within(folder: Path) -> list[Path]:
    """What a folder and those in it hold for verbs: folders of pictures, and other files.

    A folder that is taken away meanwhile holds nothing.
    """
    out = [folder] if file_kinds(folder) else []
    try:
        inside = sorted(folder.iterdir())
    except FileNotFoundError:
        return []
    for path in inside:
        if path.name.startswith(".") or path.is_symlink():
            continue
        if path.is_dir():
            out += files_within(path)
        elif file_kinds(path):
            out.append(path)
    return out


def unpack(archive: Path, folder: Path) -> None:
    """Unpack a zip into a folder that is there and empty; a single folder in it is left out.

    Only plain files are unpacked, each checked by its checksum. Raises FormatError for what is no
    sound zip, UnsafePath for names that lead elsewhere and links, LimitExceeded, StorageFull.
    """
    try:
        with zipfile.ZipFile(archive) as file:
            wanted = [info for info in file.infolist() if not _passed_over(info)]
            _check(archive, wanted)
            names = [PurePosixPath(info.filename) for info in wanted]
            tops = {name.parts[0] for name in names}
            cut = 1 if len(tops) == 1 and all(len(n.parts) > 1 for n in names) else 0
            for info, name in zip(wanted, names, strict=True):
                target = folder.joinpath(*name.parts[cut:])
                target.parent.mkdir(parents=True, exist_ok=True)
                with file.open(info) as entry, target.open("xb") as out:
                    shutil.copyfileobj(entry, out, _PIECE)
    except (zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError, RuntimeError) as e:
        raise FormatError(
            f"{archive.name}: not a sound zip archive ({e})", hint="make the archive again"
        ) from None
    except FileExistsError:
        raise FormatError(
            f"{archive.name}: two entries have one name", hint="make the archive again"
        ) from None
    except OSError as e:
        if e.errno is None:  # of the decoder, not of the disk
            raise FormatError(
                f"{archive.name}: not a sound zip archive ({e})", hint="make the archive again"
            ) from None
        raise StorageFull(
            f"{archive.name}: cannot be unpacked ({e.strerror or e})", hint="check the disk"
        ) from None


def _passed_over(info: zipfile.ZipInfo) -> bool:
    """Folders, and what file managers add."""
    parts = PurePosixPath(info.filename).parts
    return info.is_dir() or "__MACOSX" in parts or (bool(parts) and parts[-1].startswith("."))


def _check(archive: Path, entries: list[zipfile.ZipInfo]) -> None:
    if not entries:
        raise FormatError(f"{archive.name}: an empty archive", hint="make the archive again")
    size = sum(info.file_size for info in entries)
    if len(entries) > _MOST_ENTRIES or size > _MOST_BYTES:
        raise LimitExceeded(
            f"{archive.name}: {len(entries)} files of {size / 1e9:.1f} GB",
            hint=f"send at most {_MOST_ENTRIES} files of {_MOST_BYTES / 1e9:.0f} GB",
        )
    for info in entries:
        name = PurePosixPath(info.filename)
        link = stat.S_ISLNK(info.external_attr >> 16)
        odd = any(c in info.filename for c in "\\:\0") or len(info.filename) > 1000
        if name.is_absolute() or ".." in name.parts or not name.parts or link or odd:
            raise UnsafePath(
                f"{archive.name}: the entry {info.filename[:80]!r} leads out of the archive",
                hint="make the archive again, of plain files",
            )
        if info.file_size > _PIECE and info.file_size > _DENSEST * max(info.compress_size, 1):
            raise LimitExceeded(
                f"{archive.name}: {info.filename[:80]!r} is {info.file_size / 1e6:.0f} MB unpacked",
                hint="make the archive again",
            )
    if shutil.disk_usage(archive.parent).free < size + 200_000_000:
        raise StorageFull(
            f"{archive.name}: {size / 1e6:.0f} MB unpacked do not fit on the disk",
            hint="free some space",
        )


class Incoming:
    """A hidden folder for what is sent, beside the scans; it goes with the process.

    What a process that was killed left behind is removed by the next one.
    """

    def __init__(self, beside: Path) -> None:
        for old in beside.glob(f"{_FOLDER}*"):
            _remove_if_left(old)
        self.folder = beside / f"{_FOLDER}{secrets.token_hex(8)}"
        self.folder.mkdir(mode=0o700)
        self._lock = os.open(self.folder / ".lock", os.O_CREAT | os.O_RDWR, 0o600)
        take(self._lock)

    def close(self) -> None:
        """Take all away."""
        os.close(self._lock)
        shutil.rmtree(self.folder, ignore_errors=True)


def _remove_if_left(folder: Path) -> None:
    if folder.is_symlink() or not folder.is_dir():
        return
    with contextlib.suppress(OSError):
        lock = os.open(folder / ".lock", os.O_RDWR)
        try:
            left = take(lock)
        finally:
            os.close(lock)
        if left:
            shutil.rmtree(folder, ignore_errors=True)
