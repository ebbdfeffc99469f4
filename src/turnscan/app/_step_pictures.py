"""StepPictures: small pictures of the steps of histories, each drawn once and kept."""

from __future__ import annotations

import contextlib
import logging
import re
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from turnscan.errors import ExportError, InputError
from turnscan.workflows import write_atomically

_MOST = 2000
"""Pictures that are kept, some 5 kB each; the oldest go."""
_AT_ONCE = 12
"""So many are drawn for one state of a scan, the newest steps first."""
_NAME = re.compile(r"[0-9a-f]{16}")

_log = logging.getLogger("turnscan.app")


class StepPictures:
    """Pictures by their names, which say what was done to which scan; so none is ever old."""

    def __init__(self, own: Path) -> None:
        """``own`` is the folder of the server's own files; where it cannot be written, pictures
        are held in memory alone."""
        self._folder = own / "steps"
        self._lock = threading.Lock()
        self._held: dict[str, bytes] = {}
        self._known = {path.stem for path in self._folder.glob("*.png")}
        self._pool = ThreadPoolExecutor(1, "pictures")
        self._ended = threading.Event()

    def close(self) -> None:
        """Draw no more."""
        self._ended.set()
        self._pool.shutdown(wait=True, cancel_futures=True)

    def has(self, name: str) -> bool:
        """Whether there is a picture of this name."""
        with self._lock:
            return name in self._known

    def get(self, name: str) -> bytes:
        """A picture as PNG. Raises InputError where there is none."""
        with self._lock:
            held = self._held.get(name)
        if held is not None:
            return held
        if _NAME.fullmatch(name):
            with contextlib.suppress(OSError):
                return (self._folder / f"{name}.png").read_bytes()
        raise InputError("there is no such picture")

    def draw(
        self, wanted: Iterable[tuple[str, Callable[[], bytes]]], drawn: Callable[[], None]
    ) -> None:
        """Draw what is not there yet, in a thread of its own; ``drawn`` hears when there is more.

        ``wanted`` are names, and what draws them; it is not gone through before its turn comes.
        """
        with contextlib.suppress(RuntimeError):  # the server is ending
            self._pool.submit(self._draw, wanted, drawn)

    def _draw(
        self, wanted: Iterable[tuple[str, Callable[[], bytes]]], drawn: Callable[[], None]
    ) -> None:
        many = 0
        try:
            for name, make in wanted:
                if self._ended.is_set() or many == _AT_ONCE:
                    break
                if not self.has(name):
                    self._keep(name, make())
                    many += 1
        except Exception as e:  # noqa: BLE001 a picture less, and nothing else, is the harm
            _log.warning("a picture of a step was not drawn (%s)", type(e).__name__)
        if many:
            drawn()

    def _keep(self, name: str, picture: bytes) -> None:
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            write_atomically(self._folder / f"{name}.png", picture)
        except (OSError, ExportError):
            with self._lock:
                self._held[name] = picture
        with self._lock:
            self._known.add(name)
            crowded = len(self._known) > _MOST
        if crowded:
            self._drop()

    def _drop(self) -> None:
        """Let the oldest tenth go."""
        with contextlib.suppress(OSError):
            files = sorted(self._folder.glob("*.png"), key=lambda path: path.stat().st_mtime)
            for path in files[: _MOST // 10]:
                path.unlink(missing_ok=True)
        with self._lock:
            for name in list(self._held)[: _MOST // 10]:
                del self._held[name]
            self._known = {path.stem for path in self._folder.glob("*.png")} | set(self._held)
