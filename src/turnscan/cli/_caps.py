"""Options that close a surface, for the verbs that make one."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import click

from turnscan.cli._numbers import Finite
from turnscan.errors import InputError
from turnscan.surface import Caps

Command = TypeVar("Command", bound=Callable[..., Any])


def caps_options(command: Command) -> Command:
    """Give a verb the options of closing; it receives them as ``caps``, None without --close."""

    @click.option("--close", is_flag=True, help="Close the surface; the faces added are marked.")
    @click.option(
        "--fill",
        type=click.Choice(["auto", "flat", "membrane", "tangent", "curvature", "none"]),
        help="With --close, how holes go on: in their plane, as a soap film would, in the tangent "
        "planes of their border, with its curvature too, or not at all; auto takes membrane where "
        "an edge runs round the hole, and tangent elsewhere.  [default: auto]",
    )
    @click.option(
        "--top",
        type=click.Choice(["plane", "fan", "smooth", "hole", "open"]),
        help="With --close, the gap at the top: in its plane, to the axis, with the curvature of "
        "its border, filled like any hole, or left open.  [default: plane]",
    )
    @click.option(
        "--bottom",
        type=click.Choice(["floor", "hole", "open"]),
        help="With --close, the gap at the foot: led down to the platter and closed with its "
        "plane, filled like any hole, or left open.  [default: floor]",
    )
    @click.option(
        "--largest-hole",
        "largest",
        type=Finite(min=0, min_open=True),
        help="With --close, mm across; larger holes stay open.  [default: all are filled]",
    )
    @wraps(command)
    def with_options(
        *args: Any,
        close: bool,
        fill: Any,
        top: Any,
        bottom: Any,
        largest: float | None,
        **others: Any,
    ) -> Any:
        named = {"--fill": fill, "--top": top, "--bottom": bottom, "--largest-hole": largest}
        idle = [name for name, value in named.items() if value is not None]
        if idle and not close:
            raise InputError(f"{', '.join(idle)}: nothing is closed", hint="add --close")
        caps = Caps(
            holes=None if fill == "none" else fill or "auto",
            top=None if top == "hole" else top or "plane",
            bottom="open" if bottom == "open" else "floor",
            floor=None if bottom == "hole" else 0.0,
            largest=largest,
        )
        return command(*args, caps=caps if close else None, **others)

    return with_options  # type: ignore[return-value]
