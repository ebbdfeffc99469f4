"""How many messages a browser may send: so many a second, and a burst of them at once."""

from __future__ import annotations

import time

RATE, BURST = 60.0, 120.0
"""Messages a second, and at once."""

_spent: dict[str, float] = {}
"""When a browser was disconnected for sending too much, until it has a whole burst again."""


class Allowance:
    """What one connection of a browser may still send.

    A browser that was disconnected for too much, and connects again, gets no new burst at once.
    It belongs to the thread of the event loop.
    """

    def __init__(self, browser: str) -> None:
        now = self._at = time.monotonic()
        for other, since in list(_spent.items()):
            if now - since >= BURST / RATE:
                del _spent[other]
        self._browser = browser
        self._left = RATE * (now - _spent[browser]) if browser in _spent else BURST

    def take(self) -> bool:
        """Whether it may send one message more now."""
        now = time.monotonic()
        self._left, self._at = min(BURST, self._left + RATE * (now - self._at)) - 1.0, now
        if self._left < 0:
            _spent[self._browser] = now
        return self._left >= 0
