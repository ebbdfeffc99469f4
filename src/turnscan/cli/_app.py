"""``turnscan app``: the workshop in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from turnscan.cli._serving import run, serving_options
from turnscan.errors import InputError


@click.command("app")
@click.argument("folder", required=False, type=click.Path(path_type=Path))
@serving_options
def verb(folder: Path | None, serving: dict[str, Any]) -> None:
    """Scan, inspect, repair and export in a browser, with the scan files of FOLDER (default: the
    current one).

    Prints a link that lets one browser in and opens it. Listens on this computer alone unless
    --allow-remote and --host say otherwise; lasers cannot be lit from other computers without
    --allow-remote-lasers. Ends with Ctrl-C, lasers dark.
    """
    place = folder or Path()
    if place.is_file():
        raise InputError(f"{place}: a file", hint="name its folder, or open it with turnscan edit")
    if not place.is_dir():
        raise InputError(f"{place}: no such folder", hint="make it, or name another one")
    run(place, None, serving)
