"""Lasers that remember what was confirmed of them, and when."""

from __future__ import annotations

import time
from dataclasses import dataclass

from turnscan.devices import Lasers, Sweeping


@dataclass(frozen=True)
class KnownLaser:
    """What is known of a laser."""

    name: str
    lit: bool | None
    """None: not known."""
    age: float
    """s since it was confirmed."""


class WatchedLasers:
    """`turnscan.devices.Lasers` around others.

    Between an order and its confirmation, and after an order that failed, nobody knows what they
    do: then ``lit`` is None, and a page shows them as lit.
    """

    def __init__(self, lasers: Lasers) -> None:
        self._lasers = lasers
        self._lit: frozenset[str] | None = None
        self._at = time.monotonic()

    @property
    def names(self) -> tuple[str, ...]:
        """The lasers there are."""
        return self._lasers.names

    def light(self, lit: frozenset[str], lease: float) -> None:
        """See `Lasers`."""
        self._lit = None
        self._lasers.light(lit, lease)
        self._confirmed(lit)

    def renew(self, lease: float) -> None:
        """See `Lasers`."""
        lit = self._lit
        self._lasers.renew(lease)
        if lit is not None and lit is self._lit:
            self._confirmed(lit)

    def off(self) -> None:
        """See `Lasers`."""
        self._lit = None
        self._lasers.off()
        self._confirmed(frozenset())

    @property
    def states(self) -> list[KnownLaser]:
        """What is known of each, and since when."""
        lit, age = self._lit, time.monotonic() - self._at
        return [KnownLaser(n, None if lit is None else n in lit, age) for n in self.names]

    def _confirmed(self, lit: frozenset[str]) -> None:
        self._lit, self._at = lit, time.monotonic()


class WatchedSweeping(WatchedLasers):
    """The same around lasers whose line a mirror draws."""

    def __init__(self, lasers: Lasers, sweeping: Sweeping) -> None:
        super().__init__(lasers)
        self._sweeping = sweeping

    def check_exposure(self, seconds: float) -> None:
        """See `Sweeping`."""
        self._sweeping.check_exposure(seconds)


def watched(lasers: Lasers) -> WatchedLasers:
    """Lasers that remember, and can what the given ones can."""
    if isinstance(lasers, Sweeping):
        return WatchedSweeping(lasers, lasers)
    return WatchedLasers(lasers)
