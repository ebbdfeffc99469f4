"""Downloads: files that were made for a browser, until it has fetched them."""

from __future__ import annotations

import secrets
import tempfile
import threading
from collections import OrderedDict
from pathlib import Path

from turnscan.errors import InputError

_KEPT = 8


class Downloads:
    """The latest few files, in a folder of their own that goes with the server."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="turnscan-")
        self._files: OrderedDict[str, tuple[Path, str]] = OrderedDict()
        self._lock = threading.Lock()

    def add(self, data: bytes, file_name: str) -> str:
        """Keep a file; returns the name to ask for it by."""
        name = secrets.token_urlsafe(9)
        path = Path(self._folder.name) / name
        path.write_bytes(data)
        with self._lock:
            self._files[name] = path, file_name
            while len(self._files) > _KEPT:
                self._files.popitem(last=False)[1][0].unlink(missing_ok=True)
        return name

    def place(self) -> Path:
        """Where a file can be made that its maker takes away."""
        return Path(self._folder.name) / secrets.token_urlsafe(9)

    def find(self, name: str) -> tuple[Path, str]:
        """Where it is, and what to call it. Raises InputError where it is no longer available."""
        with self._lock:
            found = self._files.get(name)
        if found is None:
            raise InputError("this file is no longer available", hint="export it again")
        return found

    def close(self) -> None:
        """Take all away."""
        self._folder.cleanup()
