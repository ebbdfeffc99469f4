"""Files that a workflow writes: checked before work is spent, and never half written."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from turnscan.errors import ExportError, InputError


def check_apart(paths: Sequence[Path]) -> None:
    """Raise InputError where two files to be written are one."""
    seen = set[Path]()
    for path in paths:
        if path.resolve() in seen:
            raise InputError(f"{path}: is given twice as an output", hint="give each another name")
        seen.add(path.resolve())


def check_output(path: Path, suffixes: Sequence[str] = (), inputs: Iterable[Path] = ()) -> None:
    """Check the name of a file to be written, before work is spent.

    ``suffixes`` are what its name may end in (any where there are none); ``inputs`` are the files
    the verb reads, which are never replaced by what is made of them.

    Raises InputError for another suffix and for an input, ExportError where no file can be written.
    """
    if suffixes and path.suffix.lower() not in suffixes:
        raise InputError(
            f"{path}: the name of what is written here ends {' or '.join(suffixes)}",
            hint="choose such a name; nothing was written",
        )
    for source in inputs:
        if _same_file(path, source):
            raise InputError(
                f"{path}: this file is an input and is not replaced", hint="choose another name"
            )
    check_writable(path)


def _same_file(a: Path, b: Path) -> bool:
    try:
        return a.samefile(b)
    except OSError:  # one of them is not there
        return a.resolve() == b.resolve()


def check_writable(path: Path) -> None:
    """Raise ExportError where a file at ``path`` could not be written, before work is spent."""
    folder = path.resolve().parent
    if not folder.is_dir():
        raise ExportError(f"{path}: there is no folder {folder}", hint="make the folder first")
    if path.is_dir():
        raise ExportError(f"{path}: this is a folder", hint="name a file")
    if path.exists() and not path.is_file():
        raise ExportError(f"{path}: this is a device or pipe", hint="name an ordinary file")
    if path.exists() and not os.access(path, os.W_OK):
        raise ExportError(f"{path}: the file is read-only", hint="choose another name")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise ExportError(f"{path}: the folder {folder} is read-only", hint="choose another folder")


def write_atomically(path: Path, data: bytes) -> None:
    """Write a file so that its name holds all of the old content or all of the new, at any time.

    Raises ExportError where it cannot be written; what was there before then stays.
    """
    check_writable(path)
    target = path.resolve()
    part = target.with_name(f".{target.name[:200]}.{os.getpid()}.part")
    try:
        with part.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        if target.exists():
            part.chmod(target.stat().st_mode & 0o7777)
        part.replace(target)
    except OSError as e:
        part.unlink(missing_ok=True)
        raise ExportError(
            f"{path}: {len(data)} bytes could not be written: {e.strerror or e}",
            hint="check the free space and the permissions",
        ) from e
    except BaseException:
        part.unlink(missing_ok=True)
        raise
