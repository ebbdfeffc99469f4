"""``turnscan edits``: the repairs kept in a scan file, listed, switched, copied."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from turnscan import workflows
from turnscan.cli._progress import progress_bar
from turnscan.cli._words import with_flags

_path = click.Path(path_type=Path)


_HELP = f"""List the edits kept in SCAN, those undone too, after changing them as the options say.

Nothing is forgotten: the file keeps every action, and the frames are never touched. --make takes
the edits of docs/reference/edits.md; --delete faces of the surface with all edits before it:

{workflows.SELECTION_RULES}
"""


@click.command("edits", help=_HELP)
@click.argument("scan", type=_path)
@click.option("-o", "--output", type=_path, help="Write the active edits to this .json file.")
@click.option("--add", "source", type=_path, help="Add the edits of another scan or .json file.")
@click.option(
    "--only",
    type=int,
    multiple=True,
    metavar="N",
    help="Of --add: only its edit N; may be repeated.",
)
@click.option(
    "--by-shape",
    is_flag=True,
    help="Of --add: its measurements alone, where the part stands in SCAN.",
)
@click.option(
    "--check",
    is_flag=True,
    help="Of --add: make the surface, and say which of the edits do not fit SCAN.",
)
@click.option("--make", multiple=True, metavar="JSON", help="Apply an edit, given as JSON.")
@click.option(
    "--delete",
    multiple=True,
    metavar="RULE",
    help="Delete faces by a rule, see above; may be repeated.",
)
@click.option(
    "--grow",
    type=click.IntRange(-1000, 1000),
    default=0,
    help="Grow the selection by N rings of faces before deleting; a negative N shrinks it.",
)
@click.option("--off", type=int, multiple=True, metavar="N", help="Disable edit N.")
@click.option("--on", type=int, multiple=True, metavar="N", help="Enable edit N again.")
@click.option(
    "--name",
    type=(int, str),
    multiple=True,
    metavar="N TEXT",
    help="Name edit N; an empty text takes the name away.",
)
@click.option(
    "--to",
    type=click.IntRange(0),
    metavar="N",
    help="Go to the state after edit N, of a branch too; 0: as scanned.",
)
@click.option("--undo", is_flag=True, help="Undo the last edit.")
@click.option("--redo", is_flag=True, help="Redo the next undone edit.")
def verb(
    scan: Path,
    output: Path | None,
    **changes: Any,
) -> None:
    """See `_HELP`."""
    wanted = workflows.EditChanges(**changes)
    with progress_bar() as bar:
        kept = workflows.edits(scan, wanted, output=output, progress=bar)
    for finding in kept.findings:
        click.echo(with_flags(finding), err=True)
    click.echo("\n".join(kept.lines()))
    if output is not None:
        click.echo(f"{output}: {kept.done} edits")
