"""A mutant: one change of one file, and the tests that should notice it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutant:
    """The text of ``path`` from ``start`` to ``stop`` is replaced."""

    room: str
    path: str
    """Of the file, from ``src/turnscan``."""
    start: int
    """Characters from the beginning of the file."""
    stop: int
    new: str
    where: str
    """The function or constant that it is in."""
    old: str
    """The text replaced, as Python would write it."""
    name: str = ""
    """What is wrong with it, of those that were written by hand."""
    nth: int = 1
    """Which of several like it in the same place."""

    @property
    def change(self) -> str:
        """The change in one line."""
        return self.name or f"{_short(self.old)} → {_short(self.new)}"

    @property
    def key(self) -> str:
        """What names it as long as neither its place nor its change changes."""
        again = f" ({self.nth})" if self.nth > 1 else ""
        return f"{self.path}:{self.where}: {self.change}{again}"

    def applied(self, text: str) -> str:
        """The file's text with the change."""
        return text[: self.start] + self.new + text[self.stop :]


@dataclass(frozen=True)
class Result:
    """What became of a mutant."""

    mutant: Mutant
    by: str
    """The test that noticed, or what else ended it; "" where it survived."""
    seconds: float

    @property
    def killed(self) -> bool:
        """Whether anything noticed."""
        return bool(self.by)


def _short(text: str) -> str:
    words = " ".join(text.split())
    return words if len(words) <= 60 else words[:28] + " … " + words[-28:]
