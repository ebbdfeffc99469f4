"""A figure beside what was asked of it, and the table of several."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

HEAD = ("| figure | asked | reached | |", "|---|---|---|---|")


@dataclass(frozen=True)
class Figure:
    """One line of the table."""

    name: str
    asked: str
    reached: str
    met: bool | None = None
    """None where nothing was asked."""

    @property
    def line(self) -> str:
        """As it stands in the table."""
        verdict = {True: "met", False: "**missed**", None: ""}[self.met]
        return f"| {self.name} | {self.asked} | {self.reached} | {verdict} |"


def at_most(name: str, value: float, limit: float, unit: str, digits: int = 3) -> Figure:
    """A figure whose size must not be beyond a limit; a NaN is."""
    asked = f"≤ {limit:g} {unit}"
    return Figure(name, asked, f"{value:+.{digits}f} {unit}", abs(value) <= limit)


def within(name: str, value: float, low: float, high: float, digits: int = 2) -> Figure:
    """A figure that must lie between two limits."""
    asked = f"{low:g} to {high:g}"
    return Figure(name, asked, f"{value:.{digits}f}", low <= value <= high)


def table(figures: Iterable[Figure]) -> list[str]:
    """The lines of the table."""
    return [*HEAD, *(f.line for f in figures)]
