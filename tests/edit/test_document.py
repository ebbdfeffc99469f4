"""Undo, redo, switching and stepping: whatever the way, the surface is that of its edits."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any
from zlib import crc32

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from tests.edit.surfaces import around, sheet
from tests.mesh.open_meshes import ball, opened
from tests.reports import into
from turnscan.edit import (
    Body,
    BridgeHoles,
    BridgeSides,
    Close,
    Compact,
    Cut,
    Decimate,
    Delete,
    Despike,
    Document,
    Edit,
    Fill,
    HoleName,
    ProfileOff,
    Region,
    RemovePieces,
    Replace,
    Smooth,
    action_to_json,
    describe,
    history_from_log,
    needs_rebuild,
)
from turnscan.errors import InputError
from turnscan.findings import Finding
from turnscan.mesh import Mesh, join
from turnscan.progress import Progress
from turnscan.surface.holes import fill, holes

SHEETS = [sheet(8, seed, 0.02 * seed, size=14.0) for seed in range(3)]


def build(edits: Any, _: Progress) -> Any:
    """A surface that depends on the grid edits, as a reconstruction does."""
    return SHEETS[len(edits) % 3], [Finding("grid", "note", f"{len(edits)} grid edits")]


def parts_of(body: Body) -> dict[str, Any]:
    """A hash of each thing that a body is made of, so that a difference says where it lies."""
    mesh, p = body.mesh, body.mesh.provenance
    assert p is not None
    arrays = {
        "vertices": mesh.vertices, "faces": mesh.faces, "alive": body.alive,
        "measured": body.measured, "sigma": p.sigma, "laser": p.laser, "step": p.step,
        "line": p.line,
    }  # fmt: skip
    return {"key": body.key} | {k: (v.shape, crc32(v.tobytes())) for k, v in arrays.items()}


class Session(RuleBasedStateMachine):
    """A person at work; a second browser that knows the patches alone; and a plain model."""

    def __init__(self) -> None:
        super().__init__()
        self.document = Document.open(build)
        self.mirror = self.document.body
        self.log: list[str] = []
        self.model: list[list[Any]] = []  # edit, on
        self.cursor = 0
        self.old = [self.document.body]

    def took(self, step: tuple[Document, Any]) -> None:
        self.document, change = step
        for patch in change.patches:
            self.mirror = patch.on(self.mirror)
        self.log.append(action_to_json(change.action))

    def made(self, edit: Edit) -> None:
        self.took(self.document.add(edit))
        self.model = [*self.model[: self.cursor], [edit, True]]
        self.cursor = len(self.model)

    @rule(data=st.data())
    def delete(self, data: Any) -> None:
        """On the surface there is now, or on one seen earlier."""
        body = data.draw(st.sampled_from([self.document.body, *self.old[-2:]]))
        living = np.flatnonzero(body.alive)
        if len(living):
            faces = data.draw(st.lists(st.sampled_from(living.tolist()), min_size=1, max_size=20))
            self.made(Delete(Region.of(body, faces)))
            self.old.append(self.document.body)

    @rule(how=st.sampled_from(["flat", "tangent"]), largest=st.sampled_from([None, 4.0]))
    def fill(self, how: Any, largest: float | None) -> None:
        self.made(Fill(None, how, largest))

    @rule()
    def fill_what_is_not_there(self) -> None:
        self.made(Fill((HoleName((500.0, 0.0, 0.0), 2.0),)))

    @rule()
    def close(self) -> None:
        self.made(Close())

    @rule(where=st.floats(-4.0, 4.0), axis=st.integers(0, 1), cap=st.booleans())
    def cut(self, where: float, axis: int, cap: bool) -> None:
        normal = [(1.0, 0.0, 0.0), (-0.3, 1.0, 0.2)][axis]
        self.made(Cut(normal, where + [7.0, 6.0][axis], cap))

    @rule(data=st.data())
    def smooth(self, data: Any) -> None:
        living = np.flatnonzero(self.document.body.alive)
        if len(living):
            faces = data.draw(st.lists(st.sampled_from(living.tolist()), min_size=1, max_size=20))
            self.made(Smooth(Region.of(self.document.body, faces), rounds=2))

    @rule(beyond=st.sampled_from([1.0, 3.0]))
    def despike(self, beyond: float) -> None:
        self.made(Despike(None, beyond, "flat"))

    @rule(faces=st.integers(20, 90))
    def decimate(self, faces: int) -> None:
        self.made(Decimate(faces=faces))

    @rule(step=st.integers(0, 3))
    def profile(self, step: int) -> None:
        self.made(ProfileOff("left", (step, step)))

    @rule()
    def undo(self) -> None:
        done = [i for i in range(self.cursor) if self.model[i][1]]
        if not done:
            with pytest.raises(InputError, match="nothing to undo"):
                self.document.undo()
        else:
            self.took(self.document.undo())
            self.cursor = done[-1]

    @rule()
    def redo(self) -> None:
        ahead = [i for i in range(self.cursor, len(self.model)) if self.model[i][1]]
        if not ahead:
            with pytest.raises(InputError, match="nothing to redo"):
                self.document.redo()
        else:
            self.took(self.document.redo())
            self.cursor = ahead[0] + 1

    @precondition(lambda self: self.model)
    @rule(data=st.data())
    def go(self, data: Any) -> None:
        cursor = data.draw(st.integers(0, len(self.model)))
        self.took(self.document.go(cursor))
        self.cursor = cursor

    @precondition(lambda self: self.model)
    @rule(data=st.data(), on=st.booleans())
    def switch(self, data: Any, on: bool) -> None:
        at = data.draw(st.integers(0, len(self.model) - 1))
        self.took(self.document.switch(self.document.history.entries[at].id, on))
        self.model[at][1] = on

    @invariant()
    def the_second_browser_sees_the_same(self) -> None:
        assert self.mirror.digest() == self.document.body.digest()

    @invariant()
    def the_history_is_that_of_the_model(self) -> None:
        h = self.document.history
        assert [[e.edit, e.on] for e in h.entries] == self.model
        assert h.cursor == self.cursor

    def teardown(self) -> None:
        """From the log alone, from scratch: the same history and the same surface, to the bit."""
        history = history_from_log(self.log)
        assert history == self.document.history
        again = Document.open(build, history)
        assert parts_of(again.body) == parts_of(self.document.body)
        assert again.body.digest() == self.document.body.digest()
        assert again.findings == self.document.findings


Session.TestCase.settings = settings(
    max_examples=2000 if "TURNSCAN_EXPLORE" in os.environ else 150,
    stateful_step_count=6,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much],
)
TestSession = pytest.mark.slow(Session.TestCase)


def test_undo_and_redo_of_a_delete_touch_its_faces_alone() -> None:
    mesh = sheet(40)
    document = Document.open(lambda *_: (mesh, ()))
    faces = around(mesh, (20, 20), 6)
    deleted, change = document.add(Delete(Region.of(document.body, faces)))
    assert [p.faces.tolist() for p in change.patches] == [faces.tolist()]
    undone, change = deleted.undo()
    assert [(p.value, p.faces.tolist()) for p in change.patches] == [(True, faces.tolist())]
    assert undone.body.mesh is document.body.mesh, "nothing is copied that does not change"
    again, change = undone.redo()
    assert again.body.digest() == deleted.body.digest()
    assert [p.value for p in change.patches] == [False]


def test_a_preview_changes_nothing() -> None:
    mesh = sheet(20)
    document = Document.open(lambda *_: (mesh, ()))
    before = document.body.digest()
    shown, change = document.add(Delete(Region.of(document.body, around(mesh, (20, 20), 6))))
    assert len(change.patches) == 1
    assert document.body.digest() == before != shown.body.digest()
    assert document.history.entries == ()


def test_what_an_edit_cannot_do_is_said_and_the_rest_is_done() -> None:
    mesh = sheet(20)
    document = Document.open(lambda *_: (mesh, ()))
    document, change = document.add(Fill((HoleName((500.0, 0.0, 0.0), 2.0),)))
    assert [(f.code, f.severity, f.where) for f in change.findings] == [
        ("edit.nothing", "warning", "edit 1 (fill)")
    ]
    assert "no hole of 2.00 mm near (500.00" in change.findings[0].message
    document, _ = document.add(Delete(Region.of(document.body, around(mesh, (20, 20), 6))))
    document, _ = document.add(Fill(largest=20.0))
    assert (~document.body.measured).any()
    assert [f.code for f in document.findings] == ["edit.nothing"]


def test_a_filling_that_would_cut_the_surface_is_refused_and_another_way_named() -> None:
    """A ball lacks its top; a needle stands where it was, clear of a lid that is flat."""
    mouth = opened(ball(24), (0, 0, 1), 0.8)
    needle = Mesh((0.1, 0.2, 9.5) + 0.05 * ball(4).vertices * (1, 1, 4), ball(4).faces)
    document = Document.open(lambda *_: (join([mouth, needle]), ()))
    before = document.body.digest()
    (hole,) = holes(Compact.of(document.body).mesh)
    name = HoleName((hole.centre[0], hole.centre[1], hole.centre[2]), hole.size)
    refused, change = document.add(Fill((name,), "tangent"))
    assert refused.body.digest() == before
    (said,) = change.findings
    assert (said.code, said.severity) == ("edit.refused", "error")
    assert "filled (tangent), the surface would intersect itself" in said.message
    assert said.remedy == "choose membrane, which fills it"
    done, change = document.add(Fill((name,), "membrane"))
    assert change.findings == ()
    assert holes(Compact.of(done.body).mesh) == []
    done, change = document.add(Fill((name,)))
    assert [(f.code, f.severity) for f in change.findings] == [("edit.other-fill", "note")]
    assert "filled by membrane" in change.findings[0].message
    assert holes(Compact.of(done.body).mesh) == [], "automatic takes what works"


def _taken(document: Document) -> list[int]:
    """How many vertices were taken away, of each body that had its own numbers."""
    return [int(gone.sum()) for _, gone in document.taken_away()]


def test_what_was_taken_away_is_known_after_all_numbers_changed() -> None:
    document = Document.open(lambda *_: (join([ball(24), ball(4), ball(6)]), ()))
    small = len(ball(4).vertices)
    first, _ = document.add(RemovePieces(len(ball(4).faces) + 1))
    thinned, change = first.add(Decimate(faces=100))
    assert isinstance(change.patches[0], Replace)
    assert len(thinned.body.mesh.faces) < len(document.body.mesh.faces) - len(ball(6).faces)
    assert _taken(thinned) == [small, 0]
    there, gone = thinned.taken_away()[0]
    assert np.allclose(np.unique(there.vertices[gone], axis=0), np.unique(ball(4).vertices, axis=0))
    third, _ = thinned.add(
        Delete(Region.of(thinned.body, np.arange(len(thinned.body.mesh.faces) // 2)))
    )
    assert _taken(third)[0] == small
    assert _taken(third)[1] > 0
    assert _taken(third.undo()[0]) == [small, 0]
    assert _taken(third.go(1)[0]) == [small]
    assert _taken(third.go(0)[0]) == [0]


def test_small_pieces_go_and_what_is_taken_away_is_known_by_its_vertices() -> None:
    document = Document.open(lambda *_: (join([ball(24), ball(4), ball(6)]), ()))
    large, small = len(ball(24).faces), len(ball(4).faces)
    assert _taken(document) == [0]
    done, change = document.add(RemovePieces(small + 1))
    assert change.findings == ()
    assert int((~done.body.alive).sum()) == small
    assert _taken(done) == [len(ball(4).vertices)]
    done, _ = done.add(RemovePieces(large))
    assert int(done.body.alive.sum()) == large
    back, _ = done.undo()
    assert _taken(back) == [len(ball(4).vertices)]
    _, change = done.add(RemovePieces(large))
    assert "nothing matched" in change.findings[0].message


def test_a_cut_along_an_axis_is_told_by_the_axis() -> None:
    assert describe(Cut((0.0, 0.0, 2.0), 22.5)) == "cut at z = 22.5 mm, what is above stays, capped"
    assert describe(Cut((0.0, 0.0, -1.0), 0.0)) == "cut at z = 0 mm, what is below stays, capped"
    assert describe(Cut((-1.0, 0.0, 0.0), 3.0, False)) == "cut at x = -3 mm, what is below stays"
    assert "(0, 0.6, 0.8)" in describe(Cut((0.0, 0.6, 0.8), 1.0))


def test_a_grid_edit_makes_another_surface_and_the_mesh_edits_follow_it() -> None:
    document = Document.open(build)
    region = Region.of(document.body, around(SHEETS[0], (7, 7), 3))
    document, _ = document.add(Delete(region))
    document, change = document.add(ProfileOff("left", (3, 3)))
    assert needs_rebuild(document.history.entries[1].edit)
    assert [type(p) for p in change.patches] == [Replace]
    assert document.base.digest() == Body.of(SHEETS[1]).digest()
    gone = np.flatnonzero(~document.body.alive)
    assert len(np.setxor1d(gone, around(SHEETS[1], (7, 7), 3))) <= 2
    document, _ = document.undo()
    assert document.base.digest() == Body.of(SHEETS[0]).digest()
    assert (~document.body.alive).sum() == region.count


def test_smoothing_moves_the_region_alone_and_a_spike_goes_without_a_hole() -> None:
    mesh = sheet(30, 1, 0.1)
    spiky = mesh.vertices.copy()
    spiky[30 * 15 + 15, 2] += 5.0
    mesh = replace(mesh, vertices=spiky)
    document = Document.open(lambda *_: (mesh, ()))
    cured, change = document.add(Despike())
    assert [type(p).__name__ for p in change.patches] == ["Alive", "Append"]
    live = Compact.of(cured.body).mesh
    assert live.vertices[:, 2].max() < 12.7
    assert len(holes(live)) == 1
    region = Region.of(cured.body, around(mesh, (10, 10), 5))
    calm, change = cured.add(Smooth(region, rounds=10))
    (moved,) = change.patches
    centre = np.hypot(*(cured.body.mesh.vertices[moved.ids, :2] - (10, 10)).T)
    assert centre.max() < 7.5
    assert len(moved.ids) > 40
    before, after = (
        np.abs(b.mesh.vertices[moved.ids, 2] - sheet(30).vertices[moved.ids, 2]).mean()
        for b in (cured.body, calm.body)
    )
    assert after < 0.8 * before
    assert calm.undo()[0].body.digest() == cured.body.digest()


def test_bridges_part_a_hole_and_join_an_island() -> None:
    mesh = sheet(40)
    document = Document.open(lambda *_: (mesh, ()))
    c = mesh.triangles.mean(axis=1)[:, :2] - (20, 20)
    ring = np.flatnonzero((np.hypot(*c.T) > 4) & (np.hypot(*c.T) < 9))
    document, _ = document.add(Delete(Region.of(document.body, ring)))
    assert len(holes(Compact.of(document.body).mesh)) == 3
    around_it, island = (HoleName.of(h) for h in holes(Compact.of(document.body).mesh)[1:])
    joined, change = document.add(BridgeHoles(around_it, island))
    assert [type(p).__name__ for p in change.patches] == ["Append"]
    assert len(holes(Compact.of(joined.body).mesh)) == 1
    strip = BridgeSides((11.0, 20.0, 10.0), (16.0, 20.0, 10.0))
    one, change = document.add(strip)
    assert change.findings == ()
    assert len(holes(Compact.of(one.body).mesh)) == 2, "two borders became one"
    two, _ = one.add(BridgeSides((29.0, 20.0, 10.0), (24.0, 20.0, 10.0)))
    assert len(holes(Compact.of(two.body).mesh)) == 3, "which a second bridge parts in two"
    _, change = document.add(BridgeSides((200.0, 20.0, 10.0), (16.0, 20.0, 10.0)))
    assert [f.code for f in change.findings] == ["edit.refused"]
    assert "from the end of the bridge" in change.findings[0].message
    _, change = document.add(BridgeHoles(around_it, HoleName((0.0, 0.0, 99.0), 3.0)))
    assert [f.code for f in change.findings] == ["edit.nothing"]


@pytest.mark.parametrize("how", ["flat", "tangent", "curvature"])
def test_a_hole_filled_by_itself_is_filled_as_on_the_whole_surface(how: Any) -> None:
    mesh = sheet(60, 3, 0.05)
    document = Document.open(lambda *_: (mesh, ()))
    document, _ = document.add(Delete(Region.of(document.body, around(mesh, (20, 20), 4))))
    before = Compact.of(document.body).mesh
    (hole,) = (h for h in holes(before) if h.size < 20)
    whole = fill(before, [hole], how)
    filled, _ = document.add(Fill((HoleName.of(hole),), how))
    alone = Compact.of(filled.body).mesh
    assert np.array_equal(alone.faces, whole.faces)
    assert np.allclose(alone.vertices, whole.vertices, rtol=0, atol=1e-6)


def test_the_share_done_is_told_and_an_end_there_changes_nothing() -> None:
    mesh = sheet(40, 3, 0.05)
    document = Document.open(lambda *_: (mesh, ()))
    for at in ((10, 10), (30, 10), (10, 30)):
        region = Region.of(document.body, around(mesh, at, 2))
        document, _ = document.add(Delete(region))
    shares = list[float]()
    document.add(Close(floor=None, top=None, largest=20.0), into(shares))
    assert np.allclose(sorted(set(shares)), [0, 1 / 3, 2 / 3])
    shares.clear()
    filled, _ = document.add(Fill(None, "flat", largest=20.0), into(shares))
    assert shares[0] == 0
    assert np.allclose(sorted(set(shares)), [0, 1 / 3, 2 / 3])
    shares.clear()
    filled.add(Smooth(Region.of(filled.body, around(mesh, (20, 20), 4)), rounds=4), into(shares))
    assert shares == [0, 0, 0.25, 0.5, 0.75]
    shares.clear()
    document.switch(document.history.entries[0].id, False, into(shares))
    assert shares == [0, 0.5]  # the two behind it are done again

    class Enough(Exception):
        pass

    def end(share: float, _: str) -> None:
        if share > 0.5:
            raise Enough

    before = document.body.digest()
    with pytest.raises(Enough):
        document.add(Fill(None, "flat", largest=20.0), Progress(end))
    assert document.body.digest() == before
