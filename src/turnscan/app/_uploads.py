"""Large files on their way from a browser in pieces: one that was cut off is resumed."""

from __future__ import annotations

import asyncio
import secrets
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from pathlib import Path

from turnscan.errors import InputError, LimitExceeded, StorageFull

_MOST = 16
"""Files that may be on their way; of more the one is dropped that waits longest for a piece."""
_READ = 1 << 20


@dataclass(eq=False)
class _Upload:
    path: Path
    total: int
    lock: asyncio.Lock = field(default_factory=asyncio.Lock)


class Uploads:
    """Files that are not whole yet. It belongs to the thread of the event loop.

    What was received stays when the connection breaks; the browser asks how much that is, and
    sends the rest. All of it goes with the server.
    """

    def __init__(self, folder: Callable[[], Path], check: Callable[[int], None]) -> None:
        """``folder`` is where they are kept, ``check`` refuses a file of so many bytes."""
        self._folder, self._check = folder, check
        self._all: dict[str, _Upload] = {}

    def begin(self, total: int) -> str:
        """A new file of ``total`` bytes; its name. Raises as ``check``, and StorageFull."""
        self._check(total)
        name = secrets.token_urlsafe(9)
        try:
            path = self._folder() / f".{name}"
            path.touch(mode=0o600)
        except OSError:
            raise StorageFull("the file cannot be written", hint="check the disk") from None
        for old in list(self._all)[: max(0, len(self._all) - _MOST + 1)]:
            self._all.pop(old).path.unlink(missing_ok=True)
        self._all[name] = _Upload(path, total)
        return name

    def received(self, name: str) -> int:
        """Bytes that are here. Raises InputError for none of that name."""
        return self._size(name)

    async def add(self, name: str, at: int, body: AsyncIterator[bytes]) -> int:
        """Append a piece that begins at byte ``at``; the bytes that are here then.

        A piece that begins elsewhere than where the file ends is not taken: the answer says where
        the next one begins. Raises InputError, StorageFull, and LimitExceeded beyond the total:
        then nothing of the piece is kept.
        """
        upload = self._find(name)
        self._all[name] = self._all.pop(name)  # the latest
        async with upload.lock:
            here = self._size(name)
            if at != here:
                return here
            self._check(upload.total - here)
            try:
                with upload.path.open("r+b") as file:
                    file.seek(at)
                    async for piece in body:
                        here += len(piece)
                        if here > upload.total:
                            file.truncate(at)  # a piece of another file, perhaps
                            raise LimitExceeded(
                                f"more than the {upload.total} bytes of the file",
                                hint="send the file again",
                            )
                        file.write(piece)
            except OSError:
                raise StorageFull("the file cannot be written", hint="check the disk") from None
        return here

    async def take(self, name: str) -> AsyncIterator[bytes]:
        """The bytes of a file that is whole; it is forgotten then. Raises InputError."""
        upload = self._find(name)
        async with upload.lock:
            here = self._size(name)
            if here != upload.total:
                raise InputError(f"{here} of {upload.total} bytes received", hint="send the rest")
            self._all.pop(name, None)
            try:
                with upload.path.open("rb") as file:
                    while piece := await asyncio.to_thread(file.read, _READ):
                        yield piece
            finally:
                upload.path.unlink(missing_ok=True)

    def _size(self, name: str) -> int:
        """Bytes that are here; where somebody has cleared the folder, there is no such upload."""
        try:
            return self._find(name).path.stat().st_size
        except FileNotFoundError:
            self._all.pop(name, None)
            return self._size(name)

    def _find(self, name: str) -> _Upload:
        try:
            return self._all[name]
        except KeyError:
            raise InputError("no such upload", hint="send the file again") from None
