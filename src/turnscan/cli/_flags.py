"""Flags of the command line, made from the option classes of the workflows."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import click
from click.core import ParameterSource

from turnscan.cli._numbers import Finite
from turnscan.cli._words import flag_of
from turnscan.workflows import Declared, declared

Command = TypeVar("Command", bound=Callable[..., Any])


_METAVARS = {
    "angles": "ANGLES",
    "camera": "ADDRESS",
    "colour": "COLOUR",
    "decimate": "TOL|COUNT",
    "device": "ADDRESS",
    "lamps": "NAME",
    "laser_board": "SPEC",
    "laser_name": "NAME",
    "laser_names": "A,B",
    "lasers": "ADDRESS",
    "limits": "TEST=MM",
    "markers": "DICT:SIDE_MM",
    "pixel_um": "W[,H]",
    "range_deg": "A:B",
    "sensor": "COLSxROWS",
    "spacing_between": "SPACING",
    "step_deg": "ANGLE",
    "table_board": "SPEC",
    "table_laser": "NAME",
    "turntable": "ADDRESS",
}


class _Text(click.ParamType[str]):
    """A text that an option checks by itself."""

    def __init__(self, option: Declared) -> None:
        self.name = _METAVARS.get(option.name, "TEXT")
        self._option = option

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the text, or refuse it naming the flag."""
        trouble = self._option.trouble_of_one(value)
        if trouble is not None:
            self.fail(trouble, param, ctx)
        return value


class _OpenChoice(click.Choice[str]):
    """A choice that installed packages may add to; they are looked up when one is named."""

    def __init__(self, option: Declared) -> None:
        super().__init__(option.choices)
        self._option = option

    def convert(self, value: str, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """Return the choice, or refuse it naming the flag and what there is."""
        if value in self.choices:
            return value
        trouble = self._option.trouble(value)
        if trouble is not None:
            self.fail(trouble, param, ctx)
        return value


def flags_of(options: type[Any], *only: str, into: str = "options") -> Callable[[Command], Command]:
    """Give a verb a flag for each option of a class; it receives the value as ``into``.

    With names given, it gets flags for those alone.
    """
    wanted = {n: o for n, o in declared(options).items() if not only or n in only}

    def decorate(command: Command) -> Command:
        @wraps(command)
        def with_flags(*args: Any, **values: Any) -> Any:
            own = {name: values.pop(name) for name in wanted}
            return command(*args, **{into: options(**own)}, **values)

        made: Any = with_flags
        for option in reversed(wanted.values()):
            made = _flag(option)(made)
        return made  # type: ignore[no-any-return]

    return decorate


def given(*names: str) -> list[str]:
    """The flags of these options that are on the command line."""
    return [flag_of(n.removesuffix("_path")) for n in names if _is_given(n)]


def values_given(kind: type[Any], options: object) -> dict[str, Any]:
    """The options of a class that are on the command line, with their values."""
    return {name: getattr(options, name) for name in declared(kind) if _is_given(name)}


def _is_given(name: str) -> bool:
    source = click.get_current_context().get_parameter_source(name)
    return source is ParameterSource.COMMANDLINE


def _flag(option: Declared) -> Callable[[Any], Any]:
    name = flag_of(option.name)
    if option.kind == "switch":
        return click.option(name, is_flag=True, help=option.help)
    kind: click.ParamType[Any]
    match option.kind:
        case "choice":
            kind = click.Choice(option.choices) if option.more is None else _OpenChoice(option)
        case "count":
            low, high = (None if x is None else int(x) for x in (option.least, option.most))
            kind = click.INT if low is high is None else click.IntRange(low, high)
        case "text":
            kind = _Text(option)
        case _:
            kind = Finite(option.least, option.most, min_open=option.above)
    shown = option.default not in (None, ()) and "[default" not in option.help
    return click.option(
        name, option.name, type=kind, default=option.default, multiple=option.many,
        show_default=shown, help=option.help, required=option.required,
    )  # fmt: skip
