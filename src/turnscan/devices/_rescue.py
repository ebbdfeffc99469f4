"""Dark without the guard: its port is opened again, and another guard goes on where that fails."""

from __future__ import annotations

import contextlib
import subprocess
import threading
import time
from collections.abc import Callable
from typing import Any

from turnscan.devices import _guard
from turnscan.devices._dialects import DIALECTS, darken


class Rescue:
    """What a scanner does for lasers whose guard does not do it any more.

    Whatever goes wrong in it, it is tried again.
    """

    def __init__(
        self,
        settings: _guard.Settings,
        start: Callable[[], subprocess.Popen[bytes]],
        maybe_lit: threading.Event,
    ) -> None:
        """``start`` another guard; ``maybe_lit`` is cleared once dark is confirmed."""
        self._settings, self._start, self._maybe_lit = settings, start, maybe_lit
        self._one = threading.Lock()
        """One thread at a time: they would take the port away from each other."""
        self._minded = False
        self.process: subprocess.Popen[bytes] | None = None
        """The other guard."""

    @property
    def longest(self) -> float:
        """s that `dark` tries by itself."""
        return 1.0 + 3 * self._settings.confirm

    def dark(self) -> tuple[bool, bytes]:
        """Open the port and send the dark bytes: whether it was confirmed, and what was heard.

        Where it was not, and a laser may be lit, another guard then goes on trying.
        """
        if not self._one.acquire(timeout=2 * self.longest):
            return False, b""
        try:
            sure, heard = self._try_until(time.monotonic() + self.longest)
            if not sure and self._maybe_lit.is_set() and not self._minded:
                self._hand_over()
        finally:
            self._one.release()
        return sure, heard

    def _try_until(self, end: float) -> tuple[bool, bytes]:
        heard = b""
        while time.monotonic() < end:
            sure, heard = self._try()
            if sure:
                return True, heard
        return False, heard

    def _try(self) -> tuple[bool, bytes]:
        s = self._settings
        try:
            with contextlib.closing(s.open()) as port:
                sure, heard = darken(
                    DIALECTS[s.dialect].dark(s.outputs), port.write, _hearing(port), s.confirm
                )
        except Exception:  # noqa: BLE001 a port that hangs up meanwhile raises all kinds
            time.sleep(0.02)
            return False, b""
        if sure:
            self._maybe_lit.clear()
        return sure, heard

    def _hand_over(self) -> None:
        """To a guard that goes on without this process."""
        self._minded = True
        self._start_another()
        try:
            threading.Thread(target=self._mind, daemon=True, name="rescuer").start()
        except RuntimeError:  # no more threads; the next dark tries again
            self._minded = False

    def _start_another(self) -> None:
        try:
            self.process = self._start()
        except Exception:  # noqa: BLE001 no memory, too many open files: `_mind` tries again
            self.process = None

    def _mind(self) -> None:
        """While this process lives, one that did not start or was killed is replaced."""
        while True:
            code = None if self.process is None else self.process.wait()
            if code == 0:
                self._maybe_lit.clear()
            if code in (0, 4):
                break
            time.sleep(_guard.AGAIN)
            if self.process is None and self._try()[0]:
                break
            self._start_another()
        self._minded = False


def _hearing(port: Any) -> Callable[[float], bytes]:
    def hear(longest: float) -> bytes:
        port.timeout = min(longest, 0.02)
        data: bytes = port.read(port.in_waiting or 1)
        return data

    return hear
