"""A VISA instrument with the face of a serial port, for the laser guard."""

from __future__ import annotations

import contextlib
import errno
import queue
from typing import Any

PATIENCE = 0.5
"""s to wait for the answer to a question."""


class VisaPort:
    """Lines go out; the answer to each that asks (with a question mark) comes in as a line.

    An instrument must not be asked for an answer that it does not owe, so nothing else is read. One
    that owes an answer and is silent is cleared, so that a late answer is not taken for the next.

    Raises OSError where the instrument cannot be opened, and once it has gone.
    """

    def __init__(self, resource: str, library: str, baud: int) -> None:
        """``library``: ``@py``, ``@ivi`` or what else PyVISA takes."""
        import pyvisa

        self._error = pyvisa.errors.VisaIOError
        self._silent = pyvisa.constants.StatusCode.error_timeout
        self._heard: queue.Queue[bytes] = queue.Queue(maxsize=4096)
        self._line = b""
        self._gone = ""
        self.timeout = 0.05
        try:
            self._manager = pyvisa.ResourceManager(library)
            self._session: Any = self._manager.open_resource(
                resource, write_termination="\n", read_termination="\n"
            )
            self._session.timeout = round(1000 * PATIENCE)
            if hasattr(self._session, "baud_rate"):
                self._session.baud_rate = baud
        except Exception as e:  # noqa: BLE001 PyVISA and its back ends raise all kinds
            held = getattr(e, "error_code", 0) in (
                pyvisa.constants.StatusCode.error_resource_locked,
                pyvisa.constants.StatusCode.error_resource_busy,
            )
            text = " ".join(str(e).split())
            raise (OSError(errno.EBUSY, text) if held else OSError(text)) from None

    @property
    def in_waiting(self) -> int:
        """Nothing is left half read."""
        return 0

    def write(self, data: bytes) -> None:
        """Send what is whole by now; waits for answers, for `PATIENCE` each."""
        *lines, self._line = (self._line + data).split(b"\n")
        for line in filter(None, lines):
            try:
                self._session.write_raw(line + b"\n")
                if b"?" in line:
                    self._heard.put_nowait(self._session.read_raw().strip() + b"\n")
            except self._error as e:
                if e.error_code != self._silent:
                    self._gone = str(e)
                    raise OSError(self._gone) from None
                with contextlib.suppress(self._error, RuntimeError):  # some cannot be cleared
                    self._session.clear()
            except queue.Full:
                continue

    def read(self, size: int) -> bytes:
        """An answer, b"" where none comes within ``timeout``."""
        if self._gone:
            raise OSError(self._gone)
        try:
            return self._heard.get(timeout=self.timeout)
        except queue.Empty:
            return b""

    def reset_output_buffer(self) -> None:
        """What waits to be sent is not sent any more."""
        self._line = b""

    def close(self) -> None:
        """Let go of the instrument; the manager is everybody's, and closing it would close all."""
        with contextlib.suppress(self._error):
            self._session.close()
