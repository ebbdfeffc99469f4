"""Where a table was left, noted on this computer: boards do not know it, or cannot prove it."""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import stat
import tempfile
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path

from turnscan.devices._steps import Steps

_LENGTH = 512
_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


def new_counting() -> str:
    """A name for a stretch of counting."""
    return secrets.token_hex(8)


@dataclass(frozen=True)
class Left:
    """What is known of a table between two moves, or in one."""

    counting: str
    """Names one stretch of counting; another one after the count was lost or set again."""
    base: int
    """Unit at which the board's own count is zero."""
    unit: int
    """Where the table is at rest, or began the move that it is in."""
    target: int | None = None
    """Where that move goes."""
    sent: bool = False
    """Whether the board has said that it has the move."""
    alarmed: bool = False
    """Whether an alarm came in that move, so that steps may be lost."""
    fresh: bool = False
    """Whether this counting has only begun: nothing has been measured in it."""
    adopted: bool = False
    """Whether the board's count was taken as it was found, with no note of what came before."""

    def place(
        self,
        count: int | None,
        tolerance: int = 0,
        *,
        locked: bool = False,
        watched: bool = False,
    ) -> int | None:
        """The unit at which the table stands, or None where that is not certain.

        ``count`` is the board's own count, None where it has none; one that counts zero may have
        restarted, unless it was ``watched`` all the time. ``locked``: it is in an alarm, which
        loses steps in a move that has begun.
        """
        if count is None:
            if self.target is None:
                return self.unit
            return self.target if self.sent else None
        counted = self.base + count
        if self.target is None:
            return self.unit if abs(counted - self.unit) <= tolerance else None
        if counted == self.unit and (locked or self.alarmed):
            return self.unit
        low, high = sorted((self.unit, self.target))
        between = low - tolerance <= counted <= high + tolerance
        sound = not (locked or self.alarmed) and (count != 0 or watched)
        return counted if between and sound else None


class Ledger:
    """One record for a port, overwritten in place with every move; kept until the computer ends.

    It holds only for the same port, not unplugged since, and the same board with as many steps.
    What was noted of another one, or with another number of steps, stays until the table is turned:
    who only looks which board is there leaves no trace.
    Where it cannot be kept there is none, and a board is believed as far as its own count goes.
    """

    def __init__(self, port: str, dialect: str, steps: Steps) -> None:
        where = _where(port)
        self._key = f"{where} {dialect} {steps}" if where else ""
        self._where = where
        self._others = False
        """Whether what is noted is another's, and still true."""
        self._file = -1
        if self._key:
            with contextlib.suppress(OSError):
                name = sha256(os.path.realpath(port).encode()).hexdigest()[:24]
                path = _folder() / f"table-{name}"
                flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0)
                self._file = os.open(path, flags, 0o600)

    @property
    def kept(self) -> bool:
        """Whether there is one."""
        return self._file >= 0

    def read(self) -> Left | None:
        """What was noted last; None where nothing was, or of another board."""
        if self._file < 0:
            return None
        try:
            text = json.loads(os.pread(self._file, _LENGTH, 0))
            same = bool(text["key"] == self._key)
            self._others = not same and text["key"].startswith(f"{self._where} ")
            return Left(**text["left"]) if same else None
        except (OSError, ValueError, TypeError, KeyError, AttributeError):
            return None

    def claim(self) -> None:
        """The table is about to turn, or to get another zero: nothing else that was noted holds."""
        self._others = False

    def write(self, left: Left) -> None:
        """Note it: one write that is done whole or not at all when this process is killed."""
        if self._file < 0 or self._others:
            return
        text = json.dumps({"key": self._key, "left": asdict(left)}).encode()
        try:
            os.pwrite(self._file, text.ljust(_LENGTH), 0)
        except OSError:
            with contextlib.suppress(OSError):  # better none than one that is not true any more
                os.ftruncate(self._file, 0)
            self.close()

    def close(self) -> None:
        """Let go of the file; what was noted stays."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1


def _where(port: str) -> str:
    """What changes with the port, its being plugged in and the computer's start."""
    try:
        found = os.stat(port)
        boot = _BOOT_ID.read_text().strip()
    except OSError:
        return ""
    if not stat.S_ISCHR(found.st_mode):
        return ""
    return f"{boot} {found.st_rdev} {found.st_ino} {found.st_ctime_ns}"


def _folder() -> Path:
    """A folder of this user alone. Raises OSError where there is none."""
    given = os.environ.get("XDG_RUNTIME_DIR", "")
    if given and os.access(given, os.W_OK):
        folder = Path(given) / "turnscan"
    else:
        folder = Path(tempfile.gettempdir()) / f"turnscan-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    owner = folder.lstat()
    if not stat.S_ISDIR(owner.st_mode) or owner.st_uid != os.getuid() or owner.st_mode & 0o077:
        raise PermissionError(f"{folder}: not of this user alone")
    return folder
