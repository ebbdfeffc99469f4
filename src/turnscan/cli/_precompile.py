"""``turnscan precompile``: compile the kernels before the first scan."""

from __future__ import annotations

import click

from turnscan import workflows
from turnscan.cli._progress import progress_bar
from turnscan.cli._signals import ended_by_signals


@click.command("precompile")
def verb() -> None:
    """Compile what a scan and its surface need, once for this machine and version.

    Otherwise the first scan does it, on its way. Takes half a minute on two processors, and no
    time when it was done before.
    """
    with ended_by_signals(), progress_bar() as bar:
        workflows.precompile(bar)
