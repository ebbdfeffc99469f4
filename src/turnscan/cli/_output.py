"""The options of the file formats."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import click

from turnscan import workflows

Command = TypeVar("Command", bound=Callable[..., Any])


def format_options(command: Command) -> Command:
    """Give a verb the options of the file formats; it receives them as ``formats``."""

    @click.option(
        "--dxf-form",
        "forms",
        multiple=True,
        default=("3dface",),
        show_default=True,
        type=click.Choice(["3dface", "polyface", "mesh", "profiles"]),
        help="DXF entities that hold the part; may be repeated, each on its own layer.",
    )
    @click.option(
        "--dxf-version",
        "version",
        type=click.Choice(["R12", "R2010"]),
        help="DXF version.  [default: R12, which all programs read; R2010 for form mesh]",
    )
    @click.option("--ascii", "text", is_flag=True, help="Write STL and PLY as text.")
    @click.option(
        "--float32", "single", is_flag=True, help="Write PLY coordinates as 32-bit numbers."
    )
    @wraps(command)
    def with_options(
        *args: Any, forms: Any, version: Any, text: bool, single: bool, **others: Any
    ) -> Any:
        options = workflows.ExportOptions(
            dxf_forms=tuple(dict.fromkeys(forms)),
            dxf_version=version or ("R2010" if "mesh" in forms else "R12"),
            ascii=text,
            single=single,
        )
        return command(*args, formats=options, **others)

    return with_options  # type: ignore[return-value]
