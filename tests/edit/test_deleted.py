"""Holes that somebody deleted are called so, whatever was done since, and no others are."""

from __future__ import annotations

import numpy as np
import pytest

from tests.edit.surfaces import around, sheet
from tests.mesh.open_meshes import ball
from turnscan.edit import (
    Compact,
    Cut,
    Decimate,
    Delete,
    Document,
    Entry,
    Region,
    Replace,
    Smooth,
    repair_mesh,
)
from turnscan.mesh import Mesh, submesh
from turnscan.surface.holes import explain, holes
from turnscan.surface.holes._holes import Hole


def opened() -> Mesh:
    """A sheet with a gap at (30, 30) that nobody deleted."""
    whole = sheet()
    kept = np.ones(len(whole.faces), dtype=np.bool_)
    kept[around(whole, (30, 30), 4.0)] = False
    return submesh(whole, kept)


def deleted(document: Document, at: tuple[float, float], radius: float) -> Document:
    faces = around(document.body.mesh, at, radius)
    return document.add(Delete(Region.of(document.body, faces)))[0]


def named(document: Document) -> list[Hole]:
    """The holes, with the causes that edits are."""
    mesh = Compact.of(document.body).mesh
    return sorted(explain(mesh, holes(mesh), (), document.cut()), key=lambda h: -h.size)


def test_only_the_hole_that_was_deleted_is_called_so() -> None:
    document = Document.open(lambda *_: (opened(), ()))
    assert [h.cause for h in named(document)] == [None, None]
    document = deleted(document, (10, 10), 6.0)
    rim, ours, gap = named(document)
    assert (rim.cause, ours.cause, gap.cause) == (None, "deleted", None)
    assert ours.centre[:2] == pytest.approx([10, 10], abs=1)
    assert "deleted" not in {h.cause for h in named(document.undo()[0])}


def test_later_edits_do_not_change_why_it_is_there() -> None:
    document = deleted(Document.open(lambda *_: (opened(), ())), (10, 10), 6.0)
    everywhere = Region.of(document.body, np.flatnonzero(document.body.alive))
    smoothed, change = document.add(Smooth(everywhere))
    assert change.patches
    thinned, change = smoothed.add(Decimate(faces=400))
    assert isinstance(change.patches[0], Replace)
    for later in (smoothed, thinned):
        assert [h.cause for h in named(later)] == [None, "deleted", None]


def test_a_gap_that_grew_a_little_by_hand_keeps_its_cause_and_one_cut_free_all_about_does_not() -> (
    None
):
    start = Document.open(lambda *_: (opened(), ()))
    assert named(deleted(start, (26, 30), 1.0))[-1].cause is None
    assert named(deleted(start, (30, 30), 6.0))[-1].cause == "deleted"


def test_what_is_open_along_a_cut_was_deleted_and_every_door_says_so() -> None:
    mesh = ball(16)
    cut = Cut((0.0, 0.0, 1.0), float(mesh.vertices[:, 2].mean()), cap=False)
    document = Document.open(lambda *_: (mesh, ())).add(cut)[0]
    assert [h.cause for h in named(document)] == ["deleted"]
    again = repair_mesh(mesh, [Entry(1, cut)])
    assert [h.cause for h in explain(again.mesh, holes(again.mesh), (), again.cut)] == ["deleted"]
