"""Writing results: whole or not at all."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path


def write_atomically(path: Path, content: bytes) -> None:
    """Write ``content`` beside ``path`` under another name, then put it in its place.

    What stood at ``path`` stays as it was until the new file is complete and on the disk, and for
    good when anything fails. Raises OSError naming ``path``.
    """
    if path.is_dir():
        raise IsADirectoryError(21, "is a directory", str(path))
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with beside.open("xb") as out:
            out.write(content)
            out.flush()
            os.fsync(out.fileno())
        beside.replace(path)
    except OSError as e:
        with contextlib.suppress(OSError):
            beside.unlink()
        raise OSError(e.errno, e.strerror, str(path)) from e
