"""Control: pause, go on and abort a running scan from any other thread."""

from __future__ import annotations

import threading
from collections.abc import Callable

_LOOK_EVERY = 0.5
"""s between looks at a pause that is not ended."""


class Control:
    """Handed to `turnscan.acquire.run`; all methods may be called from any thread, at any time."""

    def __init__(self) -> None:
        self._go = threading.Event()
        self._go.set()
        self._aborted = threading.Event()
        self._at_once: Callable[[], None] = lambda: None

    def pause(self) -> None:
        """Wait after the picture that is being taken, lasers dark."""
        self._go.clear()

    def go_on(self) -> None:
        """End the pause."""
        self._go.set()

    def abort(self) -> None:
        """End the scan: lasers dark and the table stopped at once, what was taken stored."""
        self._aborted.set()
        self._go.set()
        self._at_once()

    @property
    def paused(self) -> bool:
        """Whether a pause is wanted."""
        return not self._go.is_set()

    @property
    def aborted(self) -> bool:
        """Whether an end is wanted."""
        return self._aborted.is_set()

    def on_abort(self, at_once: Callable[[], None]) -> None:
        """What `abort` does in its own thread, at once where it has come already."""
        self._at_once = at_once
        if self.aborted:
            at_once()

    def wait(self) -> None:
        """Return when there is no pause any more."""
        while not self._go.wait(_LOOK_EVERY):
            pass
