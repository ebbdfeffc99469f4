"""Lasers that burn while the work goes on, and for two seconds at most once nothing shows it."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator
from contextvars import ContextVar

from turnscan.devices._guard import LONGEST_LEASE as LEASE
from turnscan.devices._protocols import Lasers
from turnscan.errors import LeaseEnded, TurnscanError

_SELDOM = 0.1
"""s from one renewal to the next, at least; drivers may give many signs of life."""


class _Fire:
    """What burns, and until when if there is no further sign that the work goes on."""

    def __init__(self, lasers: Lasers) -> None:
        self._lasers = lasers
        self.seen = self._renewed = time.monotonic()
        """Of the last sign of life, and of the last renewal."""
        self._over = self._exposed = False

    @property
    def is_out(self) -> bool:
        """Whether the lease has run out; it never comes back."""
        self._over = self._over or time.monotonic() >= self._renewed + LEASE
        return self._over

    @property
    def failed(self) -> bool:
        """Whether it was out in an exposure, or went out while one may be under way."""
        return not self.lasted and self.is_out

    @property
    def lasted(self) -> bool:
        """Whether it burned throughout the last exposure, which is over."""
        return self._exposed

    def exposed(self) -> None:
        """Whether it lasted is decided now."""
        self._exposed = not self.is_out

    def renew(self) -> None:
        """Never lights anything, so it does no harm when it comes late."""
        if self.is_out or time.monotonic() < self._renewed + _SELDOM:
            return
        begin = time.monotonic()
        with contextlib.suppress(TurnscanError):  # whoever lit them meets it, too
            self._lasers.renew(LEASE)
            self._renewed = begin

    def end(self) -> bool:
        """No renewal any more; whether it had failed before."""
        failed, self._over = self.failed, True
        return failed


_FIRE: ContextVar[_Fire | None] = ContextVar("fire", default=None)


@contextlib.contextmanager
def burning(lasers: Lasers, lit: frozenset[str]) -> Iterator[None]:
    """Exactly ``lit`` burns inside the block, and nothing after it.

    For two seconds, and for two more with each sign of life: drivers give one with `alive` for
    each picture that comes out of a camera, and `Steady` while an exposure lasts. A program that
    dies, or hangs anywhere, gives none. Raises LeaseEnded at the block's end where the lasers went
    dark inside it, and DeviceError and SafetyError as ``lasers`` do.
    """
    if not lit:
        yield
        return
    fire = _Fire(lasers)
    lasers.light(lit, LEASE)
    before = _FIRE.set(fire)
    failed = False
    try:
        yield
    finally:
        _FIRE.reset(before)
        failed = fire.end()
        with contextlib.suppress(*([LeaseEnded] if fire.lasted else [])):
            lasers.light(frozenset(), LEASE)
    if failed:
        raise LeaseEnded(
            f"laser {', '.join(sorted(lit))}: was switched off, because no picture arrived "
            f"within {LEASE:g} s",
            hint="check the camera and its cable",
        )


def alive() -> None:
    """A sign of life: what this context lit may burn for two seconds from now.

    For the thread that works, when something that it waited for has come: a picture, an answer.
    Never for one that would go on while the work hangs. It lights nothing, and where nothing burns
    it does nothing.
    """
    if (fire := _FIRE.get(None)) is not None:
        fire.seen = time.monotonic()
        fire.renew()


def exposing(seconds: float) -> None:
    """What burns may burn on where the last sign of life is less than ``seconds`` ago.

    For an exposure that lasts longer than a lease: so long nothing can come.
    """
    fire = _FIRE.get(None)
    if fire is not None and time.monotonic() < fire.seen + seconds:
        fire.renew()


def exposed() -> None:
    """The exposure of the next picture is over, however long the picture itself takes to come.

    No sign of life: what burns goes dark with its lease, but that is no fault any more.
    """
    if (fire := _FIRE.get(None)) is not None:
        fire.exposed()


def went_out() -> bool:
    """Whether what this context lit went dark while a picture needed it."""
    fire = _FIRE.get(None)
    return fire is not None and fire.failed
