"""How many messages a browser may send: so many a second, and a burst of them at once."""

from __future__ import annotations

import time

RATE, BURST = 60.0, 120.0
"""Messages a second, and at once."""


class Allowances:
    """Of all browsers. It belongs to the thread of the event loop."""

    def __init__(self) -> None:
        self.spent: dict[str, float] = {}
        """When a browser was hung up for sending too much; none that has a whole burst again."""

    def of(self, browser: str) -> Allowance:
        """What a new connection of a browser may send: no new burst after it was hung up."""
        now = time.monotonic()
        self.spent = {b: at for b, at in self.spent.items() if now - at < BURST / RATE}
        left = RATE * (now - self.spent[browser]) if browser in self.spent else BURST
        return Allowance(self, browser, left)


class Allowance:
    """What one connection may still send."""

    def __init__(self, all_of_them: Allowances, browser: str, left: float) -> None:
        self._all, self._browser, self._left = all_of_them, browser, left
        self._at = time.monotonic()

    def take(self) -> bool:
        """Whether it may send one message more now."""
        now = time.monotonic()
        self._left, self._at = min(BURST, self._left + RATE * (now - self._at)) - 1.0, now
        if self._left < 0:
            self._all.spent[self._browser] = now
        return self._left >= 0
