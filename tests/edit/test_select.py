"""Selections on shapes whose pieces, edges and provenance are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.edit.surfaces import around, sheet
from turnscan import edit
from turnscan.mesh import Mesh, Provenance, join
from turnscan.points import RangeGrid
from turnscan.surface.holes import holes


def mask(mesh: Mesh, faces) -> np.ndarray:
    out = np.zeros(len(mesh.faces), dtype=bool)
    out[faces] = True
    return out


def roof() -> Mesh:
    """Two flat slopes that meet at 90°, 32 faces each."""
    flat = sheet(9, size=8.0)
    x, y = flat.vertices[:, 0], flat.vertices[:, 1]
    return replace(flat, vertices=np.stack([x, y, -np.abs(x - 4.0)], axis=-1), provenance=None)


def test_what_is_beside_what() -> None:
    mesh = sheet(5)
    near = edit.beside(mesh)
    for face, others in enumerate(near):
        for other in others[others >= 0]:
            assert face in near[other]
            assert len(np.intersect1d(mesh.faces[face], mesh.faces[other])) == 2
    assert (near < 0).sum() == len(holes(mesh)[0].loop)
    dead = ~mask(mesh, [10])
    assert (edit.beside(mesh, dead)[10] == -1).all()
    assert not (edit.beside(mesh, dead) == 10).any()


@given(st.integers(0, 241), st.integers(1, 4))
def test_growing_and_shrinking(seed: int, rounds: int) -> None:
    mesh = sheet(12)
    near = edit.beside(mesh)
    one = mask(mesh, [seed])
    grown = edit.grow(one, near, rounds)
    assert grown.sum() <= 1 + 1.5 * rounds * (rounds + 1)
    assert (edit.grow(one, near, rounds + 1) & ~grown).any()
    inner = edit.shrink(grown, near, rounds)
    assert inner[seed]
    assert not (inner & ~grown).any()
    assert edit.shrink(np.ones_like(one), near).all(), "the mesh's own border takes nothing away"


def test_pieces() -> None:
    first, second = sheet(6), sheet(4)
    both = join([first, replace(second, vertices=second.vertices + (100, 0, 0))])
    near = edit.beside(both)
    found = edit.connected(mask(both, [len(first.faces) + 3]), near)
    assert np.flatnonzero(found).tolist() == list(range(len(first.faces), len(both.faces)))
    assert np.array_equal(edit.by_size(both, 20), found)
    assert not edit.by_size(both, 18).any()
    alive = ~mask(both, range(len(first.faces) - 10))
    assert edit.by_size(both, 18, alive).sum() == 10


def test_a_flood_stops_at_an_edge() -> None:
    mesh = roof()
    near = edit.beside(mesh)
    left = mesh.triangles.mean(axis=1)[:, 0] < 4.0
    start = mask(mesh, [int(np.flatnonzero(left)[3])])
    assert np.array_equal(edit.within_angle(start, near, mesh, np.deg2rad(80)), left)
    assert edit.within_angle(start, near, mesh, np.deg2rad(100)).all()


def test_by_what_is_known_of_the_corners() -> None:
    mesh = sheet(10)  # vertex k was measured at step k // 10, line k % 10
    p = mesh.provenance
    assert p is not None
    step = np.arange(100) // 10
    expected = (step[mesh.faces] >= 2).all(axis=1) & (step[mesh.faces] <= 4).all(axis=1)
    assert np.array_equal(edit.by_steps(mesh, 2, 4), expected)
    over = edit.by_steps(mesh, 8, 1)
    assert over.sum() == 2 * 18
    assert edit.by_laser(mesh, "left").all()
    assert not edit.by_laser(mesh, "right").any()
    rough = p.sigma.copy()
    rough[[0, 55]] = 0.3, np.nan
    some = replace(mesh, provenance=Provenance(rough, p.laser, p.step, p.line, p.lasers))
    assert (
        np.flatnonzero(edit.by_sigma(some, 0.1)).tolist()
        == np.flatnonzero((mesh.faces == 0).any(axis=1)).tolist()
    )
    flags = np.zeros((10, 10), np.uint16)
    flags[3, 7] = 8
    grid = RangeGrid(
        "left", np.arange(10), np.zeros(10), np.full((10, 10, 3), np.nan), np.full((10, 10), 0.1),
        np.full((10, 10), 1.0), flags, False,
    )  # fmt: skip
    hit = (mesh.faces == 37).any(axis=1)
    assert np.array_equal(edit.by_quality(mesh, [grid], 8), hit)
    assert not edit.by_quality(mesh, [grid], 4).any()


@pytest.mark.parametrize("cause", ["dark", "laser"])
def test_by_the_cause_of_a_border(cause) -> None:
    mesh = sheet(20)
    body = edit.Body.of(mesh)
    gone = edit.Alive(around(mesh, (20, 20), 5), False).on(body)
    open_mesh = edit.Compact.of(gone).mesh
    outer, inner = holes(open_mesh)
    named = [replace(outer, cause="laser"), replace(inner, cause="dark")]
    found = edit.by_cause(open_mesh, named, {cause})
    away = np.hypot(*(open_mesh.triangles.mean(axis=1)[:, :2] - (20, 20)).T)
    assert found.any()
    if cause == "dark":
        assert away[found].max() < 10
    else:
        assert away[found].min() > 15
