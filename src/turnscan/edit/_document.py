"""Document: a surface with its history, and what each step through it changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import cast

import numpy as np
import numpy.typing as npt

from turnscan.arrays import Bools, Floats, Ints
from turnscan.edit._apply import MISFIT, Done, apply
from turnscan.edit._body import Alive, Body, Patch, Replace, Verts
from turnscan.edit._deleted import AWAY, cut_by_hand
from turnscan.edit._edits import Edit, is_measure, needs_rebuild
from turnscan.edit._history import Action, Entry, Go, History
from turnscan.edit._measures import Measure, Sources, shared_sigma, taken
from turnscan.errors import CalibrationError, InputError
from turnscan.findings import Finding
from turnscan.mesh import Mesh
from turnscan.progress import Progress, no_progress
from turnscan.shapes import Measured, Source

Build = Callable[[Sequence[Entry], Progress], tuple[Mesh, Sequence[Finding]]]
"""Settings and grid edits → the surface with them, before any mesh edit, and what is to be said."""


class Touch(IntEnum):
    """What was done by hand at a vertex."""

    NOTHING = 0
    MOVED = 1
    """Smoothed, or a spike of it removed."""
    ADDED = 2
    """It belongs to what was filled, bridged or closed."""
    CUT = 3
    """Faces about it were removed."""


@dataclass(frozen=True, eq=False)
class Change:
    """What a step through the history did."""

    action: Action
    """For the log."""
    patches: tuple[Patch, ...]
    """From the body before to the body after, in the order they are done."""
    findings: tuple[Finding, ...]
    """Of the edits that were applied in this step."""


@dataclass(frozen=True, eq=False)
class Document:
    """A surface under edit. A value: every step gives a new one and leaves this one as it is.

    So a preview is a step whose document nobody keeps, and readers need no lock. The body depends
    on the base and the edits that count alone, not on how one came there, to the bit.
    """

    build: Build
    history: History
    base: Body
    """With the settings and the grid edits that count, before any mesh edit."""
    remarks: tuple[Finding, ...]
    """What was said about the base."""
    body: Body
    chain: tuple[Done, ...]
    """The mesh edits that count, in their order, and behind them those that redo would do."""
    count: int
    """How many of the chain count."""
    source: Sources = Source
    """What was built last was made from this."""

    @classmethod
    def open(
        cls,
        build: Build,
        history: History | None = None,
        progress: Progress = no_progress,
        source: Sources = Source,
    ) -> Document:
        """The surface with everything in the history that counts; ``progress`` as for `after`."""
        history = history or History()
        seen = [e for e in history.enabled if needs_rebuild(e.edit)]
        wanted = [e for e in history.enabled if not needs_rebuild(e.edit)]
        built = 1 / (1 + len(wanted))
        mesh, remarks = build(seen, progress.subrange(0, built))
        base = Body.of(mesh)
        body, done = _applied(base, wanted, progress.subrange(built, 1), source)
        return cls(build, history, base, tuple(remarks), body, tuple(done), len(done), source)

    @property
    def done(self) -> tuple[Done, ...]:
        """The mesh edits that count, in their order."""
        return self.chain[: self.count]

    def touched(self) -> npt.NDArray[np.uint8]:
        """(v,) what was last done by hand to the surface at each vertex: a number of `Touch`.

        Counted are the mesh edits that count, since vertices got other numbers last (`Replace`).
        """
        patches = [patch for done in self.done for patch in done.forward]
        start = max((k for k, p in enumerate(patches) if isinstance(p, Replace)), default=-1)
        out = np.zeros(len(self.body.mesh.vertices), dtype=np.uint8)
        for patch in patches[start + 1 :]:
            match patch:
                case Alive():
                    out[self.body.mesh.faces[patch.faces]] = Touch.CUT
                case Verts():
                    out[patch.ids] = Touch.MOVED
        given = patches[start].body if start >= 0 else self.base  # type: ignore[union-attr]
        out[len(given.mesh.vertices) :] = Touch.ADDED
        added = np.arange(len(self.body.mesh.faces)) >= len(given.mesh.faces)
        rim = np.unique(self.body.mesh.faces[added & self.body.alive])
        out[rim[out[rim] == Touch.CUT]] = Touch.ADDED
        return out

    def taken_away(self) -> tuple[tuple[Mesh, Bools], ...]:
        """Meshes, and which of their vertices (v,) lost all faces by deleting, cutting off, or
        removing spikes or pieces.

        The last one is the surface as it is. The others were replaced by an edit that gave all
        vertices and faces new numbers: what was removed before has numbers of theirs.
        """
        out, faces = list[tuple[Mesh, Bools]](), list[Ints]()
        for done in self.done:
            away = isinstance(done.entry.edit, AWAY)
            for patch, inverse in zip(done.forward, reversed(done.back), strict=True):
                if isinstance(inverse, Replace):
                    out.append(_without_faces(inverse.body, faces))
                    faces = []
                elif away and isinstance(patch, Alive) and not patch.value:
                    faces.append(patch.faces)
        return (*out, _without_faces(self.body, faces))

    def cut(self) -> Floats:
        """(k, 3) mm: the vertices of the surface that lost faces by hand (`cut_by_hand`)."""
        return cut_by_hand(self.body, self.done)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is to be said about the base and about every edit that counts."""
        return self.remarks + tuple(f for d in self.done for f in d.findings)

    @property
    def measured(self) -> tuple[tuple[Entry, Measured], ...]:
        """The measurements that count and could be taken, in their order."""
        return tuple((d.entry, d.measured) for d in self.done if d.measured is not None)

    @property
    def doubts(self) -> Mapping[int, str]:
        """What speaks against measurements made elsewhere being of this part, by their numbers."""
        said = (
            (d.entry.id, [f.message for f in d.findings if f.code == MISFIT]) for d in self.done
        )
        return {id: "; ".join(messages) for id, messages in said if messages}

    def outdated(self, id: int) -> bool:
        """Whether the surface was changed after the measurement of this number was taken."""
        at = next((k for k, done in enumerate(self.done) if done.entry.id == id), self.count)
        return any(done.forward for done in self.done[at + 1 :])

    def retaken(self, entry: Entry) -> Measured:
        """A measurement on the surface as it is now, after all edits that count.

        Raises InputError, CalibrationError where it cannot be taken any more.
        """
        assert is_measure(entry.edit)
        return taken(self.body, cast(Measure, entry.edit), self.source)

    def shared_sigmas(self, entries: Sequence[Entry]) -> Iterator[tuple[int, float | None]]:
        """What the calibration leaves open in measurements on the surface as it is now.

        Each with the number of its edit; None where it is not known, see `shared_sigma`.
        """
        source = self.source() if entries else Source()
        for entry in entries:
            assert is_measure(entry.edit)
            try:
                yield entry.id, shared_sigma(self.body, cast(Measure, entry.edit), source)
            except (InputError, CalibrationError):
                yield entry.id, None

    def add(self, edit: Edit, progress: Progress = no_progress) -> tuple[Document, Change]:
        """Make an edit. One that finds nothing to act on is a finding of the change."""
        return self.after(self.history.add(edit), progress)

    def undo(self, progress: Progress = no_progress) -> tuple[Document, Change]:
        """Take back the last edit that counts. Raises InputError where there is none."""
        return self.after(self.history.undo(), progress)

    def redo(self, progress: Progress = no_progress) -> tuple[Document, Change]:
        """Redo the next undone edit. Raises InputError where there is none."""
        return self.after(self.history.redo(), progress)

    def go(self, cursor: int, progress: Progress = no_progress) -> tuple[Document, Change]:
        """Let the first ``cursor`` edits count. Raises InputError where there are fewer."""
        return self.after(Go(cursor), progress)

    def switch(
        self, id: int, on: bool, progress: Progress = no_progress
    ) -> tuple[Document, Change]:
        """Switch one edit on or off. Raises InputError where there is none of that number."""
        return self.after(self.history.switch(id, on), progress)

    def after(self, action: Action, progress: Progress = no_progress) -> tuple[Document, Change]:
        """The document after an action, and what it changed. Raises InputError.

        ``progress`` hears how much of the work is done; an exception of its own ends it.
        """
        document, patches, findings = self._to(self.history.after(action), progress)
        return document, Change(action, patches, findings)

    def _to(
        self, history: History, progress: Progress
    ) -> tuple[Document, tuple[Patch, ...], tuple[Finding, ...]]:
        """Undo down to what both histories share, then apply the rest."""
        wanted = [e for e in history.enabled if not needs_rebuild(e.edit)]
        seen = [e.id for e in history.enabled if needs_rebuild(e.edit)]
        if seen != [e.id for e in self.history.enabled if needs_rebuild(e.edit)]:
            document = Document.open(self.build, history, progress, self.source)
            return document, (Replace(document.body),), document.findings
        shared = 0
        for entry, known in zip(wanted, self.chain, strict=False):
            if entry.id != known.entry.id:
                break
            shared += 1
        body, patches = self.body, list[Patch]()
        for past in reversed(self.chain[shared : self.count]):
            patches += past.back
        fresh = list(self.chain[min(shared, self.count) : shared])
        for again in fresh:
            patches += again.forward
        for patch in patches:
            body = patch.on(body)
        chain = self.chain
        if len(wanted) > shared:
            body, made = _applied(body, wanted[shared:], progress, self.source)
            fresh += made
            patches += [patch for new in made for patch in new.forward]
            chain = (*chain[: min(shared, self.count)], *fresh)
        document = replace(self, history=history, body=body, chain=chain, count=len(wanted))
        return document, tuple(patches), tuple(f for d in fresh for f in d.findings)


def _without_faces(body: Body, gone: Sequence[Ints]) -> tuple[Mesh, Bools]:
    """Which vertices of a body lost all faces when these faces (n,) were removed."""
    out = np.zeros(len(body.mesh.vertices), dtype=np.bool_)
    for faces in gone:
        out[body.mesh.faces[faces]] = True
    if out.any():
        out[body.mesh.faces[body.alive]] = False
    return body.mesh, out


def _applied(
    body: Body, entries: Sequence[Entry], progress: Progress, source: Sources
) -> tuple[Body, list[Done]]:
    """A body after edits, each done on what the one before left."""
    done = list[Done]()
    for k, entry in enumerate(entries):
        progress(k / len(entries))
        body, new = apply(
            body, entry, progress.subrange(k / len(entries), (k + 1) / len(entries)), source
        )
        done.append(new)
    return body, done
