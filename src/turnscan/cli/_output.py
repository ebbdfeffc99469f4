"""The options of the files that verbs write."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar

import click

from turnscan import workflows
from turnscan.cli._flags import flags_of

Command = TypeVar("Command", bound=Callable[..., Any])


def report_option(about: str) -> Callable[[Command], Command]:
    """Give a verb a flag for reports, of which it writes each; it receives them as ``reports``."""
    return click.option(
        "--report", "reports", multiple=True, type=click.Path(path_type=Path),
        help=f"Report to write: {about}; may be repeated.",
    )  # fmt: skip


def format_options(command: Command) -> Command:
    """Give a verb the options of the formats of its ``outputs``; it gets them as ``formats``."""

    @flags_of(workflows.FormatOptions, into="formats")
    @wraps(command)
    def with_options(
        *args: Any, formats: workflows.FormatOptions, outputs: tuple[Path, ...], **others: Any
    ) -> Any:
        chosen = formats.export_options(outputs)
        return command(*args, formats=chosen, outputs=outputs, **others)

    return with_options  # type: ignore[return-value]
