"""One progress bar, on the terminal only."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import click

from turnscan.progress import Progress, no_progress


@contextmanager
def progress_bar(*, lines: bool = False) -> Iterator[Progress]:
    """Show how far a workflow is on stderr while the block runs.

    Where that is no terminal nothing is shown, or, with ``lines``, a line each tenth of the work.
    """
    if not sys.stderr.isatty():
        yield _tenths() if lines else no_progress
        return
    from rich import progress as rich
    from rich.console import Console

    columns = (
        rich.TextColumn("{task.description}"),
        rich.BarColumn(),
        rich.TaskProgressColumn(),
        rich.TimeRemainingColumn(),
    )
    with rich.Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=1.0)

        def show(fraction: float, text: str) -> None:
            bar.update(task, completed=fraction, description=text)

        yield Progress(show)


def _tenths() -> Progress:
    began, said = time.monotonic(), 0

    def show(fraction: float, text: str) -> None:
        nonlocal said
        if int(10 * fraction) > said:
            said = int(10 * fraction)
            left = (time.monotonic() - began) * (1 / fraction - 1)
            click.echo(f"{text}, {left:.0f} s left", err=True)

    return Progress(show)
