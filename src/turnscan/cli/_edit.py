"""``turnscan edit``: repair one scan in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from turnscan import workflows
from turnscan.cli._serving import run, serving_options


@click.command("edit")
@click.argument("scan", metavar="NAME.turnscan", type=click.Path(path_type=Path))
@serving_options
def verb(scan: Path, serving: dict[str, Any]) -> None:
    """Repair the scan in NAME.turnscan in a browser; every edit is stored in the file.

    Prints a link that lets one browser in and opens it. Ends with Ctrl-C.
    """
    with workflows.open_scan(scan):
        pass  # what is no scan file is said here, before a server is started
    run(scan.resolve().parent, scan, serving)
