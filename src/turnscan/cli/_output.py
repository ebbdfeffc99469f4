"""The options of the file formats."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

from turnscan import workflows
from turnscan.cli._flags import flags_of

Command = TypeVar("Command", bound=Callable[..., Any])


def format_options(command: Command) -> Command:
    """Give a verb the options of the file formats; it receives them as ``formats``."""

    @flags_of(workflows.FormatOptions, into="formats")
    @wraps(command)
    def with_options(*args: Any, formats: workflows.FormatOptions, **others: Any) -> Any:
        return command(*args, formats=formats.export_options, **others)

    return with_options  # type: ignore[return-value]
