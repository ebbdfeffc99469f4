"""A mesh with repairs by hand, for whoever keeps no document of it."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from turnscan.arrays import Floats
from turnscan.edit._apply import Done, apply
from turnscan.edit._body import Body, Compact
from turnscan.edit._deleted import cut_by_hand
from turnscan.edit._edits import needs_rebuild
from turnscan.edit._history import Entry
from turnscan.edit._measures import Sources
from turnscan.findings import Finding
from turnscan.mesh import Mesh
from turnscan.shapes import Source


class Repaired(NamedTuple):
    """A mesh that was edited."""

    mesh: Mesh
    findings: list[Finding]
    """What was measured stands among them."""
    cut: Floats
    """(k, 3) mm: its vertices that lost faces by hand (`cut_by_hand`)."""


def repair_mesh(mesh: Mesh, entries: Iterable[Entry], source: Sources = Source) -> Repaired:
    """A mesh with the mesh edits among these done, in their order."""
    body, findings = Body.of(mesh), list[Finding]()
    done = list[Done]()
    for entry in entries:
        if not needs_rebuild(entry.edit):
            body, step = apply(body, entry, source=source)
            findings += step.findings
            if step.measured is not None:
                findings.append(Finding("edit.measured", "note", str(step.measured), entry.place))
            done.append(step)
    return Repaired(Compact.of(body).mesh if done else mesh, findings, cut_by_hand(body, done))
