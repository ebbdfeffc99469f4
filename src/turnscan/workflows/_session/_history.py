"""The history of an open scan as a tree: its steps, with names and pictures."""

from __future__ import annotations

import functools
import hashlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from turnscan import edit
from turnscan.picture import png
from turnscan.workflows._files._kept_options import edit_in_words

_PICTURE = (96, 72)
"""px, width and height of the picture of a step."""


@dataclass(frozen=True)
class HistoryRow:
    """An edit of the history."""

    edit: int
    """Its number for ever."""
    kind: str
    text: str
    on: bool
    at: float
    """s since 1970; NaN where unknown."""
    name: str
    """Given by a person; empty for none."""
    picture: str
    """Names a picture of the surface after this edit (`step_pictures`); of a branch, too."""


@dataclass(frozen=True)
class BranchRow:
    """A piece of another history, left when an edit was made after stepping back."""

    after: int
    """Number of the edit it grows from; 0: it begins with the first edit."""
    rows: tuple[HistoryRow, ...]
    """Its edits that neither the history nor a newer branch has."""


class Steps:
    """The edits of a scan for those who show them: their words, their times and their pictures."""

    def __init__(self, digest: str) -> None:
        """``digest`` is of the scan, so that no two scans share a picture."""
        self._digest = digest
        self._times: dict[int, float] = {}

    def made(self, id: int, at: float) -> None:
        """An edit was made, s since 1970."""
        self._times[id] = at

    def rows(self, path: Sequence[edit.Entry]) -> list[HistoryRow]:
        """One path through the tree, from the first edit on."""
        keys = self.pictures(path)
        return [
            HistoryRow(e.id, e.edit.kind, edit_in_words(e.edit), e.on, self._at(e.id), e.name, key)
            for e, key in zip(path, keys[1:], strict=True)
        ]

    def branches(self, history: edit.History) -> list[BranchRow]:
        """The pieces of the tree that the history does not have, the newest first."""
        paths = {e.id: path for path in history.branches for e in path}
        out = []
        for fork in history.forks:
            rows = self.rows(paths[fork.entries[-1].id])
            out.append(BranchRow(fork.after, tuple(rows[-len(fork.entries) :])))
        return out

    def pictures(self, path: Sequence[edit.Entry]) -> list[str]:
        """Names of pictures: as scanned, and after each edit; others where the surface may be."""
        total = hashlib.sha256(self._digest.encode())
        keys = [total.hexdigest()[:16]]
        for e in path:
            if e.on:
                total.update(f"{e.id} {self._at(e.id)};".encode())
            keys.append(total.hexdigest()[:16])
        return keys

    def drawn(self, document: edit.Document) -> Iterator[tuple[str, Callable[[], bytes]]]:
        """See `ScanSession.step_pictures`."""
        keys = self.pictures(document.history.entries)
        body, done = document.body, list(document.done)
        for at in range(document.history.cursor, -1, -1):
            yield keys[at], functools.partial(_picture, body)
            if at == 0:
                return
            entry = document.history.entries[at - 1]
            if entry.on and edit.needs_rebuild(entry.edit):
                return
            if entry.on:
                for patch in done.pop().back:
                    body = patch.on(body)

    def _at(self, id: int) -> float:
        return self._times.get(id, math.nan)


def _picture(body: edit.Body) -> bytes:
    """A small picture of a surface as PNG; one without faces is empty."""
    mesh = edit.Compact.of(body).mesh
    return png(mesh.show(size=_PICTURE, transparent=True).pixels)


def step_in_words(action: edit.Action | None, history: edit.History) -> str:
    """What one step of the history did."""
    match action:
        case edit.Add():
            return edit_in_words(action.edit)
        case edit.Switch():
            return f"edit {action.id} switched {'on' if action.on else 'off'}"
        case edit.Branch():
            return f"branch of {len(history.entries)} edits taken up"
        case edit.Name():
            return f"edit {action.id} named {action.name!r}"
        case edit.Go():
            return f"{action.cursor} of {len(history.entries)} edits"
        case None:
            return ""
