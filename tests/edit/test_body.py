"""Patches: each one's inverse takes it back to the bit, and numbers mean the same throughout."""

from __future__ import annotations

import numpy as np
import pytest

from tests.edit.surfaces import sheet
from turnscan.edit import Alive, Append, Body, Compact, Patch, Replace, Truncate, Verts
from turnscan.edit._body import difference
from turnscan.mesh import Mesh, Provenance, submesh
from turnscan.surface.holes import fill

BODY = Alive(np.array([48, 49]), False).on(Body.of(sheet(8)))
NOBODY = np.full(2, -1, dtype=np.int32)
ADDED = Append(
    np.array([(1.0, 2.0, 30.0), (2.0, 2.0, 30.0)]),
    np.array([(0, 1, 64), (1, 65, 64)], np.int32),
    np.array([False, True]),
    Provenance(np.full(2, np.nan), NOBODY, NOBODY, NOBODY, ("left",)),
)
PATCHES: list[Patch] = [
    Alive(np.array([2, 48, 5]), False),  # one of them is dead already
    Alive(np.array([41, 48, 49]), True),  # one of them is alive
    Verts(np.array([0, 9]), np.array([(0.0, 0.0, 5.0), (1.0, 1.0, 6.0)])),
    Verts(np.array([7]), np.array([(0.0, 0.0, 5.0)]), np.array([0.5])),
    ADDED,
    Replace(Body.of(sheet(5))),
]


@pytest.mark.parametrize("patch", PATCHES, ids=lambda p: type(p).__name__)
def test_the_inverse_takes_a_patch_back_to_the_bit(patch: Patch) -> None:
    after = patch.on(BODY)
    assert after.digest() != BODY.digest()
    back = patch.inverse(BODY)
    assert back.on(after).digest() == BODY.digest()
    assert back.inverse(after).on(BODY).digest() == after.digest()


def test_the_key_names_the_numbering() -> None:
    assert all(p.on(BODY).key == BODY.key for p in PATCHES[:4])
    longer = ADDED.on(BODY)
    assert longer.key != BODY.key
    assert ADDED.on(BODY).key == longer.key
    assert Truncate(64, 98, BODY.key).on(longer).key == BODY.key
    assert Body.of(sheet(8)).key == BODY.key != Body.of(sheet(8, 1, 0.01)).key


def test_a_body_is_made_compact_and_back() -> None:
    live = Compact.of(BODY)
    assert len(live.mesh.faces) == BODY.alive.sum()
    back = live.vertex_ids[live.mesh.faces]
    assert np.array_equal(back, BODY.mesh.faces[live.face_ids])
    part = np.zeros(len(BODY.alive), dtype=bool)
    part[[10, 11, 48]] = True
    assert Compact.of(BODY, part).face_ids.tolist() == [10, 11]


def applied(patches: tuple[Patch, ...]) -> Mesh:
    body = BODY
    for patch in patches:
        body = patch.on(body)
    return Compact.of(body).mesh


def test_a_change_is_told_as_little_as_may_be() -> None:
    before = Compact.of(BODY)
    mesh = before.mesh
    assert difference(BODY, before, mesh) == ()
    moved = Mesh(mesh.vertices + np.eye(len(mesh.vertices), 3), mesh.faces, mesh.provenance)
    (verts,) = difference(BODY, before, moved)
    assert isinstance(verts, Verts)
    assert len(verts.ids) == 3
    filled = fill(mesh, None, "flat")
    assert [type(p) for p in difference(BODY, before, filled)] == [Append]
    turned = mesh.faces.copy()
    turned[7] = turned[7][[1, 2, 0]]
    other = Mesh(mesh.vertices, turned, mesh.provenance)
    assert [type(p) for p in difference(BODY, before, other)] == [Alive, Append]
    fewer = submesh(mesh, np.arange(len(mesh.faces)) % 3 > 0)
    assert [type(p) for p in difference(BODY, before, fewer)] == [Replace]
    for after in (moved, filled, other, fewer):
        done = applied(difference(BODY, before, after))
        assert done.volume == pytest.approx(after.volume)
        assert len(done.faces) == len(after.faces)
