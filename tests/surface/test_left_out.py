"""Holes of faces that were left out for their uncertainty are called removed, and no others."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from tests.edit.surfaces import around, sheet
from tests.surface.bars import leaning_bar
from turnscan.mesh import Mesh, cut_touching, submesh
from turnscan.surface.holes import LeftOut, ScanCoverage, explain, holes
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


def named(mesh: Mesh, lost: LeftOut | None) -> dict[tuple[int, int], bool]:
    """By the middle of each hole, in tens of mm, whether it was left out."""
    found = holes(mesh)
    out = left_out(mesh, found, lost)
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
    assert lost.missing[-1] == pytest.approx(np.pi * GAP**2, rel=0.1)
    assert named(mesh, lost) == {(2, 2): False, (3, 3): mine}


def test_a_gap_of_which_one_side_was_left_out_is_what_it_was() -> None:
    mesh, lost = parts((34, 30), 3.0)
    assert named(mesh, lost) == {(2, 2): False, (3, 3): False}


def ringed(inner: float, wide: float, lost: tuple[float, float]) -> list[bool]:
    """Of a sheet with an island at (20, 20), in a gap from ``inner`` to ``wide`` mm about it, what
    is between two radii left out: whether each border, the longest first, is of that."""
    full = sheet(60)
    r = np.hypot(*(full.triangles.mean(axis=1)[:, :2] - 20.0).T)
    there = ~((r > inner) & (r < wide))
    gone = there & (r > lost[0]) & (r < lost[1])
    mesh = submesh(full, there & ~gone)
    return left_out(
        mesh, holes(mesh), LeftOut.of(submesh(full, there), submesh(full, gone))
    ).tolist()


def test_an_island_that_was_left_out_all_about_is_one() -> None:
    """The rim of the sheet, the border about the island, and its own."""
    assert ringed(20.0, 20.0, (5.0, 10.0)) == [False, True, True]
    assert ringed(6.0, 12.0, (5.0, 6.0)) == [False, False, False], (
        "most of the gap was there before"
    )
    assert ringed(6.0, 12.0, (12.0, 13.0)) == [False, False, False]


def test_thousands_of_holes_take_little_room() -> None:
    full = sheet(200, noise=0.01)
    some = np.random.default_rng(1).random(len(full.vertices)) < 0.03
    gone = some[full.faces].any(axis=1)
    mesh = submesh(full, ~gone)
    lost = LeftOut.of(full, submesh(full, gone))
    found = holes(mesh)
    assert len(found) > 800
    tracemalloc.start()
    out = left_out(mesh, found, lost)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert out[1:].all()
    assert most < 5000 * len(found), "bytes: the square of them would be more"


def bar_without(axis: int, upper: bool, wide: float) -> tuple[Mesh, ScanCoverage, LeftOut]:
    """A bar that leans without the faces of one end of an axis, so many mm of it."""
    mesh, view = leaning_bar()
    off = mesh.bounds[int(upper), axis] - mesh.triangles.mean(axis=1)[:, axis]
    gone = np.abs(off) < wide
    return cut_touching(submesh(mesh, ~gone))[0], view, LeftOut.of(mesh, submesh(mesh, gone))


def test_what_was_left_out_names_its_hole() -> None:
    """The flat patch over it lies in the shadow of the part; without pictures it is known, too."""
    mesh, view, lost = bar_without(2, False, 14.0)
    found = holes(mesh)
    plain, named = (explain(mesh, found, [view], lost=known) for known in (None, lost))
    ours = int(np.argmin([h.centre[2] for h in found]))
    assert (plain[ours].cause, named[ours].cause) == ("camera", "removed")
    assert [h.cause for h in named if h.area > 100] == ["removed", "camera", "camera"]
    assert explain(mesh, found, [], lost=lost)[ours].cause == "removed"
    by_hand = explain(mesh, found, [view], cut=mesh.vertices[found[ours].loop], lost=lost)
    assert by_hand[ours].cause == "deleted"


def test_what_was_left_out_hides_what_lies_behind_it() -> None:
    """The end of the bar stands before the hole that its rim belongs to."""
    mesh, view, lost = bar_without(0, True, 20.0)
    found = holes(mesh)
    plain, named = (explain(mesh, found, [view], lost=known) for known in (None, lost))
    assert [h.cause for h in plain if 300 < h.area < 400] == ["laser", "camera"]
    assert [h.cause for h in named if 300 < h.area < 400] == ["camera", "camera"]
