"""``turnscan batch``: many scans by one recipe."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from turnscan import workflows
from turnscan.cli._numbers import Finite
from turnscan.cli._progress import progress_bar
from turnscan.cli._signals import ended_by_signals


@click.command("batch")
@click.argument("recipe", type=click.Path(path_type=Path))
@click.argument("sources", nargs=-1, required=True)
@click.option("-o", "--output", required=True, help="Folder for the results; made where missing.")
@click.option(
    "--workers",
    type=click.IntRange(1),
    help="Processes on this machine.  [default: one per processor]",
)
@click.option(
    "--dask",
    metavar="ADDRESS",
    help="Use the Dask cluster whose scheduler is at this address, like tcp://host:8786.",
)
@click.option("--again", is_flag=True, help="Repeat also what is there already.")
@click.option(
    "--tries",
    type=click.IntRange(1),
    default=3,
    show_default=True,
    help="How often a scan is tried whose worker ends without an answer.",
)
@click.option(
    "--limit",
    type=Finite(),
    default=3600.0,
    show_default=True,
    help="Longest time for one try of one scan, s.",
)
def verb(
    recipe: Path,
    sources: tuple[str, ...],
    output: str,
    workers: int | None,
    dask: str | None,
    again: bool,
    tries: int,
    limit: float,
) -> None:
    """Reconstruct, compare and export SOURCES as the TOML file RECIPE says.

    SOURCES are scan files, folders of scan files, folders of pictures, or addresses of object
    storage. A batch that is begun again goes on where it stopped: results are named by the content
    of the scan and of the recipe. What goes wrong with one scan is reported, and the others go on.

    The folder has a table at the end: index.html with pictures, batch.csv and batch.sqlite. The
    exit code is 1 where a scan has no result or does not pass.
    """
    patience = workflows.Patience(tries, limit)
    with ended_by_signals(), progress_bar(lines=True) as bar:
        done = workflows.batch(
            sources,
            recipe,
            output,
            workers=workers,
            dask=dask,
            again=again,
            patience=patience,
            progress=bar,
        )
    click.echo(f"{done}\n{workflows.table_of(done)}")
    sys.exit(1 if done.failed else 0)
