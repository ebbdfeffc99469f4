"""Where a batch reads and writes: folders of this machine, or object storage by its address.

An address like ``s3://bucket/folder`` goes through fsspec (extra ``farm``). What is published is
whole or not there: the outcome, which says that a result is complete, comes last.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from pathlib import Path
from typing import Any

from turnscan.errors import ExportError, InputError, PluginError

OUTCOME = "outcome.json"
"""Of every result; where it is, the result is complete."""
_BLOCK = 1 << 20
_PICTURES = 200_000
"""Files of one folder of pictures at most."""


def is_address(place: str) -> bool:
    """Whether a place is an address of object storage."""
    return "://" in place


def join(folder: str, *names: str) -> str:
    """A place in a folder."""
    return "/".join([folder.rstrip("/"), *names]) if is_address(folder) else str(
        Path(folder).joinpath(*names)
    )  # fmt: skip


def stem(place: str) -> str:
    """The last part of a place's name, without a scan file's suffix."""
    return place.rstrip("/").replace("\\", "/").rsplit("/", 1)[-1].removesuffix(".turnscan")


def found(place: str) -> list[str]:
    """The scans that a place on the command line means.

    A scan file, a folder of pictures, or the scan files in a folder or under an address with ``*``.

    Raises InputError where there is none, PluginError where fsspec is absent.
    """
    if is_address(place):
        fs, pattern = _filesystem(place)
        names = [str(fs.unstrip_protocol(name)) for name in sorted(fs.glob(pattern))]
        if not names:
            raise InputError(f"{place}: there is nothing", hint="correct the address")
        return names
    path = Path(place)
    if path.is_dir():
        return [str(one.resolve()) for one in sorted(path.glob("*.turnscan"))] or [
            str(path.resolve())
        ]
    if not path.exists():
        raise InputError(f"{place}: there is no such file or folder", hint="correct the name")
    return [str(path.resolve())]


def fetched(place: str, folder: Path) -> Path:
    """A file or folder of this machine with what is at a place; copied to ``folder`` if remote."""
    if not is_address(place):
        return Path(place)
    fs, path = _filesystem(place)
    target = folder / stem(place)
    if path.endswith(".turnscan"):
        target = target.with_name(target.name + ".turnscan")
    fs.get(path, str(target), recursive=fs.isdir(path))
    return target


def digest(path: Path) -> str:
    """Names the content of a file, or of the files of a folder."""
    told = hashlib.blake2b(digest_size=20)
    if path.is_dir():
        inside = sorted(one for one in path.rglob("*") if one.is_file())
        if len(inside) > _PICTURES:
            raise InputError(f"{path}: {len(inside)} files; at most {_PICTURES} are taken")
        for one in inside:
            told.update(
                f"{one.relative_to(path).as_posix()}\0{digest(one)}\n".encode(
                    errors="surrogateescape"
                )
            )
        return told.hexdigest()
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            told.update(block)
    return told.hexdigest()


def outcome_at(place: str) -> bytes | None:
    """The outcome of a complete result; None where there is none."""
    if not is_address(place):
        path = Path(place) / OUTCOME
        return path.read_bytes() if path.is_file() else None
    fs, path_there = _filesystem(join(place, OUTCOME))
    return bytes(fs.cat_file(path_there)) if fs.exists(path_there) else None


def publish(folder: Path, place: str) -> None:
    """Put a complete result in its place; ``folder`` must be on the same disk as a local place.

    A result that is there already stays where it is the same, and is replaced where it is not.
    Raises ExportError.
    """
    try:
        if is_address(place):
            _upload(folder, place)
        else:
            _rename(folder, Path(place))
    except OSError as e:
        raise ExportError(
            f"{place}: the result could not be written: {e.strerror or e}",
            hint="check the free space and the permissions",
        ) from e


def _rename(folder: Path, target: Path) -> None:
    if target.exists():
        old = target.with_name(f".{target.name}.{os.getpid()}.old")
        target.rename(old)
        folder.rename(target)
        shutil.rmtree(old, ignore_errors=True)
        return
    try:
        folder.rename(target)
    except OSError:
        if not (target / OUTCOME).is_file():  # another worker was faster with the same scan
            raise


def _upload(folder: Path, place: str) -> None:
    fs, target = _filesystem(place)
    fs.makedirs(target, exist_ok=True)
    for one in sorted(folder.iterdir(), key=lambda path: path.name == OUTCOME):
        fs.put_file(str(one), f"{target}/{one.name}")


def _filesystem(place: str) -> tuple[Any, str]:
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        raise PluginError(
            f"{place}: addresses of object storage need fsspec",
            hint="pip install 'turnscan[farm]'",
        ) from None
    try:
        fs, path = url_to_fs(place)
    except (ValueError, ImportError) as e:
        raise InputError(f"{place}: {e}", hint="give a folder, or another address") from None
    return fs, str(path)
