"""Kernels compiled by a second process, ahead of the work that needs them."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator

from turnscan.errors import ExportError
from turnscan.threads import thread_count

_JOBS = "turnscan.workflows._precompile"
SURFACES = "surfaces"
"""The part of the kernels that a reconstruction comes to last."""


@contextlib.contextmanager
def compiling_ahead() -> Iterator[None]:
    """In the first run on a machine, points' and surfaces' kernels are compiled by another process
    while this one reads pictures and compiles what these need.

    The process ends with the block, whatever is left; then this one compiles it when it is used.
    """
    from turnscan.compiled import is_first_run

    if thread_count() < 2 or not is_first_run():
        yield
        return
    with CompileJob(SURFACES):
        yield


class CompileJob:
    """A process that compiles one part; it ends with the block."""

    def __init__(self, part: str) -> None:
        self._said = tempfile.TemporaryFile()  # noqa: SIM115 (closed in __exit__)
        # Away from the terminal, whose interruption is this process's to handle.
        self._process = subprocess.Popen(  # noqa: S603 (our own module, no shell)
            [sys.executable, "-m", _JOBS, part],
            stdin=subprocess.DEVNULL, stdout=self._said, stderr=self._said, start_new_session=True,
        )  # fmt: skip

    def __enter__(self) -> CompileJob:
        return self

    def __exit__(self, *_: object) -> None:
        if self._process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                # With what it started itself, where a group of processes can be ended.
                if hasattr(os, "killpg"):
                    os.killpg(self._process.pid, signal.SIGKILL)
                self._process.kill()
        self._process.wait()
        self._said.close()

    def wait(self) -> None:
        """Until it is done; raises ExportError with its last line where it failed."""
        if self._process.wait():
            self._said.seek(0)
            lines = self._said.read().decode(errors="replace").strip().splitlines()
            raise ExportError(
                f"compiling failed: {lines[-1] if lines else 'its process was ended'}",
                hint="run it again; what is compiled already takes no time",
            )
