"""Holes of faces that were left out for their uncertainty are called removed, and no others."""

from __future__ import annotations

import numpy as np
import pytest

from tests.edit.surfaces import around, sheet
from turnscan.mesh import Mesh, submesh
from turnscan.surface.holes import LeftOut, holes
from turnscan.surface.holes._left_out import left_out

GAP = 4.0
"""mm: radius of a gap at (30, 30) that was there before."""


def parts(at: tuple[float, float], radius: float) -> tuple[Mesh, LeftOut]:
    """A sheet with a gap, without the faces about a place, and these."""
    full = sheet()
    there = np.ones(len(full.faces), dtype=np.bool_)
    there[around(full, (30, 30), GAP)] = False
    whole = submesh(full, there)
    lost = np.zeros(len(whole.faces), dtype=np.bool_)
    lost[around(whole, at, radius)] = True
    return submesh(whole, ~lost), LeftOut.of(whole, submesh(whole, lost))


def named(mesh: Mesh, lost: LeftOut | None, islands: bool = False) -> dict[tuple[int, int], bool]:
    """By the middle of each hole, in tens of mm, whether it was left out."""
    found = holes(mesh)
    out = left_out(mesh, found, lost, np.full(len(found), islands))
    middles = [tuple(np.round(h.centre[:2] / 10).astype(int).tolist()) for h in found]
    return dict(zip(middles, out.tolist(), strict=True))


def test_a_hole_where_the_surface_was_whole_is_left_out() -> None:
    mesh, lost = parts((10, 10), 6.0)
    assert named(mesh, lost) == {(2, 2): False, (3, 3): False, (1, 1): True}
    assert not any(named(mesh, None).values())
    # Vertices that a file rounds are the same ones.
    moved = Mesh(mesh.vertices + 4e-4, mesh.faces)
    assert named(moved, lost) == named(mesh, lost)


@pytest.mark.parametrize(("radius", "mine"), [(5.0, False), (7.0, True)])
def test_a_gap_whose_rim_was_left_out_is_what_most_of_it_is(radius: float, mine: bool) -> None:
    """28 mm² of rim about 50 mm² that were missing, and 104 mm²."""
    mesh, lost = parts((30, 30), radius)
    assert lost.missing[-1][1] == pytest.approx(np.pi * GAP**2, rel=0.1)
    assert named(mesh, lost) == {(2, 2): False, (3, 3): mine}
    # The border of an island encloses what is there.
    assert named(mesh, lost, islands=True) == {(2, 2): False, (3, 3): True}


def test_a_gap_of_which_one_side_was_left_out_is_what_it_was() -> None:
    mesh, lost = parts((34, 30), 3.0)
    assert named(mesh, lost) == {(2, 2): False, (3, 3): False}
