"""Edits: the repairs kept in a scan file, listed, switched, copied."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from turnscan.edit import (
    Action,
    Add,
    Delete,
    Edit,
    Entry,
    History,
    Specify,
    action_from_json,
    action_to_json,
    edit_from_json,
    history_to_json,
    is_measure,
    moved_edit,
)
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.progress import Progress, no_progress
from turnscan.remedy import Option, Remedy
from turnscan.scan import Scan
from turnscan.workflows._files._history import history_of, read_history
from turnscan.workflows._files._kept_options import check_set_edit, checked_edit, edit_in_words
from turnscan.workflows._files._writing import check_output, write_atomically
from turnscan.workflows._session._selection import region_where
from turnscan.workflows._surface._aligning import placed_by
from turnscan.workflows._surface._nominal import nominal
from turnscan.workflows._surface._reconstruct import reconstruct


@dataclass(frozen=True)
class EditChanges:
    """What is to become of the edits in a scan file; done in this order."""

    source: Path | None = None
    """Add the edits of another scan, or of a .json file."""
    make: tuple[str, ...] = ()
    """Edits to make, each as JSON (docs/reference/edits.md)."""
    delete: tuple[str, ...] = ()
    """Rules of faces to delete, of the surface with all edits before."""
    grow: int = 0
    """Rounds to grow what is deleted; negative ones shrink it."""
    off: tuple[int, ...] = ()
    """Numbers of edits to switch off."""
    on: tuple[int, ...] = ()
    """Numbers of edits to switch on again."""
    to: int | None = None
    """Go to the state after this edit, of the history or of a branch; 0: as scanned."""
    undo: bool = False
    """Take back the last edit."""
    redo: bool = False
    """Do the next undone edit again."""
    only: tuple[int, ...] = ()
    """Numbers of those edits of ``source`` that are added; none: all that count there."""
    by_shape: bool = False
    """Whether the part stands elsewhere in this scan: measurements are brought along by its shape,
    and no other edits are added."""
    name: tuple[tuple[int, str], ...] = ()
    """Numbers of edits and the names they get; an empty name takes it away."""
    check: bool = False
    """Whether the surface is made, to say which of the added edits do not fit this scan."""

    @property
    def nothing(self) -> bool:
        """Whether nothing is to be changed."""
        return self == EditChanges(grow=self.grow, check=self.check)


@dataclass(frozen=True)
class KeptEdits:
    """The edits that a scan file holds, those undone too."""

    history: History
    times: dict[int, float]
    """When each was made, s since 1970; NaN where unknown."""
    findings: tuple[Finding, ...] = ()
    """What does not fit of edits that were added, and what is open about where measurements were
    brought along to."""

    @property
    def done(self) -> int:
        """How many count."""
        return self.history.cursor

    def lines(self) -> list[str]:
        """One line for each, in words; then the branches, the newest first."""
        if not self.history.entries and not self.history.branches:
            return ["no edits"]
        lines = []
        for place, entry in enumerate(self.history.entries):
            lines.append(self._line(entry, "done" if place < self.history.cursor else "undone"))
        for fork in self.history.forks:
            lines.append(f"branch after edit {fork.after}" if fork.after else "branch as scanned")
            lines += [self._line(entry, "branch") for entry in fork.entries]
        return lines

    def _line(self, entry: Entry, state: str) -> str:
        at = self.times[entry.id]
        when = datetime.fromtimestamp(at).strftime("%Y-%m-%d %H:%M  ") if at == at else ""
        mark = state if entry.on else f"{state}, off"
        named = f"{entry.name}: " if entry.name else ""
        return f"{entry.id:>4}  {when}{mark:<11}  {named}{edit_in_words(entry.edit)}"


def edits(
    scan: str | Path,
    changes: EditChanges | None = None,
    *,
    output: str | Path | None = None,
    progress: Progress = no_progress,
) -> KeptEdits:
    """List the edits kept in a scan file, after changing them.

    Nothing is forgotten: the file keeps every action, and the frames are never touched. Nothing is
    written unless all changes fit the history.

    Parameters
    ----------
    scan
        The scan file.
    changes
        What to change; None changes nothing.
    output
        A .json file for the edits that are done.
    progress
        Told how far a reconstruction is that a rule needs; it may cancel.

    Returns
    -------
    KeptEdits
        The history, and when each edit was made.

    Raises
    ------
    InputError
        For a rule that is none, one that means no face, and an edit that there is not.
    FormatError
        For an edit that is none.
    """
    path, c = Path(scan), changes or EditChanges()
    if c.only and c.source is None:
        hint = Remedy("name the scan that they are in with ", Option("add", "SCAN"))
        raise InputError("these edits are of no scan", hint=hint, option=Option("only", c.only[0]))
    if c.by_shape and c.source is None:
        hint = Remedy("name the scan that they are in with ", Option("add", "SCAN"))
        raise InputError("nothing is brought along", hint=hint, option=Option("by_shape"))
    if c.check and c.source is None:
        hint = Remedy("name the scan that they are in with ", Option("add", "SCAN"))
        raise InputError("no edits are added that could fit", hint=hint, option=Option("check"))
    if c.grow and not c.delete:
        hint = Remedy("name the faces to delete with ", Option("delete", "RULE"))
        raise InputError("there is nothing to grow", hint=hint, option=Option("grow", c.grow))
    if output is not None:
        check_output(Path(output), (".json",), [path, *([c.source] if c.source else [])])
    findings = () if c.nothing else _change(path, c, progress)
    with Scan.open(path) as opened:
        kept = KeptEdits(history_of(opened), _times(opened), findings)
    if output is not None:
        write_atomically(Path(output), history_to_json(kept.history).encode())
    return kept


def _change(path: Path, c: EditChanges, progress: Progress) -> tuple[Finding, ...]:
    added = [] if c.source is None else _added(read_history(c.source), c)
    findings: tuple[Finding, ...] = ()
    if c.by_shape and c.source is not None:
        added, findings = _brought(added, c.source, path, progress.subrange(0, 0.8))
    made = [checked_edit(edit_from_json(text, "make")) for text in c.make]
    with Scan.resume(path) as opened:
        history = history_of(opened)
        actions: list[Action] = []
        numbers = dict[int, int]()
        for entry in added:
            numbers[entry.id] = history.next_id
            history = _then(actions, history, history.add(_numbered(entry.edit, numbers)))
            if entry.name:
                history = _then(actions, history, history.naming(numbers[entry.id], entry.name))
        for edit in made:
            check_set_edit(opened, history.enabled, edit)
            history = _then(actions, history, history.add(edit))
        if c.delete:
            region = region_where(opened, history, c.delete, c.grow, progress)
            history = _then(actions, history, history.add(Delete(region)))
        _stepped(actions, history, c)
        # Every one fits the history; only now is anything written.
        for action in actions:
            opened.append_edit(action_to_json(action), time.time())
    if c.check:
        findings += _unfit(path, set(numbers.values()), progress.subrange(0.8, 1))
    return findings


def _stepped(actions: list[Action], history: History, c: EditChanges) -> None:
    """Switch, name, and step through the history, after what is made."""
    for number in (*c.off, *c.on):
        history = _then(actions, history, history.switch(number, number in c.on))
    for number, name in c.name:
        history = _then(actions, history, history.naming(number, name))
    if c.to is not None:
        history = _then(actions, history, history.to(c.to))
    if c.undo:
        history = _then(actions, history, history.undo())
    if c.redo:
        _then(actions, history, history.redo())


def _unfit(path: Path, added: set[int], progress: Progress) -> tuple[Finding, ...]:
    """What the surface says of edits that were added: those that change nothing, are refused,
    or lie where this part has no such surface."""
    places = {e.place for e in _entries(path) if e.id in added}
    said = reconstruct(path, progress=progress).findings
    return tuple(f for f in said if f.where in places and f.severity != "note")


def _entries(path: Path) -> tuple[Entry, ...]:
    with Scan.open(path) as opened:
        return history_of(opened).entries


def _added(history: History, c: EditChanges) -> list[Entry]:
    """The edits that are to be copied, in their order. Raises InputError for one there is not.

    What is said of a measurement goes along with it, and not without it.
    """
    there = {e.id for e in history.entries}
    for number in c.only:
        if number not in there:
            raise InputError(
                f"{c.source}: no edit {number}",
                hint="list its edits",
                option=Option("only", number),
            )
    chosen = [e for e in history.enabled if not c.only] or [
        e for e in history.entries if e.id in c.only
    ]
    taken = set[int]()
    out = []
    for e in chosen:
        if not isinstance(e.edit, Specify) or e.edit.measure in taken:
            taken.add(e.id)
            out.append(e)
    return out


def _numbered(edit: Edit, numbers: Mapping[int, int]) -> Edit:
    """An edit that names another one, by the number that one has here."""
    return replace(edit, measure=numbers[edit.measure]) if isinstance(edit, Specify) else edit


def _brought(
    added: Sequence[Entry], source: Path, target: Path, progress: Progress
) -> tuple[list[Entry], tuple[Finding, ...]]:
    """The measurements, where the part stands in the target, and what is open about that.

    Raises InputError for none, and where its shape is nowhere in the target.
    """
    mine = [e for e in added if is_measure(e.edit) or isinstance(e.edit, Specify)]
    if not mine:
        raise InputError(f"{source}: no measurement to bring along", hint="measure there first")
    here = reconstruct(source, progress=progress.subrange(0, 0.45))
    there = nominal(target, "mm", progress.subrange(0.45, 0.9))
    placed = placed_by("shape", here.mesh, source.name, there, ())
    return [replace(e, edit=moved_edit(e.edit, placed.pose)) for e in mine], placed.findings


def _then(actions: list[Action], history: History, action: Action) -> History:
    if history.is_at(action):
        return history
    actions.append(action)
    return history.after(action)


def _times(scan: Scan) -> dict[int, float]:
    log = scan.edits()
    made = ((action_from_json(entry.text), entry.time) for entry in log)
    return {action.id: at for action, at in made if isinstance(action, Add)}
