"""How far long work is, for whoever waits for it."""

from __future__ import annotations

from collections.abc import Callable

Told = Callable[[float], None]
"""Hears the share that is done, 0 to 1. What it raises ends the work, and nothing has happened."""


def silent(share: float) -> None:
    """Report nothing."""


def part(told: Told, begin: float, end: float) -> Told:
    """What hears of a part of the work, from ``begin`` to ``end`` of the whole."""

    def hear(share: float) -> None:
        told(begin + (end - begin) * share)

    return hear
