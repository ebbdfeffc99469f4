"""Remedy: what to do about a finding or an error, with the options it names as data.

The command line words an option as a flag, the browser as a button or a field, Python as an
argument; so texts below the doors hold the option itself, not one door's word for it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Option:
    """An option of a verb, by name."""

    name: str
    """Name of the field or argument, like ``first_step``."""
    value: str | float | None = None
    """The value it has or should get; None where no value is meant."""

    def __str__(self) -> str:
        """As an argument in Python."""
        return self.name if self.value is None else f"{self.name}={self.value_text}"

    @property
    def value_text(self) -> str:
        """The value, as it is written."""
        return f"{self.value:g}" if isinstance(self.value, float) else str(self.value)


@dataclass(frozen=True, init=False)
class Remedy:
    """What to do next: words, and the options among them.

    >>> remedy = Remedy("give ", Option("dark"), ", or a lower ", Option("threshold", 4))
    >>> str(remedy)
    'give dark, or a lower threshold=4'
    >>> [option.name for option in remedy.options]
    ['dark', 'threshold']
    """

    parts: tuple[str | Option, ...]

    def __init__(self, *parts: str | Option) -> None:
        object.__setattr__(self, "parts", parts)

    def __str__(self) -> str:
        """In words, the options as arguments in Python."""
        return self.worded(str)

    @property
    def options(self) -> tuple[Option, ...]:
        """The options that it names."""
        return tuple(part for part in self.parts if isinstance(part, Option))

    def worded(self, word: Callable[[Option], str]) -> str:
        """In the words of a door, which says by ``word`` how it calls an option."""
        return "".join(part if isinstance(part, str) else word(part) for part in self.parts)


def plain_words(remedy: str | Remedy) -> str:
    """What to do, each option of it by its name in quotes, as people read it in pages and reports.

    >>> plain_words(Remedy("give its width (", Option("margin_mm"), ")"))
    'give its width (“margin mm”)'
    """
    return remedy if isinstance(remedy, str) else remedy.worded(_in_quotes)


def _in_quotes(option: Option) -> str:
    name = option.name.replace("_", " ")
    return f"“{name}”" if option.value is None else f"“{name} {option.value_text}”"
