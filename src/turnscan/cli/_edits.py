"""``turnscan edits``: the repairs kept in a scan file, listed, switched, copied."""

from __future__ import annotations

import math
import time
from datetime import datetime
from pathlib import Path

import click

from turnscan.cli._select import RULES, region_where
from turnscan.edit import (
    Action,
    Add,
    Delete,
    History,
    action_from_json,
    action_to_json,
    edit_from_json,
    history_to_json,
    in_words,
)
from turnscan.errors import InputError
from turnscan.scan import Scan
from turnscan.workflows import check_output, write_atomically
from turnscan.workflows._history import history_of, read_history

_path = click.Path(path_type=Path)


_HELP = f"""List the edits kept in SCAN, those undone too, after changing them as the options say.

Nothing is forgotten: the file keeps every action, and the frames are never touched. --make takes
the edits of docs/reference/edits.md; --delete faces of the surface with all edits before it:

{RULES}
"""


@click.command("edits", help=_HELP)
@click.argument("scan", type=_path)
@click.option("-o", "--output", type=_path, help="Write the active edits to this .json file.")
@click.option("--add", "source", type=_path, help="Add the edits of another scan or .json file.")
@click.option(
    "--make", "texts", multiple=True, metavar="JSON", help="Apply an edit, given as JSON."
)
@click.option("--delete", "rules", multiple=True, metavar="RULE", help="Delete faces; see below.")
@click.option(
    "--grow",
    type=click.IntRange(-1000, 1000),
    default=0,
    help="Grow the selection by N rings of faces before deleting; −N shrinks it.",
)
@click.option("--off", type=int, multiple=True, metavar="N", help="Disable edit N.")
@click.option("--on", type=int, multiple=True, metavar="N", help="Enable edit N again.")
@click.option("--branch", type=int, metavar="N", help="Return to the branch that ends with edit N.")
@click.option("--undo", is_flag=True, help="Undo the last edit.")
@click.option("--redo", is_flag=True, help="Redo the next undone edit.")
def verb(
    scan: Path,
    output: Path | None,
    source: Path | None,
    texts: tuple[str, ...],
    rules: tuple[str, ...],
    grow: int,
    off: tuple[int, ...],
    on: tuple[int, ...],
    branch: int | None,
    undo: bool,
    redo: bool,
) -> None:
    """See `_HELP`."""
    _check(scan, output, source, rules, grow)
    added = [] if source is None else [e.edit for e in read_history(source).enabled]
    added += [edit_from_json(text, "--make") for text in texts]
    if added or rules or off or on or undo or redo or branch is not None:
        with Scan.resume(scan) as opened:
            history = history_of(opened)
            actions: list[Action] = []
            if branch is not None:
                history = _then(actions, history, history.branch(branch))
            for edit in added:
                history = _then(actions, history, history.add(edit))
            if rules:
                region = region_where(opened, history, rules, grow)
                history = _then(actions, history, history.add(Delete(region)))
            for number in (*off, *on):
                history = _then(actions, history, history.switch(number, number in on))
            if undo:
                history = _then(actions, history, history.undo())
            if redo:
                _then(actions, history, history.redo())
            # Every one fits the history; only now is anything written.
            for action in actions:
                opened.append_edit(action_to_json(action), time.time())
    with Scan.open(scan) as opened:
        history = history_of(opened)
        times = _times(opened)
    if output is not None:
        write_atomically(output, history_to_json(history).encode())
    for line in _listed(history, times):
        click.echo(line)
    if output is not None:
        click.echo(f"{output}: {history.cursor} edits")


def _check(
    scan: Path, output: Path | None, source: Path | None, rules: tuple[str, ...], grow: int
) -> None:
    """Raise InputError for what cannot be meant, before anything is opened."""
    if grow and not rules:
        raise InputError(f"--grow {grow}: no selection to grow", hint="add --delete RULE")
    if output is not None:
        check_output(output, (".json",), [scan, *([source] if source else [])])


def _then(actions: list[Action], history: History, action: Action) -> History:
    actions.append(action)
    return history.after(action)


def _times(scan: Scan) -> dict[int, float]:
    """When each edit was made."""
    log = scan.edits()
    made = ((action_from_json(entry.text), entry.time) for entry in log)
    return {action.id: at for action, at in made if isinstance(action, Add)}


def _listed(history: History, times: dict[int, float]) -> list[str]:
    lines = [] if history.entries else ["no edits"]
    for place, entry in enumerate(history.entries):
        state = "done" if place < history.cursor else "undone"
        at = times[entry.id]
        when = "" if math.isnan(at) else datetime.fromtimestamp(at).strftime("%Y-%m-%d %H:%M  ")
        mark = state if entry.on else f"{state}, off"
        lines.append(f"{entry.id:>4}  {when}{mark:<11}  {in_words(entry.edit)}")
    here = {e.id for e in history.entries}
    for path in history.branches:
        own = sum(e.id not in here for e in path)
        last = path[-1]
        lines.append(f"{last.id:>4}  branch of {own} other edits; its last: {in_words(last.edit)}")
    return lines
