"""Writer: frames are packed and stored while the next picture is taken."""

from __future__ import annotations

import threading
from collections.abc import Callable

from turnscan.errors import ScanError

_LONGEST = 60.0
"""s that one frame may take to be stored."""


class Writer:
    """One thread that stores, one frame in its hands and none in line.

    So a crash loses at most that frame and the one before the camera. An error of the disk comes
    out of the next `submit` or of `finish`; nothing is stored after it.
    """

    def __init__(self) -> None:
        self._change = threading.Condition()
        self._job: Callable[[], None] | None = None
        self._closed = False
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._work, name="scan writer", daemon=True)
        self._thread.start()

    def submit(self, job: Callable[[], None]) -> None:
        """Have ``job`` done by the writer; waits while it has another one.

        Raises what an earlier one raised, ScanError when the disk does not answer for a minute.
        """
        with self._change:
            self._wait_idle()
            self._job = job
            self._change.notify_all()

    def finish(self) -> None:
        """Wait until everything is stored, and end the thread. Raises as `submit`."""
        try:
            with self._change:
                self._wait_idle()
        finally:
            self.close()

    def close(self) -> None:
        """End the thread after the frame in its hands. Raises nothing."""
        with self._change:
            self._closed = True
            self._change.notify_all()
        self._thread.join(_LONGEST)

    @property
    def failed(self) -> bool:
        """Whether something could not be stored."""
        return self._error is not None

    def _wait_idle(self) -> None:
        if not self._change.wait_for(lambda: self._job is None, _LONGEST):
            raise ScanError(
                f"the disk has not stored a frame within {_LONGEST:g} s",
                hint="check the disk, then resume",
            )
        if self._error is not None:
            raise self._error

    def _work(self) -> None:
        while True:
            with self._change:
                while self._job is None:
                    if self._closed:
                        return
                    self._change.wait(1.0)
                job = self._job
            try:
                if self._error is None:
                    job()
            except BaseException as e:  # noqa: BLE001 raised again in the thread of the scan
                self._error = e
            finally:
                with self._change:
                    self._job = None
                    self._change.notify_all()
