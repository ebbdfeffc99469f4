"""Take a lock on an open file, as the operating system offers it: it ends with its process."""

from __future__ import annotations

import sys

if sys.platform == "win32":
    import msvcrt

    def take(fd: int) -> bool:
        """Lock the open file ``fd`` without waiting; False where another has it."""
        try:
            msvcrt.locking(fd, msvcrt.LK_NBLCK, 1)
        except OSError:
            return False
        return True

else:
    import fcntl

    def take(fd: int) -> bool:
        """Lock the open file ``fd`` without waiting; False where another has it."""
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            return False
        return True
