"""Options of the workflows: each is declared once, as a field of a frozen dataclass.

The command line makes its flags and their help from the fields, a scan file keeps their values,
and all of them are checked by the same limits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from difflib import get_close_matches
from typing import Any, Literal, TypedDict, TypeVar, Unpack

from turnscan.errors import InputError
from turnscan.remedy import Option

Kind = Literal["choice", "number", "count", "switch", "text"]


@dataclass(frozen=True)
class Declared:
    """What there is to know of one option."""

    name: str
    kind: Kind
    help: str
    default: Any
    choices: tuple[str, ...] = ()
    least: float | None = None
    most: float | None = None
    above: bool = False
    """Whether the value must be more than ``least``, not equal to it."""
    optional: bool = False
    """Whether None is a value: it leaves the choice to turnscan."""
    parse: Callable[[str], object] | None = None
    """Of a text: refuses it with ValueError."""
    more: Callable[[], tuple[str, ...]] | None = None
    """Of a choice: what installed packages add, looked up when a value is none of ``choices``."""
    many: bool = False
    """Whether the value is a tuple of such values."""
    unit: str = ""
    """Of a number."""
    group: str = ""
    """Heading under which a form shows it; empty for the first."""

    @property
    def required(self) -> bool:
        """Whether a value must be given."""
        return self.default is None and not self.optional

    def trouble(self, value: object) -> str | None:
        """What is wrong with a value; None where nothing is."""
        if not self.many:
            return self.trouble_of_one(value)
        if not isinstance(value, tuple):
            return f"{value!r} is not a tuple"
        return next(filter(None, map(self.trouble_of_one, value)), None)

    def trouble_of_one(self, value: object) -> str | None:
        """What is wrong with a value, one of several where there are; None where nothing is."""
        if value is None:
            return None if self.optional else "no value is given"
        match self.kind:
            case "switch":
                return None if isinstance(value, bool) else f"{value!r} is not true or false"
            case "choice":
                return None if value in self.choices else self._trouble_of_choice(value)
            case "text":
                return self._trouble_of_text(value)
        return self._trouble_of_number(value)

    def _trouble_of_choice(self, value: object) -> str | None:
        known = (*self.choices, *(self.more() if self.more is not None else ()))
        return None if value in known else f"{value!r} is not one of {', '.join(known)}"

    def _trouble_of_text(self, value: object) -> str | None:
        if not isinstance(value, str):
            return f"{value!r} is not a text"
        try:
            if self.parse is not None:
                self.parse(value)
        except ValueError as e:
            return str(e)
        return None

    def _trouble_of_number(self, value: object) -> str | None:
        whole = self.kind == "count"
        if isinstance(value, bool) or not isinstance(value, int if whole else int | float):
            return f"{value!r} is not a {'whole ' if whole else ''}number"
        if not math.isfinite(value):
            return f"{value!r} is not a finite number"
        if self.least is not None and (value <= self.least if self.above else value < self.least):
            return f"{value} is not {'more than' if self.above else 'at least'} {self.least:g}"
        if self.most is not None and value > self.most:
            return f"{value} is more than {self.most:g}"
        return None


class _More(TypedDict, total=False):
    """What an option may declare besides: the fields of `Declared`, which say what they mean."""

    choices: tuple[str, ...]
    least: float | None
    most: float | None
    above: bool
    optional: bool
    parse: Callable[[str], object] | None
    more: Callable[[], tuple[str, ...]] | None
    many: bool
    unit: str
    group: str


def option(default: Any, kind: Kind, help: str, **more: Unpack[_More]) -> Any:
    """A field of an option class; ``optional`` is whether None is a value, by the default.

    An option without a default that is not optional must be given.
    """
    held = {"kind": kind, "help": help, "optional": default is None, **more}
    return field(default=default, metadata={"declared": held})


def declared(options: Any) -> dict[str, Declared]:
    """The options of an option class, or of a value of one, by name."""
    return {
        f.name: Declared(f.name, default=f.default, **f.metadata["declared"])
        for f in fields(options)
        if "declared" in f.metadata
    }


class Checked:
    """Base of the option classes: every value is within its limits, or InputError names it."""

    def __post_init__(self) -> None:
        for name, option in declared(self).items():
            value = getattr(self, name)
            trouble = option.trouble(value)
            if trouble is not None:
                hint = "choose another value" if value is not None else f"give one: {option.help}"
                raise InputError(trouble, hint=hint, option=Option(name))

    def changed(self) -> Mapping[str, Any]:
        """The options that are not at their default, by name."""
        return {
            name: getattr(self, name)
            for name, option in declared(self).items()
            if getattr(self, name) != option.default
        }

    def carried(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """The options by name that stay where others are changed."""
        return {name: getattr(self, name) for name in declared(self) if name not in changes}


Options = TypeVar("Options", bound=Checked)


def chosen(kind: type[Options], options: Options | None, changes: Mapping[str, Any]) -> Options:
    """The options of a call: those given (None: the usual ones), with some of them changed.

    Raises InputError for an option that the class does not have, and for a value that none can
    have.
    """
    there = declared(kind)
    for name in changes:
        if name not in there:
            near = get_close_matches(name, there, 1)
            hint = f"it is called {near[0]}" if near else f"there is {', '.join(there)}"
            raise InputError(f"no option {name!r}", hint=hint)
    old = {} if options is None else options.carried(changes)
    return kind(**{**old, **changes})
