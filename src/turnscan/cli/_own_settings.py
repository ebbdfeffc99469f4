"""The settings that a scan keeps, and the flags that change them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of, values_given

Command = TypeVar("Command", bound=Callable[..., Any])


def base_option(command: Command) -> Command:
    """Give a verb the flag that says which settings its options change."""
    return click.option(
        "--settings",
        "base",
        type=click.Choice(["own", "default"]),
        help="Settings that the options of this command modify: those stored in the scan by its "
        "last reconstruction, or the defaults.  [default: own without such options, default with]",
    )(command)


def settings_options(command: Command) -> Command:
    """Give a verb the flags of a reconstruction, and of the set of settings that they change."""
    name = click.option(
        "--set",
        "name",
        default="default",
        show_default=True,
        metavar="NAME",
        help="Named set of settings in the scan, in which this reconstruction stores its own.",
    )
    return flags_of(workflows.ReconstructOptions)(base_option(name(command)))


def chosen_options(
    source: Path, options: workflows.ReconstructOptions, base: str | None, name: str
) -> workflows.ReconstructOptions | None:
    """The options to reconstruct with; None for the scan's own."""
    named = values_given(workflows.ReconstructOptions, options)
    if base == "own":
        return workflows.options_of(source, name, **named)
    return options if named or base == "default" else None


def options_for_each(
    options: workflows.ReconstructOptions, base: str | None
) -> tuple[workflows.ReconstructOptions | None, dict[str, Any]]:
    """The options for all scans of a command, None for each its own, and what changes them."""
    named = values_given(workflows.ReconstructOptions, options)
    if base == "own":
        return None, named
    return (options if named or base == "default" else None), {}


def show_own(result: workflows.ReconstructResult) -> None:
    """Say what the scan's own settings are, where they are not the usual ones."""
    own = ", ".join(f"{name}={value}" for name, value in result.options.changed().items())
    if own:
        click.echo(f"settings kept in the scan: {own}", err=True)
