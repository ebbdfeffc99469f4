"""Scratch folders of a batch: each ends with its task, or after its process has died.

They lie in one hidden folder of the results, on the same disk. Each is named by its machine and
holds a locked file for as long as its process lives; what nobody of this machine holds any more is
removed. What removes it says so in that file, under its lock: a process that was just about to
take the lock then knows that its folder is lost, and makes another. Not every shared disk tells of
another machine's lock, so each machine clears up its own.
"""

from __future__ import annotations

import os
import platform
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from turnscan.errors import ExportError
from turnscan.locking import take

_FOLDER = ".turnscan"
_HELD = "held"
_LOST = b"removed"
_TRIES = 20
"""Then the disk has no locks, and no folder on it is ever taken for dead."""


@contextmanager
def scratch(output: Path | None) -> Iterator[Path]:
    """A folder for one task, on the disk of ``output``; None: wherever this machine has scratch.

    What dead processes of this machine left in ``output`` is removed first. Raises ExportError
    where nothing can be written there.
    """
    if output is None:
        with tempfile.TemporaryDirectory(prefix="turnscan-") as temporary:
            yield Path(temporary)
        return
    swept(output)
    try:
        folder, held = _held(output / _FOLDER)
    except OSError as e:
        raise ExportError(
            f"{output}: cannot be written: {e.strerror or e}",
            hint="check the free space and the permissions, on every machine that works for it",
        ) from None
    try:
        yield folder
    finally:
        os.close(held)
        shutil.rmtree(folder, ignore_errors=True)
        _rid_of_empty(output)


def swept(output: Path) -> None:
    """Remove the scratch of this machine's processes that ended without doing so."""
    left: list[Path] = []
    with suppress(OSError):  # another took the empty place away just now
        left = list((output / _FOLDER).glob(f"{_machine()}.*"))
    for folder in left:
        try:
            held = os.open(folder / _HELD, os.O_RDWR)
        except OSError:  # just made, or just removed by another
            continue
        dead = take(held)
        if dead:
            os.write(held, _LOST)
        os.close(held)
        if dead:
            shutil.rmtree(folder, ignore_errors=True)
    _rid_of_empty(output)


def _rid_of_empty(output: Path) -> None:
    with suppress(OSError):  # there are others, or there is none
        (output / _FOLDER).rmdir()


def _held(place: Path) -> tuple[Path, int]:
    tries = 0
    while True:
        with suppress(FileExistsError):  # and it may be gone again before anyone looks
            place.mkdir()
        try:
            folder = Path(tempfile.mkdtemp(prefix=f"{_machine()}.", dir=place))
            held = os.open(folder / _HELD, os.O_RDWR | os.O_CREAT, 0o600)
        except FileNotFoundError:
            if place.is_symlink():  # to nowhere, and that stays so
                raise
            continue  # another ended, and took the empty place away
        tries += 1
        if (take(held) and not os.fstat(held).st_size) or tries == _TRIES:
            return folder, held
        os.close(held)  # another took it for dead, and removes it
        shutil.rmtree(folder, ignore_errors=True)


def _machine() -> str:
    """Its name without a dot: what follows one is no part of it, as in ``node`` and ``node-1``."""
    return re.sub(r"\W", "-", platform.node()) or "here"
