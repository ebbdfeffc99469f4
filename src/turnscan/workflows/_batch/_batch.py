"""Batch: many scans, or folders of pictures, by one recipe."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from turnscan.errors import ExportError, InputError
from turnscan.progress import Progress, no_progress
from turnscan.remedy import Option
from turnscan.threads import thread_count
from turnscan.workflows._batch import _storage as storage
from turnscan.workflows._batch._outcomes import Outcomes, PackedOutcome
from turnscan.workflows._batch._recipe import Recipe, read_recipe
from turnscan.workflows._batch._scratch import swept
from turnscan.workflows._batch._table import HTML, write_tables
from turnscan.workflows._batch._task import Task
from turnscan.workflows._batch._workers import Patience, on_cluster, on_this_machine


@dataclass(frozen=True)
class Batch:
    """What became of the scans of a batch, in their order."""

    folder: str
    outcomes: Outcomes

    @property
    def failed(self) -> bool:
        """Whether a scan has no result, or one that does not pass."""
        return any(outcome.state in ("error", "fail") for outcome in self.outcomes)

    def __str__(self) -> str:
        counts = Counter[str](outcome.state for outcome in self.outcomes)
        words = {"done": "done", "pass": "passed", "fail": "failed", "error": "without a result"}
        said = ", ".join(
            f"{counts[state]} {word}" for state, word in words.items() if counts[state]
        )
        reused = sum(outcome.reused for outcome in self.outcomes)
        there = f" ({reused} of them were there already)" if reused else ""
        lines = [f"{len(self.outcomes)} scans: {said}{there}"]
        lines += [
            f"{o.source}: {o.problem.removeprefix(f'{o.source}: ') or o.state}"
            for o in self.outcomes
            if o.state in ("error", "fail")
        ]
        return "\n".join(lines)


def batch(
    sources: Sequence[str | PathLike[str]],
    recipe: Recipe | str | PathLike[str],
    output: str | PathLike[str],
    *,
    workers: int | None = None,
    dask: str | None = None,
    again: bool = False,
    patience: Patience | None = None,
    progress: Progress = no_progress,
) -> Batch:
    """Reconstruct, compare and export many scans by one recipe.

    Each scan has a folder of its own, named by its content and the recipe: a batch that is begun
    again goes on where it stopped. What goes wrong with a scan is told, and the others go on. At
    the end the folder has a table: ``batch.sqlite``, ``batch.csv`` and ``index.html``.

    Parameters
    ----------
    sources
        Scan files, folders of them, folders of pictures, or addresses of object storage.
    recipe
        What becomes of each, or the TOML file that says it.
    output
        Folder for the results; it is made where it is missing.
    workers
        Processes on this machine; None takes one for each processor.
    dask
        Address of the scheduler of a Dask cluster that does the work instead.
    again
        Make also what is there already.
    patience
        How long and how often a scan is tried.
    progress
        Told how far it is; when it cancels, what is done stays.

    Returns
    -------
    Batch
        An outcome for each scan.

    Raises
    ------
    InputError
        Where recipe, scans or output cannot be used.
    ExportError
        Where results cannot be written.

    >>> import turnscan as ts
    >>> done = ts.batch(["cup.turnscan"], "recipe.toml", "results")
    >>> done.failed, done.outcomes[0].state
    (False, 'done')
    """
    if workers is not None and workers < 1:
        raise InputError(f"{workers} workers", hint="give 1 or more", option=Option("workers"))
    chosen = recipe if isinstance(recipe, Recipe) else read_recipe(Path(recipe))
    places = [place for source in sources for place in storage.found(os.fspath(source))]
    places = list(dict.fromkeys(places))
    if not places:
        raise InputError("no scan is named", hint="give scan files or folders")
    folder = _folder(os.fspath(output))
    tasks = [Task(place, chosen, folder, again) for place in places]
    patience = patience or Patience()
    running = (
        on_cluster(tasks, dask, patience)
        if dask is not None
        else on_this_machine(tasks, workers or thread_count(), patience)
    )
    came: dict[str, PackedOutcome] = {}
    progress(0.0, f"0 of {len(tasks)} scans")
    with closing(running):  # its workers end when the progress cancels
        for outcome in running:
            came[outcome.source] = PackedOutcome(outcome, next(iter(came.values()), None))
            progress(len(came) / len(tasks), f"{len(came)} of {len(tasks)} scans")
    if not storage.is_address(folder):
        swept(Path(folder))
    done = Batch(folder, Outcomes(came[place] for place in places))
    _write(done)
    return done


def _folder(output: str) -> str:
    if storage.is_address(output):
        return output
    path = Path(output).resolve()
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise ExportError(f"{output}: {e.strerror or e}", hint="choose another folder") from None
    return str(path)


def _write(done: Batch) -> None:
    if not storage.is_address(done.folder):
        write_tables(Path(done.folder), done.outcomes)
        return
    import tempfile

    with tempfile.TemporaryDirectory(prefix="turnscan-") as local:
        write_tables(Path(local), done.outcomes)
        storage.publish(Path(local), done.folder)


def table_of(done: Batch) -> str:
    """Where the table to look at is."""
    return storage.join(done.folder, HTML)
