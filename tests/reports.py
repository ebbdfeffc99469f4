"""Progress that tests look at."""

from __future__ import annotations

from turnscan.progress import Progress


def into(fractions: list[float]) -> Progress:
    """Progress that puts each fraction it hears of into a list."""
    return Progress(lambda fraction, _: fractions.append(fraction))
