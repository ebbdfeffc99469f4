"""One writer of a scan file at a time, by a lock of the system that dies with its owner."""

from __future__ import annotations

import contextlib
import os
import time
from pathlib import Path

from turnscan.errors import ScanBusy, ScanError
from turnscan.locking import take


class WriterLock:
    """Held from construction until `release`, or until the process ends in whatever way.

    A file ``NAME.turnscan-lock`` carries it, because SQLite's own locks on the scan file would be
    lost with any other descriptor of it that this process closes. One that a dead process left
    behind is no lock. Raises ScanBusy where another one holds it, ScanError.
    """

    def __init__(self, path: Path) -> None:
        self._path = lock_path(path)
        self._fd = -1
        while self._fd < 0:
            try:
                fd = os.open(self._path, os.O_CREAT | os.O_RDWR, 0o666)
            except OSError as e:
                raise ScanError(
                    f"{path}: cannot be written ({e.strerror})",
                    hint="check the folder, its permissions and the disk",
                ) from None
            if not _take_soon(fd):
                os.close(fd)
                raise ScanBusy(
                    f"{path}: another process is writing it", hint="wait until it has finished"
                )
            # Its owner may have removed it while we waited at the door: then it guards nothing.
            if _same(fd, self._path):
                self._fd = fd
            else:
                os.close(fd)

    def release(self) -> None:
        """Let the next one write. Twice is fine."""
        fd, self._fd = self._fd, -1
        if fd < 0:
            return
        with contextlib.suppress(OSError):
            self._path.unlink()
        with contextlib.suppress(OSError):
            os.close(fd)


def being_written(path: Path) -> bool:
    """Whether a living process, this one or another, is writing the scan file."""
    try:
        fd = os.open(lock_path(path), os.O_RDWR)
    except OSError:
        return False
    try:
        return not take(fd)
    finally:
        os.close(fd)


def lock_path(path: Path) -> Path:
    """The file that carries the lock."""
    return path.with_name(path.name + "-lock")


def _take_soon(fd: int) -> bool:
    """Somebody may only be looking whether it is taken (`being_written`)."""
    for _ in range(5):
        if take(fd):
            return True
        time.sleep(0.01)
    return False


def _same(fd: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(fd), path.stat())
    except OSError:
        return False
