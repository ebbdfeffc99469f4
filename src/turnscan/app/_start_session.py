"""The start page: what is done with scan files as such, the demo, and a look at the folder."""

from __future__ import annotations

import shutil
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any

from turnscan import workflows
from turnscan.app import _protocol as p
from turnscan.app import _requests as q
from turnscan.app._gallery import Gallery
from turnscan.app._jobs import Job, Jobs, Result
from turnscan.app._library import Library
from turnscan.errors import InputError
from turnscan.workflows import SimulateOptions

_DEMO = SimulateOptions(steps=48)
"""A turn that takes seconds, and shows what a real one does."""
FILE_MANAGER = {"darwin": "open", "win32": "explorer"}.get(sys.platform, "xdg-open")
"""The program that shows a folder."""
_LOOK_EVERY = 2.0
"""s between looks at the folder."""


class StartRoom:
    """Answers of the start page. All methods may be called from any thread."""

    def __init__(
        self, jobs: Jobs, library: Library, release: Callable[[str], None], tell: Callable[[], None]
    ) -> None:
        """``release`` closes the document of a scan, ``tell`` tells everybody the lists."""
        self.gallery = Gallery(library)
        self._jobs, self._library, self._release, self._tell = jobs, library, release, tell
        self._moving = threading.Lock()
        """Scan files get their names, and leave the list and the bin, one at a time."""
        self._ended = threading.Event()
        self._watcher = threading.Thread(target=self._watch, name="folder", daemon=True)
        self._watcher.start()

    def close(self) -> None:
        """Look at the folder no more."""
        self._ended.set()
        self._watcher.join()

    def rename(self, request: q.Rename) -> None:
        """Give a scan another name."""
        with self._moving:
            path = self._library.path(request.scan)
            self._library.new_path(request.name)  # a name that is refused closes no document
            self._release(request.scan)
            self.gallery.rename(path, request.name)
        self._tell()

    def duplicate(self, request: q.Duplicate) -> None:
        """Copy a scan with its edits."""
        self.gallery.duplicate(self._library.path(request.scan), request.name)
        self._tell()

    def to_bin(self, request: q.ToBin) -> None:
        """Put a scan into the bin."""
        with self._moving:
            path = self._library.path(request.scan)
            self._release(request.scan)
            self.gallery.discard(path)
        self._tell()

    def restore(self, request: q.Restore) -> None:
        """Take a scan out of the bin."""
        with self._moving:
            self.gallery.restore(request.binned)
        self._tell()

    def empty_bin(self) -> None:
        """Delete for good what is in the bin."""
        with self._moving:
            self.gallery.empty_bin()
        self._tell()

    def show_folder(self) -> None:
        """Open the folder in the file manager. Raises InputError where there is none."""
        program = shutil.which(FILE_MANAGER)
        if program is None:
            raise InputError(
                "no file manager was found on this computer",
                hint="the folder is the one that turnscan was started with",
            )
        quiet = subprocess.DEVNULL
        opened = subprocess.Popen(  # noqa: S603 (a program of the system, a folder of ours)
            [program, str(self._library.folder)],
            stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True,
        )  # fmt: skip
        threading.Thread(target=opened.wait, name="file manager", daemon=True).start()

    def try_demo(self, id: int) -> p.StartedJob:
        """Scan a part with a simulated rig."""
        path = self._library.free_path("demo cup")

        def work(job: Job) -> Result:
            workflows.simulate("cup", path, _DEMO, job.progress)
            made = p.ResultFile(file=self._library.name_of(path), name=path.name, scan=True)
            self._tell()
            return Result(f"{path.stem} is scanned", files=[made])

        return p.StartedJob(id=id, job=self._jobs.start("demo", "Scanning the demo part", work).id)

    def answers(self) -> dict[type, tuple[Callable[[Any], Any], bool]]:
        """How each request is answered, and whether only the operator may ask."""
        return {
            q.Rename: (lambda call: self.rename(call.request), True),
            q.Duplicate: (lambda call: self.duplicate(call.request), True),
            q.ToBin: (lambda call: self.to_bin(call.request), True),
            q.Restore: (lambda call: self.restore(call.request), True),
            q.EmptyBin: (lambda call: self.empty_bin(), True),
            q.TryDemo: (lambda call: self.try_demo(call.id), True),
        }

    def _watch(self) -> None:
        """Tell the lists where somebody else has put files into the folder, or has taken some."""
        before = self._library.state()
        while not self._ended.wait(_LOOK_EVERY):
            now = self._library.state()
            if now != before:
                before = now
                self._tell()
