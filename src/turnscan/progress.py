"""Progress of long work: how much of it is done, what it is at, and whether it is still wanted."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

Item = TypeVar("Item")


class Cancelled(Exception):
    """The work was cancelled by whoever waits for it; what it was to write is not written."""


def _ignore(fraction: float, text: str) -> None:
    """Show nothing."""


def _never() -> bool:
    """Keep the work going."""
    return False


@dataclass(frozen=True)
class Progress:
    """Reports how far long work is, and ends the work when it is cancelled.

    A function that takes long takes a ``Progress`` and calls it with the fraction of its own work
    that is done. It hands a `subrange` to each function that does a part of the work. The caller
    decides what becomes of the reports: a bar, a message to the browser, nothing (`no_progress`).

    >>> reports = []
    >>> progress = Progress(lambda fraction, text: reports.append((fraction, text)))
    >>> progress.subrange(0.5, 1.0, "importing")(0.5)
    >>> reports
    [(0.75, 'importing')]
    """

    listener: Callable[[float, str], None] = _ignore
    """Called with the fraction done, 0 to 1, and what the work is at; from any thread of it."""
    cancelled: Callable[[], bool] = _never
    """Asked at each report; when it returns True, the report raises `Cancelled`."""
    text: str = ""
    """What the work is at, where a report does not say."""
    begin: float = 0.0
    """Fraction of the whole work at which this part of it begins."""
    end: float = 1.0
    """Fraction of the whole work at which this part of it ends."""

    def __call__(self, fraction: float, text: str = "") -> None:
        """Report that ``fraction`` (0 to 1) of this part is done.

        Raises Cancelled where the work is no longer wanted.
        """
        if self.cancelled():
            raise Cancelled(text or self.text)
        within = min(max(fraction, 0.0), 1.0)
        self.listener(self.begin + (self.end - self.begin) * within, text or self.text)

    def subrange(self, begin: float, end: float, text: str = "") -> Progress:
        """The progress of a part of this work, from fraction ``begin`` to ``end`` of it."""
        size = self.end - self.begin
        return replace(
            self,
            text=text or self.text,
            begin=self.begin + size * begin,
            end=self.begin + size * end,
        )

    def counter(self, total: int, text: str = "") -> Callable[[], None]:
        """A function to call after each of ``total`` equal steps, from any thread.

        It raises Cancelled where the work is no longer wanted.
        """
        lock = threading.Lock()
        done = 0

        def count() -> None:
            nonlocal done
            with lock:
                done += 1
                self(done / max(total, 1), text)

        return count

    def track(self, items: Sequence[Item], text: str = "") -> Iterator[Item]:
        """The items one after the other; each is reported as done when the next one is taken.

        Raises Cancelled where the work is no longer wanted.
        """
        self(0.0, text)
        count = self.counter(len(items), text)
        for item in items:
            yield item
            count()


no_progress = Progress()
"""Reports nothing and is never cancelled."""
