"""What verbs that find something out about a part share: a report, and figures as text or JSON."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import click

from turnscan.cli._output import report_option
from turnscan.cli._words import with_flags
from turnscan.findings import Finding

Command = TypeVar("Command", bound=Callable[..., Any])


def found_flags(outputs: str, table: str = "dimensions") -> Callable[[Command], Command]:
    """Flags for files, whose help is ``outputs``, for reports with a CSV ``table``, and JSON."""
    path = click.Path(path_type=Path)
    flags = (
        click.option("-o", "--output", "outputs", multiple=True, type=path,
                     help=f"{outputs}; may be repeated."),
        report_option(f".html or .pdf with pictures, .json, or the {table} as .csv"),
        click.option("--json", "as_json", is_flag=True,
                     help="Print the results as JSON, unrounded."),
    )  # fmt: skip

    def add(command: Command) -> Command:
        for flag in reversed(flags):
            command = flag(command)
        return command

    return add


def tell_findings(findings: Iterable[Finding]) -> None:
    """Print what is to be remarked, a line each."""
    for finding in findings:
        click.echo(with_flags(finding), err=True)


def tell_found(found: Any, as_json: bool, written: Iterable[Path]) -> None:
    """Print figures, and the files that were written: beside JSON they are no results."""
    click.echo(json.dumps(found.figures(), indent=1) if as_json else str(found))
    for path in written:
        click.echo(f"{path}: written", err=as_json)
